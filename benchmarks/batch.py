"""Batch conversion: scenarios per second and core, memory, and how both grow with the number of outputs.

    python -m benchmarks.batch SCENARIOS... [--profile NAME|PATH] [--outputs 100 1000 10000] [--jobs 2]

The same files, read by a plain lxml parse and written again, stand beside it. Outputs beyond the number of scenarios
are variants. On a busy machine look at the CPU time per output, not at the rate.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

from lxml import etree

from xosc_lateral.pipeline.batch import JobState, convert_many
from xosc_lateral.pipeline.jobs import Batch, plan_batch
from xosc_lateral.pipeline.settings import AUTO, ConvertSettings


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("scenarios", nargs="+")
    arguments.add_argument("--profile", default=AUTO)
    arguments.add_argument("--outputs", type=int, nargs="+", default=[100, 1000, 10_000])
    arguments.add_argument("--jobs", type=int, default=2)
    options = arguments.parse_args()
    settings = ConvertSettings(profile=options.profile)
    with tempfile.TemporaryDirectory(prefix="batch-benchmark-") as folder:
        out = Path(folder)
        batch = convertible(plan_batch(options.scenarios, out / "once", settings), options.jobs)
        sources = [job.source for job in batch.jobs]
        plain = rewrite(sources, out)
        rewritten = rewrite([job.output for job in batch.jobs], out)
        print(f"{len(batch)} scenarios that can be converted, {options.jobs} processes")
        print(f"lxml parse and write, one core: inputs {plain:.0f} per second, outputs {rewritten:.0f} per second")
        print(f"{'outputs':>8} {'s':>8} {'1/s':>7} {'1/s/core':>9} {'CPU ms':>7} {'parent MB':>10} {'worker MB':>10}")
        for count in options.outputs:
            cpu = cpu_seconds()
            seconds = convert(sources, out / str(count), settings, count, options.jobs)
            parent, worker = (peak(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
            rate, each = count / seconds, 1000.0 * (cpu_seconds() - cpu) / count
            speed = f"{count:8d} {seconds:8.1f} {rate:7.1f} {rate / options.jobs:9.1f} {each:7.1f}"
            print(f"{speed} {parent:10.0f} {worker:10.0f}", flush=True)


def convertible(batch: Batch, jobs: int) -> Batch:
    outcomes = list(convert_many(batch, workers=jobs))
    print(dict(Counter(outcome.state.value for outcome in outcomes)))
    written = {outcome.row.output for outcome in outcomes if outcome.state is JobState.WRITTEN}
    return replace(batch, jobs=tuple(job for job in batch.jobs if job.name in written))


def rewrite(paths: list[Path], folder: Path) -> float:
    """Files per second."""
    start = time.perf_counter()
    for path in paths:
        etree.parse(path).write(folder / "rewritten.xosc", xml_declaration=True, encoding="utf-8")
    return len(paths) / (time.perf_counter() - start)


def convert(sources: list[Path], folder: Path, settings: ConvertSettings, count: int, jobs: int) -> float:
    """Seconds for so many outputs, planning and manifest included."""
    start = time.perf_counter()
    variants = -(-count // len(sources))
    batch = plan_batch(list(dict.fromkeys(sources)), folder, settings, variants=variants)
    batch = replace(batch, jobs=batch.jobs[:count])
    failed = [outcome.row.error for outcome in convert_many(batch, workers=jobs) if outcome.row.error]
    assert not failed, failed[0]
    return time.perf_counter() - start


def cpu_seconds() -> float:
    """Of this process and of the workers that have ended."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def peak(who: int) -> float:
    return resource.getrusage(who).ru_maxrss / 1024


if __name__ == "__main__":
    main()
