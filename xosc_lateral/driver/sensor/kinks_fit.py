"""Are recorded tracks made of pieces, and what do their kinks look like?

Whether: the size of third differences of the rows, folded. A period shows as a line in the spectrum of that size,
beside what the frequencies around it have. How large: each jump of the slope by least squares over the pieces on both
sides, a cubic each that meet in value and curvature.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.sensor.kinks import Kinks
from xosc_lateral.drives.periodogram import periodograms

FloatArray = NDArray[np.float64]

PERIODS = (0.4, 2.5)
"""Shorter ones leave no images below the half rate of 5 Hz; of longer ones, runs show too few. [s]"""

LEAST_ROWS = 8
"""Of a piece: its six numbers, and some to average over. [-]"""

PIECE, LEAST_PIECES = 60.0, 16
"""Length of what is looked at by itself [s], and how many there must be for a line to be told from chance. [-]"""

SHORTEST = 20.0
"""Periods that a piece, and a run, must hold. [-]"""

BESIDE = (3, 4, 5, 6)
"""Where a line's surroundings are looked at, in resolutions of the piece to both sides. [-]"""

PADDING = 8
"""Spectra of pieces are interpolated to so many points a resolution. [-]"""

LINE, DEVIATIONS = 2.0, 6.0
"""A line is at least so many times its surroundings, and so many standard errors of chance beyond them. [-]"""

WINDOW = 32
"""Kinks in a window of their spectrum. [-]"""

DURATIONS = np.geomspace(1.0, 64.0, 13)
"""Of a level that are tried, in kinks. [-]"""

LAGS = 24
"""Up to which levels are compared, in kinks. [-]"""

FAINT = 1e-3
"""Share of the typical jump below which differences in the logarithm mean nothing. [-]"""


def find_kinks(
    rows: Sequence[FloatArray], rate: float, frequency: FloatArray, density: FloatArray
) -> tuple[Kinks, float] | None:
    """Kinks at even times, and the standard deviation of the rows about the pieces [m]; None where there are none.

    Parameters
    ----------
    rows : sequence of array
        Offsets as recorded, evenly in time. [m]
    rate : float
        Rows per second. [Hz]
    frequency, density : array, shape (m,)
        Of all that is seen in the runs. [Hz], [m2/Hz]
    """
    size = _period(rows, rate)
    if size is None:
        return None
    every = size / rate
    long = [one for one in rows if len(one) >= SHORTEST * size]
    found = [jumps_of(one, size, rate) for one in long]
    jumps = [one for one, _ in found]
    powers = [periodograms(one, WINDOW) for one in jumps if len(one) >= WINDOW]
    if not powers:
        return None
    densities = 2.0 * every * np.concatenate(powers).mean(axis=0)
    known = np.linspace(0.0, 0.5 / every, len(densities))
    at = np.maximum(known, known[1])  # of the slowest nothing is known: windows are no longer
    seen = np.exp(np.interp(at, frequency[1:], np.log(density[1:])))
    shares = np.minimum(densities / every**2 / (2.0 * np.pi * at) ** 4 / seen, 1.0)
    variance, duration = _level(jumps)
    noise = np.concatenate([_about_pieces(one[first:], size) for one, (_, first) in zip(long, found, strict=True)])
    kinks = Kinks(float(f"{every:.6g}"), _tidy(densities), _tidy(shares), *_tidy([variance, duration * every]))
    return kinks, float(np.sqrt(noise.mean()))


def _tidy(values: Sequence[float] | FloatArray) -> tuple[float, ...]:
    """As a profile keeps them: the same on any machine."""
    return tuple(float(f"{value:.4g}") for value in values)


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
    """Mean square of the rows about a cubic for each piece from kink to kink, the first at row 0. Shape (k,). [m2]"""
    pieces = rows[: len(rows) // size * size].reshape(-1, size)
    cubic = np.vander(np.linspace(-1.0, 1.0, size), 4)
    rest = pieces - pieces @ (cubic @ np.linalg.pinv(cubic))
    return np.asarray((rest**2).sum(axis=1) / (size - 4))


def _period(rows: Sequence[FloatArray], rate: float) -> int | None:
    """Rows from one kink to the next; None where no line is beyond chance."""
    length = round(PIECE * rate)
    pieces = [one[k : k + length] for one in rows for k in range(0, len(one), length)]
    sizes = np.arange(max(LEAST_ROWS, round(PERIODS[0] * rate)), round(PERIODS[1] * rate) + 1)
    pieces = [one for one in pieces if len(one) >= SHORTEST * sizes[-1]]
    if len(pieces) < LEAST_PIECES or not len(sizes):
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


def _level(jumps: Sequence[FloatArray]) -> tuple[float, float]:
    """Variance of the logarithm of the squares' level [-] and how long it lasts, in kinks."""
    typical = float(np.median(np.abs(np.concatenate(jumps)))) + 1e-30
    logs = [np.log(one**2 + (FAINT * typical) ** 2) for one in jumps]
    mean = float(np.concatenate(logs).mean())
    sums, counts = np.zeros(LAGS), np.zeros(LAGS)
    for one in logs:
        about = one - mean
        for lag in range(1, min(LAGS, len(about) - 1) + 1):
            sums[lag - 1] += about[lag:] @ about[:-lag]
            counts[lag - 1] += len(about) - lag
    covariance = sums / np.maximum(counts, 1.0)
    shapes = np.exp(-np.arange(1, LAGS + 1) / DURATIONS[:, None])
    variance = np.maximum((shapes * counts) @ covariance / ((shapes**2) @ counts), 0.0)
    errors = ((variance[:, None] * shapes - covariance) ** 2) @ counts
    best = int(np.argmin(errors))
    return float(variance[best]), float(DURATIONS[best])
