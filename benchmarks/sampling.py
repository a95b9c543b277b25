"""Speed of sampling beside the random generator's own, and of fitting, in one run.

    python -m benchmarks.sampling [DRIVE_TABLE]

Times are processor time of one core, the best of several; compiling (once per machine, kept on disk) is left out.
Without a table the profiles are fitted to simulated offsets.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from xosc_lateral.driver.effects import Acts, Drift, Linear
from xosc_lateral.driver.fitting import fit_runs
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.sampling import OffsetSampler
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.formats.drives import read_drives
from xosc_lateral.segment import Segment

HOURS = 10.0
EFFECTS = (
    Linear(
        acts=Acts.LOCATION,
        column="curvature",
        coefficients=(200.0,),
        errors=(1.0,),
        reference=(0.0,),
        lag_s=-1.0,
        response_s=2.0,
    ),
    Linear(acts=Acts.SPREAD, column="speed", coefficients=(0.01,), errors=(0.001,), reference=(30.0,)),
    Drift(size=0.1),
)


def seconds(task: Callable[[], object], repeats: int = 5) -> float:
    task()
    taken = []
    for _ in range(repeats):
        begin = time.process_time()
        task()
        taken.append(time.process_time() - begin)
    return min(taken)


def simulated_runs() -> list[Run]:
    """50 min of an Ornstein-Uhlenbeck wander in pieces of 150 s."""
    rng = np.random.default_rng(1)
    values, x = np.empty(15_000), 0.0
    for i, shock in enumerate(rng.normal(size=len(values))):
        x = 0.96 * x + 0.02 * shock
        values[i] = 3.5 * x
    pieces = values.reshape(20, -1)
    return [Run("made", k, STEP * np.arange(750.0), piece, np.full(750, 3.5)) for k, piece in enumerate(pieces)]


def sampled(profile: DriverProfile, segment: Segment) -> Callable[[], object]:
    return lambda: OffsetSampler(profile, 1).sample(segment)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", type=Path, metavar="DRIVE_TABLE")
    tables = parser.parse_args().tables
    begin = time.process_time()
    drives = read_drives(tables) if tables else []
    read = time.process_time() - begin
    runs = all_runs(drives) if tables else simulated_runs()
    cut = time.process_time() - begin - read
    n = round(HOURS * 3600 / STEP)
    grid = STEP * np.arange(n, dtype=np.float64)
    context = {"curvature": 1e-3 * np.sin(grid / 30.0)}
    segment = Segment(grid, np.full(n, 3.5), np.full(n, 30.0), context)
    rng = np.random.default_rng(1)
    own = seconds(lambda: rng.random(n))
    print(f"Generator.random: {1e9 * own / n:.2f} ns a number; {HOURS:g} h at 5 Hz are {n} offsets")
    if tables:
        print(f"reading {read:.2f} s, cutting and resampling {cut:.2f} s")
    for model in ("two-level", "best"):
        fitting = seconds(lambda model=model: fit_runs(runs, name="bench", model=model), 3)
        profile = fit_runs(runs, name="bench", model=model)
        rich = DriverProfile("rich", profile.model, EFFECTS, profile.lane_width)
        bare, full = seconds(sampled(profile, segment)), seconds(sampled(rich, segment))
        print(
            f"{model}: fit {fitting:.2f} s; sample {1e9 * bare / n:.1f} ns an offset, {bare / own:.1f} times the "
            f"generator's, {HOURS * 3600 / bare / 1e6:.1f} million times real time; "
            f"with {len(EFFECTS)} effects {full / own:.1f} times"
        )


if __name__ == "__main__":
    main()
