"""Memory and CPU time of a batch over its course: what a thousand outputs more cost.

    python -m benchmarks.batch_memory [--outputs 1500] [--jobs 1 2]

Variants of one template; the first third is left out of the slope, for caches fill up there. On a busy machine look at
the CPU seconds, not at the rate: two workers that share the work cost what one does, plus their start.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from xosc_lateral.pipeline.batch import convert_many
from xosc_lateral.pipeline.jobs import plan_batch
from xosc_lateral.pipeline.settings import ConvertSettings


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--outputs", type=int, default=1500)
    arguments.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    options = arguments.parse_args()
    template = Path(__file__).resolve().parents[1] / "templates" / "cut-in.xosc"
    for jobs in options.jobs:
        with tempfile.TemporaryDirectory(prefix="batch-memory-") as folder:
            measure(template, Path(folder), options.outputs, jobs)


def measure(template: Path, folder: Path, outputs: int, jobs: int) -> None:
    batch = plan_batch([template], folder, ConvertSettings(profile="motorway", time_limit=10.0), variants=outputs)
    begin, cpu = time.monotonic(), cpu_seconds()
    counts, parents, workers = [], [], []
    for number, outcome in enumerate(convert_many(batch, workers=jobs), start=1):
        assert not outcome.row.error, outcome.row.error
        if number % 25 == 0:
            counts.append(number)
            parents.append(resident(os.getpid()))
            workers.append(np.mean([resident(child) for child in children()] or [np.nan]))
    wall = time.monotonic() - begin
    late = np.array(counts) > outputs / 3
    slopes = [1000.0 * np.polyfit(np.array(counts)[late], np.array(mb)[late], 1)[0] for mb in (parents, workers)]
    each = 1000.0 * (cpu_seconds() - cpu) / outputs
    print(
        f"{jobs} workers: {outputs / wall:.1f} outputs per second, {each:.0f} ms of CPU "
        f"each; parent {parents[-1]:.0f} MB, {slopes[0]:+.2f} MB per 1000; "
        f"worker {workers[-1]:.0f} MB, {slopes[1]:+.2f} MB per 1000",
        flush=True,
    )


def resident(pid: int) -> float:
    """[MB]"""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def children() -> list[int]:
    """Workers: children that have the package loaded, so not joblib's resource tracker."""
    mine = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
    return [int(pid) for pid in mine if resident(int(pid)) > 60.0]


def cpu_seconds() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


if __name__ == "__main__":
    main()
