"""What everything costs, in one table, beside plain Python, numpy, lxml and esmini in the same run.

    python -m benchmarks.speed [--esmini PATH] [--cars 1 8 64 500] [--hours 24] [--outputs 1000] [--write PAGE]

PATH is the shared library of esmini (`libesminiLib.so`; a headless build is enough). Every line is measured in a
process of its own, as CPU time (user and system), after a first run that fills caches on disk; what takes less than a
few seconds is the best of several runs. Linear algebra has one thread (`OMP_NUM_THREADS=1`): more of them only wait,
and waiting counts as CPU time. On a machine that is shared the seconds are those of that hour, and the factors beside
them stand. All of it takes about five minutes.
"""

from __future__ import annotations

import argparse
import ctypes
import datetime
import math
import multiprocessing
import os
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import xosc_lateral as xl
from benchmarks.many_cars import write

VERB = (sys.executable, "-m", "xosc_lateral")
LONGEST = 60.0
"""esmini plays on where a scenario has no end. [s]"""

REPLAYED = {"profile": "motorway-refined", "mode": "trajectory", "ego": "none", "force": True}


def main() -> None:
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # of every process that is measured
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--esmini", type=Path, help="its shared library")
    arguments.add_argument("--scenario", type=Path, help="of the first lines; default: the template cut-in")
    arguments.add_argument("--cars", type=int, nargs="+", default=[1, 8, 64, 500])
    arguments.add_argument("--hours", type=float, default=24.0, help="of the long run of one car")
    arguments.add_argument("--outputs", type=int, default=1000, help="of the batch")
    arguments.add_argument("--write", type=Path, help="page whose table is replaced")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = list(measured(options, Path(folder)))
    table = "\n".join(["| what | CPU time | beside | memory |", "|---|---|---|---|", *rows])
    print(table)
    if options.write:
        page = options.write.read_text(encoding="utf-8")
        stamp = f"Measured {datetime.date.today()}, {os.cpu_count()} cores:\n\n"
        page = re.sub(r"Measured .*?:\n\n\|.*?\n(?=\n|\Z)", lambda _: f"{stamp}{table}\n", page, flags=re.DOTALL)
        options.write.write_text(page, encoding="utf-8")


def measured(options: argparse.Namespace, folder: Path) -> Any:
    """Lines of the table, as they come."""

    def line(what: str, task: Callable[..., tuple[float, float]], *args: Any, per: float = 1) -> float:
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            cpu, memory = pool.submit(task, *args).result()
        lines.append(f"| {what} | {1e3 * cpu / per:.3g} ms |  | {memory:.0f} MB |")
        print(lines[-1], file=sys.stderr, flush=True)
        return cpu

    lines: list[str] = []
    scenario = options.scenario or Path(xl.write_template("cut-in", folder)[0])
    lifelike, trace = folder / "lifelike.xosc", folder / "page.html"
    line("bare Python", process, [sys.executable, "-c", "pass"])
    numpy = line("`import numpy`", process, [sys.executable, "-c", "import numpy"])
    line("`import xosc_lateral`", process, [sys.executable, "-c", "import xosc_lateral"])
    for word in ("--version", "--help"):
        line(f"`{word}`", process, [*VERB, word])
    command = [*VERB, "convert", str(scenario), "-o", str(lifelike), "--ego", "none", "-q", "--force"]
    cpu = line("`convert` of one scenario", process, command)
    lines[-1] = lines[-1].replace("|  |", f"| {cpu / numpy:.1f} times `import numpy` |")
    line("the same with a report", process, [*command, "--report", str(trace)])
    line("the same within a running process", again, scenario, lifelike)
    if options.esmini:
        line("esmini plays the output", play, options.esmini, lifelike)
    before: tuple[int, float] | None = None
    for cars in options.cars:
        source = write(folder / f"cars-{cars}", cars, 60.0)
        cpu = line(f"{cars} cars for 60 s, each", convert, source, 60.0, per=cars)
        if before:
            exponent = math.log(cpu / before[1]) / math.log(cars / before[0])
            lines[-1] = lines[-1].replace("|  |", f"| exponent {exponent:.2f} |")
        before = cars, cpu
    output = source.with_name("out.xosc")
    rewritten = line(
        f"lxml reads and writes the {output.stat().st_size / 1e6:.0f} MB of them, each", rewrite, output, per=cars
    )
    lines[-1] = lines[-1].replace("|  |", f"| `convert` takes {cpu / rewritten:.1f} times |")
    if options.esmini:
        played = line("esmini plays them, each", play, options.esmini, output, per=cars)
        lines[-1] = lines[-1].replace("|  |", f"| `convert` takes {cpu / played:.1f} times |")
    source = write(folder / "long", 1, 3600.0 * options.hours, speeds=(11.5,))
    line(f"1 car for {options.hours:g} h, per hour", convert, source, 3600.0 * options.hours, per=options.hours)
    batch = folder / "batch"
    line(
        f"{options.outputs} variants, two workers, each",
        variants,
        scenario,
        batch,
        options.outputs,
        per=options.outputs,
    )
    lines[-1] = lines[-1].replace("|  |", "| workers' start included |")
    line("the same up to date, each", variants, scenario, batch, options.outputs, per=options.outputs)
    raw = line("10 h of normal numbers at 5 Hz", normals)
    for profile in ("motorway", "motorway-refined"):
        cpu = line(f"`sample` of `{profile}` for 10 h", sample, profile)
        lines[-1] = lines[-1].replace("|  |", f"| {cpu / raw:.0f} times the numbers |")
    line("`fit` of 50 min at 25 Hz", fit)
    return lines


def process(command: Sequence[str]) -> tuple[float, float]:
    """A process of its own, its start included; the best of several after a first one. [s], [MB]"""
    taken = []
    for _ in range(6):
        before = used(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        taken.append(used(resource.RUSAGE_CHILDREN) - before)
    return min(taken[1:]), peak(resource.RUSAGE_CHILDREN)


def here(task: Callable[[], object], repeats: int = 1) -> tuple[float, float]:
    """In this process; the best of several. [s], [MB]"""
    taken = []
    for _ in range(repeats):
        before = used(resource.RUSAGE_SELF)
        task()
        taken.append(used(resource.RUSAGE_SELF) - before)
    return min(taken), peak(resource.RUSAGE_SELF)


def again(scenario: Path, output: Path) -> tuple[float, float]:
    return here(lambda: xl.convert(scenario, output, ego="none", force=True), 10)


def convert(source: Path, seconds: float) -> tuple[float, float]:
    small = write(source.parent / "small", 2, 2.0)
    xl.convert(small, small.with_name("out.xosc"), **REPLAYED)
    return here(lambda: xl.convert(source, source.with_name("out.xosc"), time_limit=seconds, **REPLAYED))


def rewrite(path: Path) -> tuple[float, float]:
    from lxml import etree

    return here(lambda: etree.parse(path).write(path.with_suffix(".again"), xml_declaration=True, encoding="utf-8"))


def play(library: Path, scenario: Path) -> tuple[float, float]:
    """The reference player, without a window and without a log."""
    player = ctypes.CDLL(str(library))
    os.chdir(scenario.parent)  # where its log goes
    player.SE_StepDT.argtypes, player.SE_GetSimulationTime.restype = [ctypes.c_double], ctypes.c_double

    def run() -> None:
        assert player.SE_Init(str(scenario).encode(), 0, 0, 0, 0) == 0, f"{scenario} can't be played"
        while player.SE_GetQuitFlag() == 0 and player.SE_GetSimulationTime() < LONGEST:
            player.SE_StepDT(0.02)
        player.SE_Close()

    folder = os.open(os.devnull, os.O_WRONLY)
    os.dup2(folder, 1)
    return here(run)


def variants(scenario: Path, folder: Path, count: int) -> tuple[float, float]:
    before = used(resource.RUSAGE_CHILDREN)
    cpu, memory = here(lambda: xl.convert_many([scenario], folder, variants=count, workers=2, ego=["none"]))
    return cpu + used(resource.RUSAGE_CHILDREN) - before, max(memory, peak(resource.RUSAGE_CHILDREN))


def normals() -> tuple[float, float]:
    import numpy as np

    return here(lambda: np.random.default_rng(1).normal(size=180_000), 20)


def sample(profile: str) -> tuple[float, float]:
    return here(lambda: xl.sample(profile, duration=36_000.0, seed=1), 5)


def fit() -> tuple[float, float]:
    import numpy as np
    import pandas as pd

    time_ = np.arange(0.0, 3000.0, 0.04)
    offset = np.interp(
        time_, np.arange(0.0, 3000.2, 0.2), xl.sample("motorway", duration=3000.2, seed=2).to_frame()["offset"][:15001]
    )
    table = pd.DataFrame({"time": time_, "offset": offset, "speed": 30.0, "lane_width": 3.5})
    return here(lambda: xl.fit(table, name="bench"), 2)


def used(who: int) -> float:
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def peak(who: int) -> float:
    return resource.getrusage(who).ru_maxrss / 1024


if __name__ == "__main__":
    main()
