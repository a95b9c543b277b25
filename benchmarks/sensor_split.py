"""How well `fit` tells driver and sensor apart: known noise on known paths.

    python benchmarks/sensor_split.py --set design [DRIVE...]

Paths are those of the driver simulator and of drive tables, low-passed at 1 Hz to stand for a truth. Noise of
five kinds is added to the rows at signal to noise ratios of 0.3, 1 and 3 (variance of the path over that of the noise).
Seeds of the first three sets were fixed before the method was written: design 100, 101; validation 110, 111; test 120,
121. Report (130, 131) is looked at whenever the page is made. The last but one column is what the driver's part of the
measured runs moves, and what runs that a profile of it samples do.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter, sosfilt, sosfiltfilt

from xosc_lateral.datasets.driver_simulator import simulate_drive
from xosc_lateral.driver.fitting import fit_runs
from xosc_lateral.driver.sensor.separation import separate
from xosc_lateral.drives.cuts import cut_runs
from xosc_lateral.drives.drive import Drive, Run
from xosc_lateral.drives.resampling import resample
from xosc_lateral.evaluation.sampled_snippets import sample_runs
from xosc_lateral.formats.drives import read_drives

SEEDS = {"design": (100, 101), "validation": (110, 111), "test": (120, 121), "report": (130, 131)}
RATIOS = (0.3, 1.0, 3.0)
STEP = 0.2
SAMPLED = range(3)
"""Seeds."""


def simulated(seed: int) -> Drive:
    """A drive whose offset is the truth."""
    made = simulate_drive(3000.0, seed=seed, sensor_rate=20.0)
    context = {"lane_index": made.table["lane_index"].to_numpy(dtype=float)}
    return Drive(f"simulated {seed}", made.truth.time, made.truth.offset, np.full(len(made.truth.time), 3.75), context)


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
    grain = spread * np.sqrt(12.0)
    yield "quantised", np.round(drive.offset / grain) * grain - drive.offset


def sampled_acceleration(runs: Sequence[Run]) -> float:
    """Second differences of what a profile of these runs samples, standard deviation. [m]"""
    profile = fit_runs(runs, name="driver")
    paths = [path for seed in SAMPLED for path in sample_runs(profile, runs, seed, same_start=False)]
    return float(np.concatenate([np.diff(path, 2) for path in paths]).std())


def main() -> None:
    """Print one line per kind and ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--set", choices=SEEDS, default="design")
    args = parser.parse_args()
    found: dict[tuple[str, float], list[tuple[float, float, float, float, bool]]] = {}
    for drive in [*map(smoothed, args.drives), *map(simulated, SEEDS[args.set])]:
        runs = cut_runs(drive)
        rows = [(drive.time >= run.time[0] - 1e-9) & (drive.time <= run.time[-1] + 1e-9) for run in runs]
        truth = np.concatenate([run.offset for run in runs])
        calm = np.concatenate([np.diff(run.offset, 2) for run in runs]).std()
        for ratio in RATIOS:
            rng = np.random.default_rng([int(10 * ratio), *map(ord, drive.name)])
            for kind, error in errors(drive, truth.std() / np.sqrt(ratio), rng):
                noisy = drive.offset + error
                measured = [noisy[mine] for mine in rows]
                even = [resample(drive.time[m], noisy[m], run.time) for m, run in zip(rows, runs, strict=True)]
                split = separate(even, STEP, rows=measured)
                parts = [split.driver_part(one, STEP) for one in even]
                variance = float(np.concatenate(parts).var())
                total = float(np.concatenate(measured).var())
                share, true = (
                    variance / total,
                    truth.var() / (truth.var() + np.concatenate([error[m] for m in rows]).var()),
                )
                low, high = split.sensor.driver_share
                found.setdefault((kind, ratio), []).append(
                    (
                        variance / truth.var(),
                        share - true,
                        float(np.concatenate([np.diff(part, 2) for part in parts]).std() / calm),
                        sampled_acceleration([replace(r, offset=p) for r, p in zip(runs, parts, strict=True)]) / calm,
                        low - 0.01 <= true <= high + 0.01,
                    )
                )
    print(
        "| noise | SNR | driver's variance / true | largest error of its share | acceleration / true | of sampled runs "
        "| in interval |"
    )
    print("|---|---|---|---|---|---|---|")
    for (kind, ratio), rows_ in found.items():
        variance, share, calm, sampled, inside = zip(*rows_, strict=True)
        print(
            f"| {kind} | {ratio:g} | {min(variance):.2f} to {max(variance):.2f} | {max(map(abs, share)):.3f} "
            f"| {min(calm):.2f} to {max(calm):.2f} | {min(sampled):.2f} to {max(sampled):.2f} "
            f"| {sum(inside)} of {len(inside)} |"
        )


if __name__ == "__main__":
    main()
