"""How well could a driver's lateral acceleration be known beside noise, if nothing were expected of him?

    python -m laboratory.sensor_bound --set report DRIVE... [--write PAGE.md]

The drives and noises of `sensor_split`. Whoever knows the noise's power density E exactly, and expects nothing of the
driver's, D, can subtract: the power of the acceleration is then off by a standard error of sqrt(int H^2 (D + E)^2 df /
T) over the frequencies and T seconds, with H the gain from offset to second difference (E. Parzen, "On consistent
estimates of the spectrum of a stationary time series", Annals of Mathematical Statistics 28, 1957). Half of that over
the power itself is the relative error of its root mean square. `fit` knows less of the noise, and expects more of the
driver. Noise in bursts, which is not stationary, and rounding, which hangs on the path, are left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.markers import show
from laboratory.sensor_split import CALM, GUSTS, RATIOS, ROUNDED, SEEDS, STEP, drives_of, errors, in_runs
from xosc_lateral.drivers.drives.drive import Drive, cut_runs
from xosc_lateral.drivers.drives.filters import Detrend, periodograms

FloatArray = NDArray[np.float64]

WINDOW = 51.2
"""Of the periodograms. [s]"""
HIGHEST = 1.5
"""What resampling to 5 Hz keeps. [Hz]"""
MOST = 0.95
"""Of the acceleration's power, within frequencies that somebody may know to be all. [-]"""
UNKNOWN = 10.0
"""Errors beyond tell no more: nothing is known. [-]"""
LEFT_OUT = ROUNDED | {"bursts"}


def density(paths: list[FloatArray]) -> FloatArray:
    """Mean one-sided power density of even paths. [m2/Hz]"""
    size = round(WINDOW / STEP)
    windows = [periodograms(path, size, detrend=Detrend.MEAN) for path in paths if len(path) >= size]
    return np.asarray(2.0 * STEP * np.concatenate(windows).mean(axis=0))


def bounds(drive: Drive) -> Iterator[tuple[tuple[str, float], tuple[float, float]]]:
    """By noise and ratio: relative standard error of the acceleration up to 1.5 Hz, and up to where 95 % of it lies."""
    runs = cut_runs(drive)
    driver, seconds = density([run.offset for run in runs]), STEP * sum(len(run.offset) for run in runs)
    frequency = np.arange(len(driver)) / WINDOW
    gain = np.where(frequency < HIGHEST, (2.0 * np.sin(np.pi * frequency * STEP)) ** 4, 0.0)
    power = np.cumsum(gain * driver) / WINDOW
    most = np.arange(len(driver)) <= np.searchsorted(power, MOST * power[-1])
    spread = float(np.concatenate([run.offset for run in runs]).std())
    for ratio in RATIOS:
        rng = np.random.default_rng(int(10 * ratio))
        for kind, error in errors(drive, spread / np.sqrt(ratio), rng):
            if kind in LEFT_OUT:
                continue
            noise = density(in_runs(drive, runs, error))
            square = np.cumsum((gain * (driver + noise)) ** 2) / WINDOW / seconds
            whole, within = square[-1], square[most][-1]
            found = 0.5 * np.sqrt([whole, within]) / power[-1]
            yield (kind, ratio), (float(found[0]), float(found[1]))


def table(found: dict[tuple[str, float], list[tuple[str, float, float]]]) -> str:
    """Medians over the drives of each group, in percent."""
    lines = ["| noise | SNR | tables | simulated, no gusts | simulated, gusts |", "|---|---|---|---|---|"]
    for (kind, ratio), several in found.items():
        cells = []
        for group in ("", CALM, GUSTS):
            own = [one[1:] for one in several if one[0] == group]
            cells.append(" / ".join(map(_percent, np.median(own, axis=0).tolist())) if own else "-")
        lines.append(f"| {kind} | {ratio:g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share < UNKNOWN else f"> {100.0 * UNKNOWN:.0f} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--set", choices=SEEDS, default="design")
    parser.add_argument("--write", type=Path, metavar="PAGE.md")
    args = parser.parse_args()
    found: dict[tuple[str, float], list[tuple[str, float, float]]] = {}
    for drive in drives_of(args.drives, args.set):
        group = next((name for name in (CALM, GUSTS) if drive.name.startswith(name)), "")
        for key, one in bounds(drive):
            found.setdefault(key, []).append((group, *one))
    show(table(found), args.write, "sensor-bound")


if __name__ == "__main__":
    main()
