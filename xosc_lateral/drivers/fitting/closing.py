"""Whether a fitted profile drives as its drives do: sampled once under their own context, and compared.

What chance does to a number is what it does among drives of the profile, drawn as many at a time as were measured: so
few of drives that are the profile's are doubted (Monte Carlo test [1]_, one level for all numbers together).

References
----------
.. [1] A. C. A. Hope, "A simplified Monte Carlo significance test procedure", JRSS B 30, 1968.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, significant
from xosc_lateral.drivers.drives.drive import PASS_BAND_EDGES, STEP, Run
from xosc_lateral.drivers.drives.filters import tapered_powers
from xosc_lateral.drivers.evaluation.lane_keeping import NEAR_MARKING
from xosc_lateral.drivers.evaluation.look_words import ENTRIES, LACKING, NUMBERS, ZONE
from xosc_lateral.drivers.evaluation.spectra import slow_movement
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import segment_of
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.drivers.model.seeds import child

LIKE = {
    "mean offset [m]": 0.05,
    "spread between drives [m]": 0.2,
    "spread within a drive [m]": 0.1,
    "skewness of the offset": 0.35,
    "kurtosis of the offset": 0.3,
    "skewness of lateral speed": 0.5,
    "kurtosis of lateral speed": 0.3,
    "time beyond 0.6 m": 0.55,
    "time beyond 0.9 m": 0.55,
    ZONE: np.inf,
    ENTRIES: np.inf,
}
"""Numbers, and by how much one has to differ to matter: of a mean in metres, of skewness as it is, else of the
logarithm: one and a half times the most that true fits showed beyond chance, where any did (`laboratory/closing_null`).
The last two, of the zone within 1.2 m of a marking, are shown alone: those before say as much."""

PLAIN = [name.startswith(("mean", "skewness")) for name in LIKE]
BANDS = (0.02, 0.1, 0.2, 0.4, 0.6, 0.9, 1.2)  # Edges; of what a recording does not show there is no number. [Hz]
LIKE_POWER = 0.25  # Logarithm of the movement in a band.
WINDOW, SECOND = 256, 5  # [rows]
LEAST_DRIVES, MOST_HOURS, DRAWS = 60, 60.0, 400  # Sampled at least, at most; sets drawn of them.
DOUBTED = 0.01  # Of profiles that are true, with whichever number. [-]
# A minute beyond, a millimetre in a band, 5 mm between drives are nothing. [rows], [m], [m]
LEAST_ROWS, LEAST_MOVEMENT, LEAST_BETWEEN = 300.0, 1e-3, 0.005


@dataclass(frozen=True, eq=False)
class Look:
    """Numbers of the drives and of what the profile does under their context, shape (n,) each."""

    names: Sequence[str]
    measured: FloatArray  # As it is read: metres, shares, an hour.
    sampled: FloatArray
    lack: FloatArray  # Measured less sampled, as `LIKE` counts.
    chance: FloatArray  # Up to which chance explains that.

    @property
    def lacking(self) -> list[str]:
        """Names of the numbers that don't come back."""
        like = np.append(list(LIKE.values()), np.full(len(self.names) - len(LIKE), LIKE_POWER))
        beyond = (np.abs(self.lack) > self.chance) & (np.abs(self.lack) > like)
        return [name for name, is_beyond in zip(self.names, beyond, strict=True) if is_beyond]

    def to_dict(self) -> dict[str, Any]:
        """What a profile's provenance holds: every number as measured and as sampled, and which don't come back."""
        both = zip(self.names, self.measured.tolist(), self.sampled.tolist(), strict=True)
        numbers = {name: [significant(round(value, 9), 3) for value in pair] for name, *pair in both}
        return {NUMBERS: numbers, LACKING: self.lacking}


def looked_at(profile: DriverProfile, runs: Sequence[Run]) -> DriverProfile:
    """A profile with what the closing look at it found, from the driver's part of the runs that it was fitted to."""
    known = profile.provenance
    return replace(profile, provenance=replace(known, fit={**known.fit, "look": look(profile, runs).to_dict()}))


def look(profile: DriverProfile, runs: Sequence[Run]) -> Look:
    """Compare a profile with runs, in the band that these show of the driver: its first one."""
    bands = profile.validity.bands
    top = min([PASS_BAND_EDGES, *(band.high for band in bands[:1])])
    drives = [list(parts) for _, parts in groupby(runs, lambda run: run.drive)]
    widths = [[run.lane_width for run in parts] for parts in drives]
    hours = max(sum(map(len, runs)) * STEP / 3600.0, 1e-3)
    times = int(np.clip(np.ceil(LEAST_DRIVES / len(drives)), 2, max(2, MOST_HOURS // hours)))
    edges = [pair for pair in pairwise(BANDS) if pair[1] <= 1.01 * top]

    def shown(parts: Sequence[FloatArray], number: int) -> FloatArray:
        seen = parts if top >= PASS_BAND_EDGES else [slow_movement(part, STEP, top) for part in parts]
        return _sums(seen, widths[number], edges)

    real = np.array([shown([run.offset for run in parts], k) for k, parts in enumerate(drives)])
    root, made, n = np.random.SeedSequence(0), [], len(drives)
    for k in range(times * n):
        sampler = OffsetSampler(profile, child(root, k))
        made.append(shown([sampler.sample(segment_of(run)) for run in drives[k % n]], k % n))
    sampled, rng = np.array(made), np.random.default_rng(0)
    draws = np.arange(n) + n * rng.integers(times, size=(DRAWS, n))  # each drive under its own context
    chance = np.array([_numbers(sampled[rows]) for rows in draws])
    lack = _numbers(real) - np.median(chance, axis=0)
    middle, scale = np.median(chance, axis=0), chance.std(axis=0) + 1e-9
    judged = np.append(np.isfinite(list(LIKE.values())), np.full(len(edges), True))
    away = (np.abs(chance - middle) / scale)[:, judged].max(axis=1)
    names = [*LIKE, *(f"movement at {low:g} to {high:g} Hz [m]" for low, high in edges)]
    plain = np.append(PLAIN, np.full(len(edges), False))
    both = np.array([_numbers(rows, least=0.0) for rows in (real, sampled)])
    measured, made_so = np.where(plain, both, np.exp(both))
    return Look(names, measured, made_so, lack, float(np.quantile(away, 1.0 - DOUBTED)) * scale)


def _sums(
    parts: Sequence[FloatArray], widths: Sequence[FloatArray], bands: Sequence[tuple[float, float]]
) -> FloatArray:
    """Of one drive, what adds up over drives."""
    everything = np.concatenate(parts)
    mean = float(everything.mean())
    about = everything - mean
    speed = np.concatenate([part[SECOND:] - part[:-SECOND] for part in parts if len(part) > SECOND] or [np.zeros(1)])
    near = [np.abs(part) > 0.5 * width - NEAR_MARKING for part, width in zip(parts, widths, strict=True)]
    zone = [float(sum(one.sum() for one in near)), float(sum((one[1:] & ~one[:-1]).sum() for one in near))]
    cut = np.concatenate([part[: len(part) // WINDOW * WINDOW].reshape(-1, WINDOW) for part in parts])
    taper = np.hanning(WINDOW)
    power = tapered_powers(cut - cut.mean(axis=1, keepdims=True), taper) * 2.0 / (WINDOW * (taper**2).sum())  # [m2]
    frequency = np.arange(power.shape[1]) / (WINDOW * STEP)
    by_band = [float(power[:, (frequency >= low) & (frequency < high)].sum()) for low, high in bands]
    sums = [float((about**k).sum()) for k in (2, 3, 4)] + [float((speed**k).sum()) for k in (2, 3, 4)]
    beyond = [float((np.abs(everything) > limit).sum()) for limit in (0.6, 0.9)]
    return np.array([1.0, mean, mean**2, len(everything), *sums, len(speed), *beyond, *zone, len(power), *by_band])


def _numbers(rows: FloatArray, least: float = 1.0) -> FloatArray:
    """In the order of `LIKE`, and of the bands; logarithms but for mean and skewness.

    Of what is smaller than so many times what counts as nothing, logarithms say little.
    """
    drives, mean, square, n, two, three, four, speed2, speed3, speed4, m, *rest = rows.sum(axis=0)
    far, farther, near, entries, windows, *power = rest
    tiny = 1e-12
    between = np.sqrt(max(square / drives - (mean / drives) ** 2, tiny))
    return np.array([
        mean / drives, np.log(between + least * LEAST_BETWEEN), 0.5 * np.log(two / n + tiny),
        three / n / (two / n + tiny) ** 1.5, np.log(four / n / (two / n + tiny) ** 2 + tiny),
        speed3 / m / (speed2 / m + tiny) ** 1.5, np.log(speed4 / m / (speed2 / m + tiny) ** 2 + tiny),
        *(np.log((rows_there + least * LEAST_ROWS) / n + tiny) for rows_there in (far, farther)),
        np.log(near / n + tiny), np.log(entries / n * 3600.0 / STEP + tiny),
        *(0.5 * np.log(np.array(power) / max(windows, 1.0) + (least * LEAST_MOVEMENT) ** 2 + tiny)),
    ])  # fmt: skip
