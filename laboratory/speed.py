"""What everything costs, in one table, beside plain Python, numpy, lxml and esmini in the same run.

    python -m laboratory.speed [--esmini PATH] [--cars 1 8 64 500] [--hours 24] [--crowd 500 1] [--outputs 1000 10000]
                               [--folder FOLDER] [--write PAGE]

PATH is the shared library of esmini (`libesminiLib.so`; a headless build is enough). Every line is measured in a
process of its own, as CPU time (user and system), after a first run that fills caches on disk; what takes less than a
few seconds is the best of several runs. Linear algebra has one thread (`OMP_NUM_THREADS=1`): more of them only wait,
and waiting counts as CPU time. On a machine that is shared the seconds are those of that hour, and the factors beside
them stand. All of it takes about half an hour and 40 GB of disk, most of both for `--crowd` (cars and hours; 0 0 leaves
it out); without that, 10 minutes and 2 GB.
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
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import xosc_lateral as xl
from laboratory.many_cars import write

VERB = (sys.executable, "-m", "xosc_lateral")
LONGEST = 60.0
"""esmini plays on where a scenario has no end. [s]"""

REPLAYED = {"profile": "motorway", "mode": "trajectory", "ego": "none", "force": True}

HEADER = ("what", "CPU time", "at most", "beside", "memory")


class Cost(NamedTuple):
    """Of one task: CPU time [s] and the most memory [MB], of workers, too, where there are any."""

    cpu: float
    memory: float
    workers: float = 0.0


def main() -> None:
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # of every process that is measured
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--esmini", type=Path, help="its shared library")
    arguments.add_argument("--scenario", type=Path, help="of the first lines; default: the template cut-in")
    arguments.add_argument("--cars", type=int, nargs="+", default=[1, 8, 64, 500])
    arguments.add_argument("--hours", type=float, default=24.0, help="of the long run of one car")
    arguments.add_argument("--crowd", type=float, nargs=2, default=[500, 1.0], help="cars and hours of a large run")
    arguments.add_argument("--outputs", type=int, nargs="+", default=[1000, 10_000], help="of the batches")
    arguments.add_argument("--folder", type=Path, help="on whose disk it works")
    arguments.add_argument("--write", type=Path, help="page whose table is replaced")
    options = arguments.parse_args()
    table = Table()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        one_scenario(table, options, Path(folder))
        many_cars(table, options, Path(folder))
        long_runs(table, options, Path(folder))
        batches(table, options, Path(folder))
        drivers(table)
    print(table)
    if options.write:
        page = options.write.read_text(encoding="utf-8")
        stamp = f"Measured {datetime.date.today()}, {os.cpu_count()} cores:\n\n"
        page = re.sub(r"Measured .*?:\n\n\|.*?\n(?=\n|\Z)", lambda _: f"{stamp}{table}\n", page, flags=re.DOTALL)
        options.write.write_text(page, encoding="utf-8")


class Table:
    """Lines as they are measured."""

    def __init__(self) -> None:
        self.lines = [f"| {' | '.join(HEADER)} |", "|---" * len(HEADER) + "|"]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def line(
        self,
        what: str,
        task: Callable[..., Cost],
        *args: Any,
        per: float = 1,
        at_most: str = "",
        beside: Callable[[float], str] | str = "",
    ) -> float:
        """Measure a task in a process of its own and say what it costs; returns its CPU time. [s]"""
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            cost = pool.submit(task, *args).result()
        memory = f"{cost.memory:.0f} MB" + (f", workers {cost.workers:.0f} MB" if cost.workers else "")
        said = beside if isinstance(beside, str) else beside(cost.cpu)
        self.lines.append(f"| {what} | {shown(cost.cpu / per)} | {at_most} | {said} | {memory} |")
        print(self.lines[-1], file=sys.stderr, flush=True)
        return cost.cpu


def shown(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 0.9995 else f"{seconds:.3g} s"


def times(other: float, what: str) -> Callable[[float], str]:
    return lambda cpu: f"{cpu / other:.1f} times {what}"


def one_scenario(table: Table, options: argparse.Namespace, folder: Path) -> None:
    """Processes that start, and one conversion."""
    scenario = scenario_of(options, folder)
    lifelike = folder / "lifelike.xosc"
    python = table.line("bare Python", process, [sys.executable, "-c", "pass"])
    numpy = table.line("`import numpy`", process, [sys.executable, "-c", "import numpy"])

    def above(cpu: float) -> str:
        return f"{shown(cpu - python)} above Python"

    library = [sys.executable, "-c", "import xosc_lateral"]
    table.line("`import xosc_lateral`", process, library, at_most="100 ms", beside=above)
    for word in ("--version", "--help"):
        table.line(f"`{word}`", process, [*VERB, word], at_most="Python and 150 ms", beside=above)
    table.line("`profiles show motorway`", process, [*VERB, "profiles", "show", "motorway"])
    command = [*VERB, "convert", str(scenario), "-o", str(lifelike), "--ego", "none", "-q", "--force"]
    beside = times(numpy, "`import numpy`")
    table.line("`convert` of one scenario", process, command, at_most="400 ms", beside=beside)
    table.line("with a report", process, [*command, "--report", str(folder / "page.html")], at_most="1 s")
    cpu = table.line("within a running process", again, scenario, lifelike, at_most="15 ms")
    if options.esmini:
        table.line("esmini plays the output", play, options.esmini, lifelike, beside=lambda c: convert_takes(cpu, c))


def scenario_of(options: argparse.Namespace, folder: Path) -> Path:
    if options.scenario:
        return Path(options.scenario)
    (folder / "one").mkdir(exist_ok=True)
    return Path(xl.write_template("cut-in", folder / "one", force=True)[0])


def convert_takes(cpu: float, other: float) -> str:
    return f"`convert` takes {cpu / other:.2g} times"


def many_cars(table: Table, options: argparse.Namespace, folder: Path) -> None:
    """A minute of ever more cars, and the same bytes without us."""
    before: tuple[int, float] | None = None
    for cars in options.cars:
        source = write(folder / f"cars-{cars}", cars, 60.0)

        def exponent(cpu: float, cars: int = cars, before: tuple[int, float] | None = before) -> str:
            grown = "" if before is None else math.log(cpu / before[1]) / math.log(cars / before[0])
            return "" if before is None else f"exponent {grown:.2f} (at most 1.1)"

        what = f"{cars} car{'s' if cars > 1 else ''} for 60 s, each"
        at_most = "20 ms" if cars >= 500 else ""
        cpu = table.line(what, convert, source, 60.0, per=cars, at_most=at_most, beside=exponent)
        before = cars, cpu
    output = source.with_name("out.xosc")
    what = f"lxml reads and writes the {output.stat().st_size / 1e6:.0f} MB of them, each"
    table.line(what, rewrite, output, per=cars, beside=lambda c: convert_takes(cpu, c))
    if options.esmini:
        what = "esmini plays them, each"
        table.line(what, play, options.esmini, output, per=cars, beside=lambda c: convert_takes(cpu, c))


def long_runs(table: Table, options: argparse.Namespace, folder: Path) -> None:
    """Whose memory does not grow with their duration."""
    cars, hours = options.crowd
    for number, long, speeds in ((1, options.hours, (11.5,)), (round(cars), hours, (24.0, 29.0, 34.0))):
        if not (number and long):
            continue
        place = folder / f"long-{number}"
        source = write(place, number, 3600.0 * long, speeds=speeds)
        what = f"{number} car{'s' if number > 1 else ''} for {long:g} h, a minute of each"
        args = (source, 3600.0 * long)
        table.line(what, convert, *args, per=60.0 * number * long, at_most="600 MB", beside=lambda cpu: shown(cpu))
        shutil.rmtree(place)


def batches(table: Table, options: argparse.Namespace, folder: Path) -> None:
    """Variants of one scenario; what the pipeline adds to their conversions."""
    scenario = scenario_of(options, folder)
    for count in options.outputs:
        batch = folder / f"batch-{count}"
        what = f"{count} variants, two workers, each"
        said = "workers' start included"
        table.line(what, variants, scenario, batch, count, 2, per=count, at_most="20 ms", beside=said)
        table.line("up to date, each", variants, scenario, batch, count, 2, per=count, at_most="0.5 ms")
        shutil.rmtree(batch)
    count = min(options.outputs)
    alone = table.line(f"{count} conversions by themselves, each", one_by_one, scenario, folder, count, per=count)

    def share(cpu: float) -> str:
        return f"{100.0 * (1.0 - alone / cpu):.0f} % for hashes, journal and manifest (at most 10)"

    table.line("in a batch in one process, each", in_a_batch, scenario, folder, count, per=count, beside=share)


def drivers(table: Table) -> None:
    """Sampling, fitting, closing the loop."""
    raw = table.line("10 h of normal numbers at 5 Hz", normals)
    beside = times(raw, "the numbers")
    table.line("`sample` of `motorway` for 10 h", sample, "motorway", at_most="15 times", beside=beside)
    table.line("`fit` of 50 min at 25 Hz", fit)
    table.line("`close_loop` of 50 min at 10 Hz", loop)


# ---- tasks, each in a process of its own -----------------------------------------------------------------------------
def process(command: Sequence[str]) -> Cost:
    """A process of its own, its start included; the best of several after a first one."""
    taken = []
    for _ in range(6):
        before = used(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        taken.append(used(resource.RUSAGE_CHILDREN) - before)
    return Cost(min(taken[1:]), peak(resource.RUSAGE_CHILDREN))


def here(task: Callable[[], object], repeats: int = 1) -> Cost:
    """In this process; the best of several."""
    taken = []
    for _ in range(repeats):
        before = used(resource.RUSAGE_SELF)
        task()
        taken.append(used(resource.RUSAGE_SELF) - before)
    return Cost(min(taken), peak(resource.RUSAGE_SELF))


def again(scenario: Path, output: Path) -> Cost:
    return here(lambda: xl.convert(scenario, output, ego="none", force=True), 20)


def convert(source: Path, seconds: float) -> Cost:
    small = write(source.parent / "small", 2, 2.0)
    xl.convert(small, small.with_name("out.xosc"), **REPLAYED)
    return here(lambda: xl.convert(source, source.with_name("out.xosc"), time_limit=seconds, **REPLAYED))


def rewrite(path: Path) -> Cost:
    from lxml import etree

    return here(lambda: etree.parse(path).write(path.with_suffix(".again"), xml_declaration=True, encoding="utf-8"))


def play(library: Path, scenario: Path) -> Cost:
    """The reference player, without a window and without a log."""
    player = ctypes.CDLL(str(library.resolve()))
    os.chdir(scenario.parent)  # where its log goes
    player.SE_StepDT.argtypes, player.SE_GetSimulationTime.restype = [ctypes.c_double], ctypes.c_double

    def run() -> None:
        assert player.SE_Init(str(scenario).encode(), 0, 0, 0, 0) == 0, f"{scenario} can't be played"
        while player.SE_GetQuitFlag() == 0 and player.SE_GetSimulationTime() < LONGEST:
            player.SE_StepDT(0.02)
        player.SE_Close()

    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    return here(run)


def variants(scenario: Path, folder: Path, count: int, workers: int) -> Cost:
    before = used(resource.RUSAGE_CHILDREN)
    own = here(lambda: xl.convert_many([scenario], folder, variants=count, workers=workers, ego=["none"]))
    return Cost(own.cpu + used(resource.RUSAGE_CHILDREN) - before, own.memory, peak(resource.RUSAGE_CHILDREN))


def one_by_one(scenario: Path, folder: Path, count: int) -> Cost:
    def run(numbers: range) -> None:
        for number in numbers:
            xl.convert(scenario, folder / f"alone-{number}.xosc", variant=number, ego="none", force=True)

    run(range(1, 3))
    return here(lambda: run(range(1, count + 1)))


def in_a_batch(scenario: Path, folder: Path, count: int) -> Cost:
    variants(scenario, folder / "warm", 2, 0)
    return variants(scenario, folder / "batch", count, 0)


def normals() -> Cost:
    import numpy as np

    return here(lambda: np.random.default_rng(1).normal(size=180_000), 20)


def sample(profile: str) -> Cost:
    return here(lambda: xl.sample(profile, duration=36_000.0, seed=1), 5)


def fit() -> Cost:
    import numpy as np
    import pandas as pd

    time_ = np.arange(0.0, 3000.0, 0.04)
    offset = np.interp(
        time_, np.arange(0.0, 3000.2, 0.2), xl.sample("motorway", duration=3000.2, seed=2).to_frame()["offset"][:15001]
    )
    table = pd.DataFrame({"time": time_, "offset": offset, "speed": 30.0, "lane_width": 3.5})
    return here(lambda: xl.fit(table, name="bench"), 2)


def loop() -> Cost:
    from laboratory.identification_drives import long_drive

    table = long_drive("steering", 3000.0, 1)
    return here(lambda: xl.close_loop(table, seed=1))


def used(who: int) -> float:
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def peak(who: int) -> float:
    return resource.getrusage(who).ru_maxrss / 1024


if __name__ == "__main__":
    main()
