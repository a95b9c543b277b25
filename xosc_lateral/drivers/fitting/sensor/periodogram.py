"""Power density of runs as a Whittle likelihood wants it: mean periodograms in bins, what they weigh, and the climb to
the likelihood's maximum by Fisher scoring.

References
----------
.. [1] P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
.. [2] P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio and
       Electroacoustics 15, 1967: means over windows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.filters import Detrend, periodograms

WINDOWS = (102.4, 51.2, 25.6, 12.8)
"""Lengths of window, the first of which there are at least `MINIMUM_PIECES`; a longer one sees slower movement. [s]"""

MINIMUM_PIECES = 16

INDEPENDENT_SHARE = 0.53
"""Independent windows per Hann window at half overlap (Welch 1967, eq. for the variance at 50 % overlap). [-]"""

LEAST_DENSITY = 1e-12
"""Added everywhere, so that values that stand still have a density. [m2/Hz]"""

PASSED_FREQUENCY = 1.5
"""Resampling to 5 Hz keeps what is slower than this. [Hz]"""

BINS_FROM, BIN_SHARE = 0.12, 0.05
"""Above the first frequency [Hz], neighbouring ones within this share are averaged. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Periodogram:
    """Mean power density and its weight, shape (n,) each."""

    frequency: FloatArray  # Mean of each bin. [Hz]
    density: FloatArray  # One-sided: integrates to the variance. [m2/Hz]
    weight: FloatArray  # Independent ordinates in each bin. [-]

    @property
    def count(self) -> float:
        """Independent ordinates in all. [-]"""
        return float(self.weight.sum())


def windows_of(runs: Sequence[FloatArray], step: float) -> tuple[FloatArray, FloatArray]:
    """Frequencies, shape (m,), and densities of all windows, shape (k, m), of evenly sampled runs.

    Raises `NotEnoughDataError` if no run holds the shortest window.
    """
    size = 0
    for seconds in WINDOWS:
        size = round(seconds / step)
        if sum((len(run) - size) // (size // 2) + 1 for run in runs if len(run) >= size) >= MINIMUM_PIECES:
            break
    longest = max(map(len, runs), default=0)
    if longest < size:
        raise NotEnoughDataError(f"no run of {size * step:g} s; the longest lasts {longest * step:g} s")
    powers = np.concatenate([periodograms(run, size, detrend=Detrend.MEAN) for run in runs])
    density = 2.0 * step * powers + LEAST_DENSITY
    return np.asarray(np.fft.rfftfreq(size, step), dtype=np.float64), density


def periodogram(frequency: FloatArray, windows: FloatArray, highest: float = PASSED_FREQUENCY) -> Periodogram:
    """Mean over windows, binned, from the second frequency (Hann smears the mean into the first) to a highest [Hz].

    `frequency` [Hz] of shape (n,), `windows` [m2/Hz] of shape (k, n).
    """
    use = (frequency > 1.5 * frequency[1]) & (frequency <= highest)
    known, density = frequency[use], windows[:, use].mean(axis=0)
    edges = [int(k) for k in np.flatnonzero(known < BINS_FROM)]
    at = len(edges)
    while at < len(known):
        edges.append(at)
        at = max(at + 1, int(np.searchsorted(known, known[at] * (1.0 + BIN_SHARE))))
    count = np.diff([*edges, len(known)])
    return Periodogram(
        np.add.reduceat(known, edges) / count,
        np.add.reduceat(density, edges) / count,
        (INDEPENDENT_SHARE * len(windows) + 0.5) * count,
    )


ROUNDS, LEAST_GAIN, LONGEST_STEP = 60, 1e-3, 1.5
"""Of a climb: at most so many; it ends where one gains less loss than this; each log density moves by no more. [-]"""


def climb(
    at: Callable[[FloatArray], tuple[float, FloatArray, FloatArray]], point: FloatArray
) -> tuple[FloatArray, float]:
    """The least loss and where it is, by Fisher scoring from a point; `at` gives loss, gradient and information."""
    loss, gradient, information = at(point)
    for _ in range(ROUNDS):
        step = np.linalg.solve(information + 1e-6 * np.eye(len(point)), -gradient)
        step = np.clip(step, -LONGEST_STEP, LONGEST_STEP)
        length = 1.0
        tried = at(point + step)
        while tried[0] >= loss and length > 1e-3:
            length *= 0.4
            tried = at(point + length * step)
        if tried[0] >= loss:
            break
        gained = loss - tried[0]
        point = point + length * step
        loss, gradient, information = tried
        if gained < LEAST_GAIN:
            break
    return point, loss


# ---- the step that values come in, and the spectrum of what rounding adds ----

LEAST_STEP = 0.004
"""Finer steps add less than 2e-6 m2, below any sensor's own noise. [m]"""

COARSE_STEP_RATIO = 2.0
"""Steps of so many standard deviations of the rows show the driver's variance within 10 %, wider ones do not: where
values come in such, driver and rounding are not separated (docs/design/sensor.md). [-]"""


def quantisation_step(values: FloatArray) -> float:
    """Step of the lattice that all values, shape (n,), lie on, 0 if there is none of at least `LEAST_STEP`. [m]"""
    levels = np.unique(np.round(values, 7))
    if len(levels) < 2 or len(levels) > 0.2 * len(values):
        return 0.0
    step = float(np.diff(levels).min())
    if step < LEAST_STEP:
        return 0.0
    count = np.diff(levels) / step
    return step if bool(np.all(np.abs(count - np.round(count)) < 1e-3)) else 0.0


def uniform_variance(step: float) -> float:
    """Of the error of rounding to a lattice of this step [m], where many steps are crossed. [m2]"""
    return step**2 / 12.0


LONGEST_LAG = 60.0
"""Beyond it the error of rounding has forgotten: drivers have moved by many steps, or stood still throughout. [s]"""

DENSE_RATE = 20.0
"""What drivers do hardly shows between lags of this rate: of faster rows it is interpolated. [Hz]"""

SERIES_TERMS = 59
"""Terms of the closed form, whose squares fall: what is left is 0.3 % of the variance. [-]"""


def rounding_density(
    step: float,
    driver: Callable[[FloatArray], FloatArray],
    variance: float,
    *,
    rate: float,
    noise: float = 0.0,
) -> Callable[[FloatArray], FloatArray]:
    """Power density of the error of rounding a Gaussian signal to steps of q, as its rows have it. [m2/Hz]

    The error's autocovariance follows from the signal's structure function D(tau) = E[(x(t + tau) - x(t))^2] [1]_:
    ``q^2 / (2 pi^2) sum_k exp(-2 pi^2 k^2 D(tau) / q^2) / k^2``. Noise that is new in every row adds twice its variance
    to D between different rows: beside enough of it the error is new in every row, too.

    `step`: q [m]; `driver`, `variance`: density of what is rounded, at frequencies [m2/Hz], and what it is scaled to,
    the variance less the noise [m2]; `rate`: rows per second [Hz]; `noise`: variance of white noise before that [m2].

    References
    ----------
    .. [1] A. B. Sripad, D. L. Snyder, "A necessary and sufficient condition for quantization errors to be uniform and
       white", IEEE Trans. ASSP 25, 1977.
    """
    frequency = np.linspace(0.0025, 1.5, 600)
    spacing = float(frequency[1] - frequency[0])
    power = driver(frequency) * spacing
    power *= variance / power.sum()
    lag = np.arange(1, max(round(LONGEST_LAG * rate), 1) + 1) / rate
    known = np.arange(round(LONGEST_LAG * min(rate, DENSE_RATE)) + 2) / min(rate, DENSE_RATE)
    moved = np.sqrt(2.0 * (1.0 - np.cos(2.0 * np.pi * np.outer(known, frequency))) @ power)
    structure = np.interp(lag, known, moved) ** 2 + 2.0 * noise
    order = np.arange(1, SERIES_TERMS + 1)[:, None]
    terms = np.exp(-2.0 * (np.pi * order) ** 2 * structure / step**2) / order**2
    covariance = step**2 / (2.0 * np.pi**2) * terms.sum(axis=0)
    at = np.concatenate([[0.005], np.geomspace(0.01, 3.0, 90)])
    density = 2.0 / rate * (uniform_variance(step) + 2.0 * np.cos(2.0 * np.pi * np.outer(at, lag)) @ covariance)
    log = np.log(np.maximum(density, 1e-9 * density.max()))
    return lambda where: np.exp(np.interp(where, at, log))


# ---- the lane width as a second view of a camera's errors ----
# An offset is half the difference of the distances to two lane markings, half the lane width is half their sum. Where
# the errors of the two markings are independent, those of offset and half width have one and the same power density:
# with e_l and e_r, that of (e_r - e_l) / 2 and that of (e_r + e_l) / 2. The width holds no driving beside them. So
# its density says what the offset's error looks like, down to frequencies where nothing else separates it from a
# driver.
# Errors of both markings alike are not in the width, a camera that pitches scales the width and hardly the offset, and
# where one marking was misjudged the offset has been corrected (`drives.markings`), as far as that is seen: the level
# is a number of its own, about 1 (`LEVEL_SD`). Slower than `LOWEST_FREQUENCY`, lanes themselves widen, and the
# density is taken to go on as it is there; that it is the camera's all the way down is the other end of the interval.

LEVEL_SD = 0.5
"""Of the logarithm of the offset's error's power over the half width's, about 0 (docs/design/markings.md shows how
little hangs on it). [-]"""

LOWEST_FREQUENCY = 0.05
"""[Hz]"""

KNOTS = np.array([0.01, 0.02, 0.035, LOWEST_FREQUENCY, 0.07, 0.1, 0.14, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.0, 1.2, 1.5])
"""Of the logarithm of the half width's density, over the logarithm of frequency. [Hz]"""

BEND_SD = 1.0
"""Of a change of the slope from one knot to the next, as for a driver. [-]"""

INTEGRAL_POINTS = 1000
"""Frequencies of the variance's integral. [-]"""


@dataclass(frozen=True, slots=True)
class SecondView:
    """Power density of half the lane width: logarithms (of m2/Hz) at frequencies [Hz], straight over log frequency.

    Constant outside, and below `slowest` [Hz].
    """

    frequencies: tuple[float, ...]
    knots: tuple[float, ...]
    slowest: float = LOWEST_FREQUENCY

    def density(self, frequency: FloatArray) -> FloatArray:
        """One-sided. [m2/Hz] Shape as `frequency` [Hz]."""
        log = np.log(np.maximum(frequency, max(self.slowest, 1e-9)))
        return np.asarray(np.exp(np.interp(log, np.log(self.frequencies), self.knots)))

    def scaled(self, factor: float) -> SecondView:
        """The same times a factor."""
        return replace(self, knots=tuple(knot + float(np.log(factor)) for knot in self.knots))

    def variance(self, highest: float) -> float:
        """Of what is slower than `highest` [Hz]. [m2]"""
        from scipy.integrate import trapezoid

        frequency = np.linspace(0.0, highest, INTEGRAL_POINTS)
        return float(trapezoid(self.density(frequency), frequency))


def second_view(half_widths: Sequence[FloatArray], step: float) -> SecondView | None:
    """Fitted to the mean periodogram of runs, by Whittle's likelihood [1]_; None of a width that stands still.

    From half the lane width of each run [m], shape (n_i,), at an even step [s].
    """
    if np.ptp(np.concatenate(half_widths)) == 0.0:
        return None
    data = periodogram(*windows_of(half_widths, step))
    frequencies = KNOTS[data.frequency[0] <= KNOTS]
    return SecondView(tuple(frequencies.tolist()), tuple(_fitted(data, frequencies).tolist()))


def _fitted(data: Periodogram, knots: FloatArray) -> FloatArray:
    """Log densities at the knots [Hz]."""
    log, frequency, density, weight = np.log(knots), np.log(data.frequency), data.density, data.weight
    matrix = np.column_stack([np.interp(frequency, log, unit) for unit in np.eye(len(knots))])
    slopes = np.diff(np.eye(len(knots)), axis=0) / np.diff(log)[:, None]
    bends = np.diff(slopes, axis=0) / BEND_SD

    def at(point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Loss, gradient, information."""
        ratio, bend = density / np.exp(matrix @ point), bends @ point
        loss = float((weight * (matrix @ point + ratio)).sum()) + 0.5 * float(bend @ bend)
        gradient = matrix.T @ (weight * (1.0 - ratio)) + bends.T @ bend
        return loss, gradient, (matrix.T * weight) @ matrix + bends.T @ bends

    return climb(at, np.interp(log, frequency, np.log(density)))[0]
