"""What do the zones of a recording tell? Loudness that lasts, recorded and sampled, and what a fit takes drivers for.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.zones_told dlr.parquet [--draws 4] [--write PAGE.md]

One profile is fitted to all drives with their zones, and one without. First table: covariance of the log power of two
bands, 10 to 20 s apart in a run, recorded (with a standard error over drives) and sampled under the same context: what
lasts, since two windows so far apart share no movement. Second table: what the fits hold.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin

from benchmarks.markers import show
from xosc_lateral.driver.fitting import fit_profile
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.records import plain
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.evaluation.snippets import sample_runs
from xosc_lateral.formats.drives import read_drives

FloatArray = NDArray[np.float64]

BANDS = ((0.1, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 0.5))
"""[Hz]"""
TAPS = 151
"""Of the filters between them: parted within 0.1 Hz. [-]"""
WINDOW = 25
"""Rows whose power is looked at: 5 s. [-]"""
LAGS = (2, 3, 4)
"""Windows apart. [-]"""
RESAMPLES = 200
"""Of the drives, for the standard errors."""


def levels(path: FloatArray) -> FloatArray:
    """Log power of each band in successive windows, shape (bands, windows). [-]"""
    found = []
    for band in BANDS:
        kernel = firwin(TAPS, band, fs=1.0 / STEP, pass_zero=False, window=("kaiser", 7.0))
        moved = np.convolve(path, kernel, "valid")
        count = len(moved) // WINDOW
        found.append(np.log((moved[: count * WINDOW].reshape(count, WINDOW) ** 2).mean(axis=1) + 1e-16))
    return np.array(found)


def products(runs: Sequence[Run], paths: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """For each drive the sum of products of levels that lie apart, shape (drives, bands, bands), and how many. [-]"""
    long = [(run.drive, levels(path)) for run, path in zip(runs, paths, strict=True) if len(path) > TAPS + 4 * WINDOW]
    mean = np.concatenate([one for _, one in long], axis=1).mean(axis=1, keepdims=True)
    sums: dict[str, FloatArray] = {}
    counts: dict[str, int] = {}
    for drive, one in long:
        about = one - mean
        for lag in LAGS:
            n = about.shape[1] - lag
            if n > 0:
                both = about[:, :n] @ about[:, lag:].T
                sums[drive] = sums.get(drive, np.zeros(both.shape)) + 0.5 * (both + both.T)
                counts[drive] = counts.get(drive, 0) + n
    return np.array(list(sums.values())), np.array([counts[drive] for drive in sums], dtype=np.float64)


def covariance(runs: Sequence[Run], paths: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Of the bands' levels, shape (bands, bands), and its standard error over drives. [-]"""
    sums, counts = products(runs, paths)
    rng = np.random.default_rng(0)
    drawn = [rng.integers(len(sums), size=len(sums)) for _ in range(RESAMPLES)]
    again = np.array([sums[rows].sum(axis=0) / counts[rows].sum() for rows in drawn])
    return sums.sum(axis=0) / counts.sum(), again.std(axis=0)


def lasting(profiles: Sequence[DriverProfile], runs: Sequence[Run], draws: int) -> list[str]:
    recorded, error = covariance(runs, [run.offset for run in runs])
    sampled = [
        np.mean([covariance(runs, sample_runs(one, runs, k, same_start=False))[0] for k in range(draws)], axis=0)
        for one in profiles
    ]
    lines = ["| bands [Hz] | recorded | sampled, zones unknown | sampled, zones known |", "|---|---|---|---|"]
    for a, b in combinations_with_replacement(range(len(BANDS)), 2):
        names = " and ".join(f"{low:g} to {high:g}" for low, high in ([BANDS[a]] if a == b else [BANDS[a], BANDS[b]]))
        cells = " | ".join(f"{one[a, b]:.2f}" for one in sampled)
        lines.append(f"| {names} | {recorded[a, b]:.2f} ± {error[a, b]:.2f} | {cells} |")
    return lines


def held(profiles: Sequence[DriverProfile]) -> list[str]:
    lines = ["| log of the size | zones unknown | zones known |", "|---|---|---|"]
    rows: dict[str, list[float]] = {}
    for profile in profiles:
        model, sensor = plain(profile.model), profile.sensor
        for part in ("coarse", "fine"):
            for kept, words in (("between", "variance between drivers"), ("within", "variance within drivers")):
                rows.setdefault(f"{part} movement, {words}", []).append(model[f"{part}_volatility"][kept])
        slope_jumps = None if sensor is None else sensor.slope_jumps
        if slope_jumps is not None:
            level = slope_jumps if slope_jumps.by_zone is None else slope_jumps.by_zone
            rows.setdefault("slope jumps, variance within tracks", []).append(0.25 * level.level_variance)
            rows.setdefault("slope jumps, variance between tracks", []).append(0.25 * level.track_variance)
    return lines + [f"| {name} | {' | '.join(f'{value:.3f}' for value in values)} |" for name, values in rows.items()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    drives = read_drives(args.table)
    profiles = [fit_profile(some, name="all") for some in ([replace(drive, zone=None) for drive in drives], drives)]
    show("\n".join([*lasting(profiles, all_runs(drives), args.draws), "", *held(profiles)]), args.write, "zones-told")


if __name__ == "__main__":
    main()
