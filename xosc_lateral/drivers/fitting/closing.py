"""Whether a fitted profile drives as its drives do: sampled once under their own context, and compared.

What chance does to a number is what it does among drives of the profile, drawn as many at a time as were measured: so
few of drives that are the profile's are doubted (Monte Carlo test [1]_, one level for all numbers together).

References
----------
.. [1] A. C. A. Hope, "A simplified Monte Carlo significance test procedure", JRSS B 30, 1968.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import tapered_powers
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import segment_of
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.drivers.model.seeds import child

NUMBERS = (
    "spread between drives", "spread within a drive", "skewness of the offset", "kurtosis of the offset",
    "skewness of lateral speed", "kurtosis of lateral speed", "time beyond 0.6 m", "time beyond 0.9 m",
)  # fmt: skip
BANDS = (0.02, 0.1, 0.2, 0.4, 0.6, 0.9, 1.2)  # Edges; of what a recording does not show there is no number. [Hz]
WINDOW, SECOND = 256, 5  # [rows]
LEAST_DRIVES, MOST_HOURS, DRAWS = 60, 60.0, 400  # Sampled at least, at most; sets drawn of them.
DOUBTED = 0.01  # Of profiles that are true, with whichever number. [-]
LIKE = np.array([0.2, 0.15, 0.5, 0.4, 0.5, 0.4, 0.7, 0.7])  # Differences that matter to nobody: logarithms, skewness.
LIKE_POWER = 0.3  # Logarithm of the movement in a band.
LEAST_ROWS, LEAST_MOVEMENT = 300.0, 1e-3  # A minute beyond, a millimetre in a band, are nothing. [rows], [m]


def differences(profile: DriverProfile, runs: Sequence[Run]) -> dict[str, tuple[float, float]]:
    """What does not come back beyond chance, by name: as measured, and as sampled."""
    drives = [list(parts) for _, parts in groupby(runs, lambda run: run.drive)]
    hours = max(sum(map(len, runs)) * STEP / 3600.0, 1e-3)
    times = int(np.clip(np.ceil(LEAST_DRIVES / len(drives)), 2, max(2, MOST_HOURS // hours)))
    top = min([run.valid_below or np.inf for run in runs])
    bands = [pair for pair in pairwise(BANDS) if pair[1] <= 1.01 * top]
    real = np.array([_sums([run.offset for run in parts], bands) for parts in drives])
    root, made = np.random.SeedSequence(0), []
    for k in range(times * len(drives)):
        sampler = OffsetSampler(profile, child(root, k))
        made.append(_sums([sampler.sample(segment_of(run)) for run in drives[k % len(drives)]], bands))
    sampled, rng, n = np.array(made), np.random.default_rng(0), len(drives)
    draws = np.arange(n) + n * rng.integers(times, size=(DRAWS, n))  # each drive under its own context
    chance = np.array([_numbers(sampled[rows]) for rows in draws])
    measured, whole = _numbers(real), _numbers(sampled)
    middle, scale = np.median(chance, axis=0), chance.std(axis=0) + 1e-9
    most = float(np.quantile((np.abs(chance - middle) / scale).max(axis=1), 1.0 - DOUBTED))
    lack = measured - middle
    like = np.append(LIKE, np.full(len(bands), LIKE_POWER))
    names = [*NUMBERS, *(f"movement at {low:g} to {high:g} Hz [m]" for low, high in bands)]
    found = np.flatnonzero((np.abs(lack) > most * scale) & (np.abs(lack) > like))
    plain = [k for k, name in enumerate(names) if name.startswith("skewness")]
    shown = np.exp([measured, whole])
    shown[:, plain] = np.array([measured, whole])[:, plain]
    return {names[k]: (float(f"{shown[0, k]:.3g}"), float(f"{shown[1, k]:.3g}")) for k in found}


def _sums(parts: Sequence[FloatArray], bands: Sequence[tuple[float, float]]) -> FloatArray:
    """Of one drive, what adds up over drives."""
    everything = np.concatenate(parts)
    mean = float(everything.mean())
    about = everything - mean
    speed = np.concatenate([part[SECOND:] - part[:-SECOND] for part in parts if len(part) > SECOND] or [np.zeros(1)])
    cut = np.concatenate([part[: len(part) // WINDOW * WINDOW].reshape(-1, WINDOW) for part in parts])
    taper = np.hanning(WINDOW)
    power = tapered_powers(cut - cut.mean(axis=1, keepdims=True), taper) * 2.0 / (WINDOW * (taper**2).sum())  # [m2]
    frequency = np.arange(power.shape[1]) / (WINDOW * STEP)
    by_band = [float(power[:, (frequency >= low) & (frequency < high)].sum()) for low, high in bands]
    sums = [float((about**k).sum()) for k in (2, 3, 4)] + [float((speed**k).sum()) for k in (2, 3, 4)]
    beyond = [float((np.abs(everything) > limit).sum()) for limit in (0.6, 0.9)]
    return np.array([1.0, mean, mean**2, len(everything), *sums, len(speed), *beyond, len(power), *by_band])


def _numbers(rows: FloatArray) -> FloatArray:
    drives, mean, square, n, two, three, four, speed2, speed3, speed4, m, far, farther, windows, *power = rows.sum(
        axis=0
    )
    tiny = 1e-12
    between = np.sqrt(max(square / drives - (mean / drives) ** 2, tiny))
    skew, kurtosis = three / n / (two / n + tiny) ** 1.5, four / n / (two / n + tiny) ** 2
    return np.array([
        np.log(between + 0.005), 0.5 * np.log(two / n + tiny), skew, np.log(kurtosis + tiny),
        speed3 / m / (speed2 / m + tiny) ** 1.5, np.log(speed4 / m / (speed2 / m + tiny) ** 2 + tiny),
        np.log((far + LEAST_ROWS) / n), np.log((farther + LEAST_ROWS) / n),
        *(0.5 * np.log(np.array(power) / max(windows, 1.0) + LEAST_MOVEMENT**2)),
    ])  # fmt: skip
