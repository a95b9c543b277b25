"""How well `fit` tells driver and sensor apart: known noise on known paths.

    python -m laboratory.sensor_split --set design [DRIVE...] [--write PAGE.md]

Paths are those of the driver simulator, each with its gusts (which shake the car up to 2.5 Hz, and which nobody steers)
and without, and those of drive tables, low-passed at 1 Hz to stand for a truth. Noise of eight kinds is added to the
rows at signal to noise ratios of 0.3, 1 and 3 (variance of the path over that of the noise). Seeds of the first three
sets were fixed before the method was written: design 100, 101; validation 110, 111; test 120, 121. Report (130, 131) is
looked at whenever the page is made. Accelerations are those of the driver's part of the measured runs, and of runs that
a profile of it samples. With `--second-view` each of two lane markings has such an error of its own, and the lane width
shows them, too; with `--known` the noise's standard deviation is given, as `fit --sensor-noise` takes it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter, sosfilt, sosfiltfilt

from examples.driver_simulator.simulator import simulate_drive
from laboratory.markers import show
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import Drive, Run, cut_runs, resample
from xosc_lateral.drivers.evaluation.snippets import sample_runs
from xosc_lateral.drivers.fitting.fitting import fit_runs
from xosc_lateral.drivers.fitting.sensor.separation import separate
from xosc_lateral.files.drives import read_drives

SEEDS = {"design": (100, 101), "validation": (110, 111), "test": (120, 121), "report": (130, 131)}
RATIOS = (0.3, 1.0, 3.0)
STEP = 0.2
SAMPLED = range(3)
"""Seeds."""

CALM, GUSTS = "calm", "gusts"
"""What names of simulated drives begin with, without gusts and with."""

QUANTISED, WHITE_AND_ROUNDED = "quantised", "white, rounded"
ROUNDED = frozenset({QUANTISED, WHITE_AND_ROUNDED})
"""Errors that hang on the path."""

ROUNDING = 1.0 / 3.0
"""Share of an error that is white and rounded that rounding has. [-]"""

CLOSE, AS_BRISK = 0.1, 0.15
"""What is asked of the driver's variance and of the acceleration. [-]"""


def simulated(seed: int, *, gusts: bool = True) -> Drive:
    """A drive whose offset is the truth."""
    made = simulate_drive(3000.0, seed=seed, sensor_rate=20.0)
    if not gusts:
        calm = replace(made.truth.driver, gusts=0.0)
        made = simulate_drive(3000.0, seed=seed, driver=calm, sensor_rate=20.0)
    context = {"lane_index": made.table["lane_index"].to_numpy(dtype=float)}
    return Drive(
        f"{GUSTS if gusts else CALM} {seed}",
        made.truth.time,
        made.truth.offset,
        np.full(len(made.truth.time), 3.75),
        context,
    )


def smoothed(path: Path) -> Drive:
    """A measured drive, low-passed across lane changes too, whose sensor was good enough to pass for a truth."""
    drive = read_drives(path)[0]
    steps = np.diff(drive.offset, prepend=drive.offset[0])
    lanes = np.cumsum(np.where(np.abs(steps) > 1.5, steps, 0.0))
    grid = np.arange(drive.time[0], drive.time[-1], 0.05)
    even = np.interp(grid, drive.time, drive.offset - lanes)
    slow = sosfiltfilt(butter(4, 1.0, fs=20.0, output="sos"), even)
    return replace(drive, name=path.stem.split(".")[0], offset=np.interp(drive.time, grid, slow) + lanes)


def errors(drive: Drive, spread: float, rng: np.random.Generator) -> Iterator[tuple[str, np.ndarray]]:
    """Noise of that standard deviation on the drive's rows, one kind after the other."""
    n = len(drive)
    grid = np.arange(drive.time[0] - 60.0, drive.time[-1] + 60.0, 0.05)
    bursts = np.repeat(rng.choice([0.2, 2.0], n // 60 + 1, p=[0.75, 0.25]), 60)[:n]
    even = rng.normal(size=len(grid))
    kinds = {
        "white": rng.normal(size=n),
        "bursts": rng.normal(size=n) * bursts,
        "low-pass 1 Hz, order 1": np.interp(drive.time, grid, sosfilt(butter(1, 1.0, fs=20.0, output="sos"), even)),
        "low-pass 0.5 Hz, order 2": np.interp(drive.time, grid, sosfilt(butter(2, 0.5, fs=20.0, output="sos"), even)),
        "clustered, 0.5 s": np.interp(drive.time, grid, lfilter([1.0], [1.0, -np.exp(-0.1)], even)),
        "clustered, 2 s": np.interp(drive.time, grid, lfilter([1.0], [1.0, -np.exp(-0.025)], even)),
    }
    for kind, error in kinds.items():
        yield kind, spread * error / error.std()
    white = spread * np.sqrt(1.0 - ROUNDING) * rng.spawn(1)[0].normal(size=n)
    for kind, noise, share in ((QUANTISED, 0.0, 1.0), (WHITE_AND_ROUNDED, white, ROUNDING)):
        grain = spread * np.sqrt(12.0 * share)
        yield kind, np.round((drive.offset + noise) / grain) * grain - drive.offset


def rows_of(drive: Drive, runs: Sequence[Run]) -> list[np.ndarray]:
    """Which of a drive's rows each run was cut from, shape (rows,)."""
    return [(drive.time >= run.time[0] - 1e-9) & (drive.time <= run.time[-1] + 1e-9) for run in runs]


def in_runs(drive: Drive, runs: Sequence[Run], values: np.ndarray) -> list[np.ndarray]:
    """What a drive's rows have, at the instants of its runs."""
    pairs = zip(rows_of(drive, runs), runs, strict=True)
    return [resample(drive.time[mine], values[mine], run.time) for mine, run in pairs]


def drives_of(tables: Sequence[Path], chosen: str) -> list[Drive]:
    """Tables, then simulated drivers of a set without gusts and with."""
    made = [simulated(seed, gusts=gusts) for gusts in (False, True) for seed in SEEDS[chosen]]
    return [*map(smoothed, tables), *made]


def sampled_acceleration(runs: Sequence[Run]) -> float:
    """Second differences of what a profile of these runs samples, standard deviation; 0 where nothing moves. [m]"""
    try:
        profile = fit_runs(runs, name="driver")
    except NotEnoughDataError:  # offsets that were all rounded to one level
        return 0.0
    paths = [path for seed in SAMPLED for path in sample_runs(profile, runs, seed, same_start=False)]
    return float(np.concatenate([np.diff(path, 2) for path in paths]).std())


@dataclass(frozen=True)
class Found:
    """One drive with one noise: ratios to the truth; and of the share its error, and whether its interval holds it.

    `by_chance` is the variance that is left of the measured one by who knows the noise's own: noise and path go
    together by chance, and no split by their densities can tell that from either.
    """

    drive: str
    variance: float
    by_chance: float
    share: float
    acceleration: float
    sampled: float
    inside: bool


def split_drive(
    drive: Drive, *, second_view: bool = False, known: bool = False
) -> Iterator[tuple[tuple[str, float], Found]]:
    """All kinds and ratios of noise on one drive; rounding has no second view."""
    rate = float(1.0 / np.median(np.diff(drive.time)))
    runs = cut_runs(drive)
    rows = rows_of(drive, runs)
    truth = np.concatenate([run.offset for run in runs])
    calm = np.concatenate([np.diff(run.offset, 2) for run in runs]).std()

    for ratio in RATIOS:
        rng = np.random.default_rng([int(10 * ratio), *map(ord, drive.name)])
        spread = truth.std() / np.sqrt(ratio)
        for kind, error in errors(drive, spread, rng):
            noisy = drive.offset + error
            even, alone = in_runs(drive, runs, noisy), in_runs(drive, runs, error)
            half_widths = None
            if second_view:
                if kind in ROUNDED:
                    continue
                wavers = 0.5 * drive.lane_width + dict(errors(drive, spread, rng))[kind]
                half_widths = in_runs(drive, runs, wavers)
            split = separate(
                even,
                STEP,
                rows=[noisy[mine] for mine in rows],
                rate=rate if known else None,
                sensor_noise=spread if known else None,
                half_widths=half_widths,
            )
            parts = [split.driver_part(one, STEP) for one in even]
            true = truth.var() / (truth.var() + np.concatenate([error[m] for m in rows]).var())
            low, high = split.sensor.driver_share
            sampled = sampled_acceleration([replace(r, offset=p) for r, p in zip(runs, parts, strict=True)])
            yield (
                (kind, ratio),
                Found(
                    drive.name,
                    float(np.concatenate(parts).var() / truth.var()),
                    float((np.concatenate(even).var() - np.concatenate(alone).var()) / truth.var()),
                    abs(split.sensor.share - true),
                    float(np.concatenate([np.diff(part, 2) for part in parts]).std() / calm),
                    float(sampled / calm),
                    bool(low - 0.01 <= true <= high + 0.01),
                ),
            )


def _range(values: Sequence[float], within: float) -> str:
    if not values:
        return "-"
    close = sum(abs(value - 1.0) <= within for value in values)
    return f"{min(values):.2f} to {max(values):.2f} ({close} of {len(values)})"


def table(found: dict[tuple[str, float], list[Found]]) -> str:
    """One line per kind and ratio; in brackets, how many drives are within what is asked."""
    lines = [
        "| noise | SNR | driver's variance / true | by who knows the noise's | error of its share "
        "| acceleration / true, tables | of sampled runs, tables | simulated, no gusts | simulated, gusts "
        "| in interval |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for (kind, ratio), drives in found.items():
        simulated_ones = [one for one in drives if one.drive.startswith((CALM, GUSTS))]
        tables = [one for one in drives if one not in simulated_ones]
        parts = [
            [one.acceleration for one in tables],
            [one.sampled for one in tables],
            [one.sampled for one in simulated_ones if one.drive.startswith(CALM)],
            [one.sampled for one in simulated_ones if one.drive.startswith(GUSTS)],
        ]
        lines.append(
            f"| {kind} | {ratio:g} | {_range([one.variance for one in drives], CLOSE)} "
            f"| {_range([one.by_chance for one in drives], CLOSE)} "
            f"| {max(one.share for one in drives):.3f} | {' | '.join(_range(part, AS_BRISK) for part in parts)} "
            f"| {sum(one.inside for one in drives)} of {len(drives)} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Print one line per kind and ratio, or write them into a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--set", choices=SEEDS, default="design")
    parser.add_argument("--second-view", action="store_true", help="the lane width shows errors of both markings")
    parser.add_argument("--known", action="store_true", help="the noise's standard deviation is given")
    parser.add_argument("--write", type=Path, metavar="PAGE.md")
    args = parser.parse_args()
    found: dict[tuple[str, float], list[Found]] = {}
    for drive in drives_of(args.drives, args.set):
        for key, one in split_drive(drive, second_view=args.second_view, known=args.known):
            found.setdefault(key, []).append(one)
    marker = "sensor-split" + "-second-view" * args.second_view + "-known" * args.known
    show(table(found), args.write, marker)


if __name__ == "__main__":
    main()
