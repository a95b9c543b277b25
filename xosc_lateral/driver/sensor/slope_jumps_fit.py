"""Are recorded tracks made of pieces, and what do their slope jumps look like?

Whether: the size of third differences of the rows, folded. A period shows as a line in the spectrum of that size,
beside what the frequencies around it have. How large: each jump of the slope by least squares over the pieces on both
sides, a cubic each that meet in value and curvature. What makes them larger at one time than at another is asked of
jumps whose spectrum is made flat, so that one jump says nothing of the next but by its level.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from xosc_lateral.driver.sensor.by_zone import ByZone, ZonedRows, levels_by_zone, tidy
from xosc_lateral.driver.sensor.periodogram import WINDOWS, windows_of
from xosc_lateral.driver.sensor.slope_jumps import SHAPE, SlopeJumps, mean_square, shape_points
from xosc_lateral.drives.filters import kaiser_design, low_pass, scale_frequencies
from xosc_lateral.drives.periodogram import Detrend, periodograms
from xosc_lateral.drives.resampling import STEP, passed
from xosc_lateral.drives.zones import Names, zone_codes

FloatArray = NDArray[np.float64]

PERIODS = (0.4, 2.5)
"""Shorter ones leave no images below the half rate of 5 Hz; of longer ones, runs show too few. [s]"""

LEAST_ROWS = 8
"""Of a piece: its six numbers, and some to average over. [-]"""

PIECE, LEAST_PIECES = 60.0, 16
"""Length of a window [s], and how many there must be for a line to be beyond chance. [-]"""

SHORTEST = 20.0
"""Periods that a piece, and a run, must hold. [-]"""

BESIDE = (3, 4, 5, 6)
"""Where a line's surroundings are looked at, in resolutions of the piece to both sides. [-]"""

PADDING = 8
"""Spectra of pieces are interpolated to so many points a resolution. [-]"""

LINE, DEVIATIONS = 2.0, 6.0
"""A line is at least so many times its surroundings, and so many standard errors of chance beyond them. [-]"""

WINDOW = 32
"""Slope jumps in a window of their spectrum. [-]"""

SEEN = round(WINDOWS[-1] / STEP)
"""Rows at 5 Hz in a window of the spectrum of all, which hardly a run is too short for. [-]"""

DURATIONS = np.geomspace(1.0, 64.0, 13)
"""Of a level that are tried, in slope jumps. [-]"""

LAGS = 24
"""Up to which levels are compared, in slope jumps. [-]"""

FAINT = 1e-3
"""Share of the typical jump below which differences in the logarithm mean nothing. [-]"""

HOLE = 0.1
"""Share of the mean density below which a spectrum is not made flat: there is more of anything else there than of
jumps. With 0.05 and 0.2 the levels' variance in the motorway recording is 0.51 and 0.59 (0.61). [-]"""

TRANSITION, ATTENUATION = (0.8, 1.2), 40.0
"""Of the low-pass to the path's own movement, in multiples of half a jump a period [-]; of what is faster [dB]."""

ROUNDS = 4
"""Of least squares, weighted by the inverse of what is expected: that of its square, which squares of normal numbers
have, would ask most where paths hardly bend and their bend is known least. No digit changes after the fourth. [-]"""

LEAST_PASSED = 0.1
"""Of the amplitude, in runs at 5 Hz; where less is left, windows show what leaks from slower movement. [-]"""

MANY = 100_000
"""Rows of ideal jumps that what is seen is held against: an error of 1 % in 0.1 Hz. [-]"""


def find_slope_jumps(
    rows: Sequence[FloatArray], rate: float, runs: Sequence[FloatArray], zoned: ZonedRows | None = None
) -> tuple[SlopeJumps, float] | None:
    """Slope jumps at even times, and the standard deviation of the rows about the pieces [m]; None: there are none.

    Parameters
    ----------
    rows : sequence of array
        Offsets as recorded, evenly in time. [m]
    rate : float
        Rows per second. [Hz]
    runs : sequence of array
        The same, or the longer of them, at 5 Hz. [m]
    zoned : ZonedRows, optional
        Where the rows were recorded.
    """
    size = _period(rows, rate)
    if size is None:
        return None
    every = size / rate
    lasting = [k for k, one in enumerate(rows) if len(one) >= SHORTEST * size]
    long = [rows[k] for k in lasting]
    found = [jumps_of(one, size, rate) for one in long]
    jumps = [one for one, _ in found]
    powers = [periodograms(one, WINDOW) for one in jumps if len(one) >= WINDOW]
    if not powers:
        return None
    densities = 2.0 * every * np.concatenate(powers).mean(axis=0)
    known = np.linspace(0.0, 0.5 / every, len(densities))
    at = np.maximum(known, known[1])  # of the slowest nothing is known: windows are no longer
    frequency, windows = windows_of(runs, STEP)  # the longest, for what is slow falls steeply
    seen = np.exp(np.interp(at, frequency[1:], np.log(windows.mean(axis=0)[1:])))
    shares = np.minimum(densities / every**2 / (2.0 * np.pi * at) ** 4 / seen, 1.0)
    noise = np.concatenate([_about_pieces(one[first:], size) for one, (_, first) in zip(long, found, strict=True)])
    flat = [flat_jumps(one, densities, every) for one in jumps]
    bends = [bends_at(one, *slope_jumps, size, rate) for one, slope_jumps in zip(long, found, strict=True)]
    with_movement, acceleration = _with_movement(flat, bends)
    levels = [_log_level(one, bend / acceleration, with_movement) for one, bend in zip(flat, bends, strict=True)]
    variance, duration, track = _level(levels)
    period, level, lasts, track, with_movement, acceleration = tidy(
        [every, variance, duration * every, track, with_movement, acceleration]
    )
    slope_jumps = SlopeJumps(period, tidy(densities), tidy(shares), level, lasts, track, with_movement, acceleration)
    if zoned is not None:
        there = [
            zoned.rows[k][first::size][: len(one)] for k, one, (_, first) in zip(lasting, flat, found, strict=True)
        ]
        whose = [zoned.drives[k] for k in lasting]
        slope_jumps = replace(slope_jumps, by_zone=_by_zone(levels, there, whose, every))
    white = 2.0 * float(noise.mean()) / rate
    return replace(slope_jumps, shape=_shape(slope_jumps, runs, white)), float(np.sqrt(noise.mean()))


def _by_zone(
    levels: Sequence[FloatArray], zones: Sequence[Names], drives: Sequence[str], every: float
) -> ByZone | None:
    """Levels of the zones, and what they leave; None where they are alike."""
    known = levels_by_zone(levels, zones, drives)
    if known is None:
        return None
    variance, duration, track = _level(
        [one - known.at(zone_codes(there)) for one, there in zip(levels, zones, strict=True)]
    )
    return ByZone(known.zones, tidy(known.levels), *tidy([variance, duration * every, track]))


def jumps_of(rows: FloatArray, size: int, rate: float) -> tuple[FloatArray, int]:
    """Jumps of the slope, one every `size` rows, where they are largest, shape (k,) [m/s]; the first one's row.

    `rows` [m] of shape (n,), `rate` [Hz].
    """
    time = np.arange(1 - size, size) / size
    shapes = [np.ones(len(time)), time, time**2, time**3, np.abs(time), np.abs(time) ** 3]
    weights = np.linalg.pinv(np.column_stack(shapes))[4] * 2.0 * rate / size
    found = np.convolve(rows, weights[::-1], "valid")
    strength = [float(np.mean(found[phase::size] ** 2)) for phase in range(size)]
    phase = int(np.argmax(strength))
    return np.asarray(found[phase::size]), phase + size - 1


def _about_pieces(rows: FloatArray, size: int) -> FloatArray:
    """Mean square of the rows about a cubic for each piece between jumps, the first at row 0. Shape (k,). [m2]"""
    pieces = rows[: len(rows) // size * size].reshape(-1, size)
    cubic = np.vander(np.linspace(-1.0, 1.0, size), 4)
    rest = pieces - pieces @ (cubic @ np.linalg.pinv(cubic))
    return np.asarray((rest**2).sum(axis=1) / (size - 4))


def _period(rows: Sequence[FloatArray], rate: float) -> int | None:
    """Rows from one slope jump to the next; None where no line is beyond chance."""
    length = round(PIECE * rate)
    pieces = [one[k : k + length] for one in rows for k in range(0, len(one), length)]
    sizes = np.arange(max(LEAST_ROWS, round(PERIODS[0] * rate)), round(PERIODS[1] * rate) + 1)
    if not len(sizes):  # so few rows a second that no piece would have enough
        return None
    pieces = [one for one in pieces if len(one) >= SHORTEST * sizes[-1]]
    if len(pieces) < LEAST_PIECES:
        return None
    lines, around = np.zeros(len(sizes)), np.zeros(len(sizes))
    for piece in pieces:
        power, resolution = _size_spectrum(piece)
        at = np.round(len(piece) / sizes * PADDING).astype(np.int64)
        level = np.mean([power[at + sign * PADDING * k] for k in BESIDE for sign in (-1, 1)], axis=0) + 1e-30
        lines += power[at] / resolution
        around += level / resolution
    ratio = lines / around
    by_chance = DEVIATIONS * np.sqrt((1.0 + 0.5 / len(BESIDE)) / len(pieces))
    lines_at = sizes[ratio > max(LINE, 1.0 + by_chance)]
    if not len(lines_at):
        return None
    clearest = int(sizes[np.argmax(ratio)])
    return int(lines_at[lines_at % clearest == 0].max())  # a train of spikes has lines at all multiples of its rate


def _size_spectrum(piece: FloatArray) -> tuple[FloatArray, float]:
    """Power of the size of third differences over two rows each, `PADDING` points a resolution; and its mean."""
    third = np.abs(piece[6:] - 3.0 * piece[4:-2] + 3.0 * piece[2:-4] - piece[:-6])
    typical = float(np.median(third))
    size = np.log1p(third / typical) if typical > 0.0 else np.zeros(len(third))
    power = np.abs(np.fft.rfft(size - size.mean(), PADDING * len(piece))) ** 2
    return power, float(power.mean()) + 1e-30


def _seen(runs: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and density of all that is seen in runs at 5 Hz [m2/Hz], those of a window's length counted."""
    powers = [periodograms(run, SEEN, detrend=Detrend.ENDS) for run in runs]
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(SEEN, STEP), dtype=np.float64)
    return frequency, 2.0 * STEP * np.concatenate(powers).mean(axis=0)


def _shape(slope_jumps: SlopeJumps, runs: Sequence[FloatArray], white: float) -> tuple[float, ...]:
    """Factors by which what is seen above half a jump a period differs from ideal jumps and white noise. [-]

    Ideal ones are sampled, as even as can be, so that windows smear both alike.
    """
    frequency, density = _seen(runs)
    even = replace(slope_jumps, level_variance=0.0, track_variance=0.0, with_movement=0.0)
    ideal = even.sample(np.zeros(MANY), STEP, np.random.default_rng(0))
    _, theirs = _seen([ideal])
    rest = density - white * passed(frequency) ** 2
    fastest = float(frequency[passed(frequency) >= LEAST_PASSED][-1])
    points = shape_points(slope_jumps.highest, int((fastest / slope_jumps.highest - 1.0) * SHAPE) + 1)
    factors, band = [1.0], max(slope_jumps.highest / SHAPE, float(frequency[1]))
    for point in points[1:]:
        near = np.abs(frequency - point) <= 0.5 * band
        factors.append(max(float(rest[near].sum()), 0.0) / max(float(theirs[near].sum()), 1e-30))
    return tidy(factors)


def flat_jumps(jumps: FloatArray, densities: FloatArray, every: float) -> FloatArray:
    """Jumps with a flat spectrum, of mean square 1 if theirs is the one given, shape (k,). [-]"""
    known = np.linspace(0.0, 0.5, len(densities))
    at = np.interp(np.fft.rfftfreq(len(jumps)), known, densities)
    least = HOLE * float(densities.mean())
    left = float(np.mean(densities / np.maximum(densities, least)))
    return scale_frequencies(jumps, np.sqrt(2.0 * every / left / np.maximum(at, least)))


def bends_at(rows: FloatArray, jumps: FloatArray, first: int, size: int, rate: float) -> FloatArray:
    """Lateral acceleration of the path at each jump, slower than half a jump a period, shape (k,); NaN near the ends.

    What the jumps themselves have in it is taken out, or else they would go with it for that. [m/s2]
    """
    low, high = (edge / size for edge in TRANSITION)
    half, beta = kaiser_design(ATTENUATION, high - low)
    kernel = low_pass(half, 0.5 * (low + high), beta)
    places = first + size * np.arange(len(jumps))
    bent = np.diff(rows, 2, prepend=rows[0], append=rows[-1]) * rate**2
    bent[places] -= jumps * rate
    found = np.full(len(jumps), np.nan)
    if len(rows) > 2 * half + 2:
        smooth = np.convolve(bent[1:-1], kernel, "valid")
        inside = (places >= half + 1) & (places < half + 1 + len(smooth))
        found[inside] = smooth[places[inside] - half - 1]
    return found


def _with_movement(flat: Sequence[FloatArray], bends: Sequence[FloatArray]) -> tuple[float, float]:
    """Share of the jumps' squares that goes with the acceleration's square [-], and its root mean square. [m/s2]"""
    jumps, bent = np.concatenate(flat), np.concatenate(bends)
    known = np.isfinite(bent)
    if not known.any() or not (bent[known] != 0.0).any():
        return 0.0, 1.0
    square, mean = jumps[known] ** 2, float((bent[known] ** 2).mean())
    parts = np.column_stack([np.ones(len(square)), bent[known] ** 2 / mean])
    weight = np.ones(len(square))
    for _ in range(ROUNDS):
        found = _not_negative(parts, square, weight)
        weight = 1.0 / np.maximum(parts @ found, 1e-30)
    total = float(found.sum())
    return (float(found[1]) / total if total > 0.0 else 0.0), float(np.sqrt(mean))


def _not_negative(parts: FloatArray, values: FloatArray, weight: FloatArray) -> FloatArray:
    """Weighted least squares with coefficients of 0 at least."""
    from scipy.optimize import nnls

    root = np.sqrt(weight)
    return np.asarray(nnls(parts * root[:, None], values * root)[0])


def _log_level(flat: FloatArray, bend: FloatArray, with_movement: float) -> FloatArray:
    """Logarithm of the squares beside what they are where the path bends so, shape (k,). [-]"""
    usual = mean_square(with_movement, np.where(np.isfinite(bend), bend, 1.0) ** 2)
    return np.asarray(np.log((flat**2 + FAINT**2) / usual))


def _level(levels: Sequence[FloatArray]) -> tuple[float, float, float]:
    """Variance of the level about its track's mean [-], how long it lasts, in jumps, and the tracks' variance. [-]"""
    mean = float(np.concatenate(levels).mean())
    sums, counts = np.zeros(LAGS), np.zeros(LAGS)
    for one in levels:
        about = one - mean
        for lag in range(1, min(LAGS, len(about) - 1) + 1):
            sums[lag - 1] += about[lag:] @ about[:-lag]
            counts[lag - 1] += len(about) - lag
    covariance = sums / np.maximum(counts, 1.0)
    best, least = (0.0, float(DURATIONS[0]), 0.0), np.inf
    for duration in DURATIONS:
        parts = np.column_stack([np.exp(-np.arange(1, LAGS + 1) / duration), np.ones(LAGS)])
        variance, track = _not_negative(parts, covariance, counts)
        error = float(counts @ (parts @ [variance, track] - covariance) ** 2)
        if error < least:
            best, least = (float(variance), float(duration), float(track)), error
    return best
