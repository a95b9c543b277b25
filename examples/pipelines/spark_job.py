"""Spark: a column of scenarios in, a column of lifelike ones out; needs pyspark, and this package on its workers.

spark-submit examples/pipelines/spark_job.py SCENARIOS.parquet OUT.parquet   (columns: name, xosc, xodr)
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pandas as pd
from pyspark.sql import SparkSession

import xosc_lateral as xl


def lifelike(tables: Iterator[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Each row's scenario converted: bytes in, bytes out."""
    for table in tables:
        pairs = zip(table["xosc"], table["xodr"], strict=True)
        yield table.assign(xosc=[xl.convert(xosc, road=xodr, seed=1).data for xosc, xodr in pairs])


if __name__ == "__main__":
    scenarios = SparkSession.builder.getOrCreate().read.parquet(sys.argv[1])
    scenarios.mapInPandas(lifelike, scenarios.schema).write.parquet(sys.argv[2])
