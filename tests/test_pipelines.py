"""Examples for pipelines do what they say; where Spark or Ray is not installed, a line stands in for it.

What a stand-in shows: our side of the call. That the frameworks call it so is their documentation's word.
"""

from __future__ import annotations

import json
import runpy
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

import xosc_lateral as xl

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "pipelines"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("pipelines")
    scenario, _ = xl.write_template("braking-leader", folder)
    scenario.rename(folder / "scenario.xosc")
    return folder


@pytest.fixture(scope="module")
def expected(folder) -> bytes:
    return xl.convert(folder / "scenario.xosc", seed=1).data


def test_spark_maps_tables(folder, expected, monkeypatch):
    if find_spec("pyspark") is None:
        monkeypatch.setitem(sys.modules, "pyspark", SimpleNamespace())
        monkeypatch.setitem(sys.modules, "pyspark.sql", SimpleNamespace(SparkSession=None))
    row = {"name": "a", "xosc": (folder / "scenario.xosc").read_bytes()}
    table = pd.DataFrame([row | {"xodr": next(folder.glob("*.xodr")).read_bytes()}])
    (made,) = runpy.run_path(str(EXAMPLES / "spark_job.py"))["lifelike"](iter([table]))
    assert made["xosc"].tolist() == [expected] and made["name"].tolist() == ["a"]


def test_ray_takes_a_folder(folder, expected, monkeypatch):
    if find_spec("ray") is None:
        as_it_is = SimpleNamespace(
            remote=lambda call: SimpleNamespace(remote=call), put=lambda value: value, get=lambda values: list(values)
        )
        monkeypatch.setitem(sys.modules, "ray", as_it_is)
    assert runpy.run_path(str(EXAMPLES / "ray_tasks.py"))["convert_folder"](folder) == [expected]


def test_a_function_as_a_service_answers(folder, expected):
    handler = runpy.run_path(str(EXAMPLES / "lambda_handler.py"))["handler"]
    road = next(folder.glob("*.xodr")).read_text(encoding="utf-8")
    body = {"scenario": (folder / "scenario.xosc").read_text(encoding="utf-8"), "road": road, "seed": 1}
    assert handler({"body": json.dumps(body)})["body"].encode() == expected
    refused = handler({"body": json.dumps(body | {"scenario": "<nothing/>"})})
    assert refused["statusCode"] == 422 and "not OpenSCENARIO" in refused["body"]


def test_the_notebook_makes_and_converts_a_scenario():
    cells = json.loads((EXAMPLES / "scenariogeneration.ipynb").read_text(encoding="utf-8"))["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert names["result"].enriched == ("Car",) and names["result"].output is None
    assert names["lifelike"].storyboard.init.initactions.keys() == {"Car"}
