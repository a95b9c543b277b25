"""Bands of movement: what drives show of each, and fast movement put in the place of what a recording hides.

A recording counts within its band. Providers smooth tracks, cameras add noise: above some frequency what is recorded
is not how people drive. There the spectrum comes from a second recording, or from the fine part of another profile,
and grows with the speed as steering noise does.

Steering noise of constant size, through a single-track car [1]_, moves it sideways with a power in proportion to
``g(v) = (v^2 / (1 + (v / vc)^2))^2``: yaw rate per steering angle times speed, integrated twice. Cars driven by hand
with differential GNSS, 14 to 25 m/s: the logarithm of the power at 0.12 to 0.5 Hz rises 0.9 +- 0.3 times that of g;
extrapolated to 28 m/s it is 0.6 to 1.2 times the power of six drivers on motorways. A pure v^4 is rejected.

The shape of a spectrum is the geometric mean over windows with the law fixed: two swerves rule a mean, and a free
exponent. Its level is that of the mean power in `GROWTH_BAND`.

References
----------
.. [1] M. Mitschke, H. Wallentowitz, "Dynamik der Kraftfahrzeuge", Springer 2014: steady-state yaw gain and
   characteristic speed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, all_significant, significant
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.drives.drive import STEP, Run
from xosc_lateral.drivers.drives.filters import Detrend, filtered, low_pass_between, periodograms
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import (
    FitSettings,
    coarse_power,
    fine_power,
    scaled_spectrum,
    shaped,
)
from xosc_lateral.drivers.fitting.models.autoregressive_fit import (
    autocovariance,
    fit_volatility,
    log_power,
    rounded,
)
from xosc_lateral.drivers.fitting.sensor.likelihood import KNOTS, interpolation
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import BORDER, COARSE_EVERY, FREQUENCIES, Volatility
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Piecewise
from xosc_lateral.drivers.model.profile import DriverProfile

CHARACTERISTIC_SPEED = 22.0
"""Of the single-track car, vc; 16 to 30 m/s fit as well. [m/s]"""

SPEED_KNOTS = (11.0, 17.0, 23.0, 31.0, 42.0)
"""Between which the logarithm of g is a straight line (to 0.02); outside it stays as it is there. [m/s]"""

WINDOW = 51.2
"""Of the spectra: half as long ones smear what is slower than 0.1 Hz over that at 0.15 Hz, by half of it. [s]"""

LEAST_WINDOWS = 16
"""The log power of one has a standard deviation of 5.6 dB, the mean of so many 1.4 dB. [-]"""

GROWTH_BAND = (0.12, 0.5)
"""In which growth with the speed is looked for: slower, drivers use their lane as they like. [Hz]"""

ERROR_FACTOR = 2.6
"""Standard errors by which growth has to be there, and may differ from the law: a chance of 1 %. [-]"""

ROLL_OFF = 1.5
"""The coarse part of a recording ends at so many times the frequency that it is valid to: its power there is kept to
2 %, and nothing is counted twice beyond. At 1.2 the classifier's AUC below 0.1 Hz rises from 0.52 to 0.61. [-]"""

ROLL_OFF_ORDER = 10
"""Of the roll-off: power 1 / (1 + (f / corner)^10). [-]"""

RISE_SHARES = (0.8, 1.1)
"""Shares of that corner from which on the fine part makes up for what the coarse lacks, and makes up for all. [-]"""

SPLIT_AT = 0.1
"""Of a recording that shows all of it: movement above grows with the speed, below it does not. [Hz]"""

FINE_SETTINGS = FitSettings(n_knots=101, n_taps=151)
"""Knots every 0.025 Hz: the power falls by 20 dB from 0.1 to 0.2 Hz; kernels of 14 s leak into that. [-]"""

VOLATILE_WINDOW = 5.0
"""By which the volatility of fast movement is seen. [s]"""

STEADY_TIME = 20_000.0
"""Of steady movement, simulated to compare that with. [s]"""

SEED = 20240517

MOTION_COLUMNS = {"speed", "acceleration"}
"""By which effects on the fine part describe fast movement."""

Density = Callable[[FloatArray], FloatArray]
"""One-sided power density of the offset at frequencies [Hz]. [m2/Hz]"""


@dataclass(frozen=True, eq=False)
class FastPart:
    """Fast movement of drivers, where every column of `effects` is at its reference."""

    density: Density
    effects: tuple[ColumnEffect, ...]  # On the fine part.
    volatility: Volatility
    highest: float  # Frequency up to which it is measured. [Hz]
    source: str  # In words.
    speed: tuple[float, float] | None = None  # At which it was measured. [m/s]


def steering_gain(speed: FloatArray) -> FloatArray:
    """g(v): what steering noise of constant size does to the power of the offset, shape of `speed` [m/s]. [m4/s4]"""
    return np.asarray((speed**2 / (1.0 + (speed / CHARACTERISTIC_SPEED) ** 2)) ** 2)


def growth_with_speed(reference: float) -> Piecewise:
    """The effect on the fine part that makes its power grow as g does; 1 at a speed [m/s]."""
    knots = np.array(SPEED_KNOTS)
    strength = 0.5 * np.log(steering_gain(knots))
    slopes = np.concatenate([[0.0], np.diff(strength) / np.diff(knots), [0.0]])
    return Piecewise(
        acts=Acts.FINE,
        column="speed",
        knots=SPEED_KNOTS,
        coefficients=all_significant(np.diff(slopes, prepend=0.0), 6),
        errors=(0.0,) * (len(knots) + 1),
        reference=(reference, *np.maximum(reference - knots, 0.0).tolist()),
    )


# ---- from runs -------------------------------------------------------------------------------------------------------
def fast_part_of_runs(runs: Sequence[Run], highest: float, source: str) -> FastPart:
    """What runs show of it; growth with the speed is in it where speeds are known, unless the runs contradict it.

    Raises `NotEnoughDataError` if they hold fewer than `LEAST_WINDOWS` windows.
    """
    power, speed = _windows(runs)
    known = bool(np.isfinite(speed).all())
    law = growth_with_speed(float(speed.mean())) if known else None
    if law is not None:
        slope, error = _growth(power, speed)
        law = law if abs(slope - 1.0) <= ERROR_FACTOR * error else None
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(round(WINDOW / STEP), STEP), dtype=np.float64)
    steady = power * np.exp(-2.0 * _strengths(speed, law))[:, None]
    typical = np.exp(np.log(steady).mean(axis=0) + np.euler_gamma)
    shape = _smooth_density(frequency, typical, highest)
    volatility = _volatility(runs, law, shape)
    band = (frequency >= GROWTH_BAND[0]) & (frequency < GROWTH_BAND[1])
    level = float(np.exp(np.log(steady.mean(axis=0) / typical)[band].mean()))
    effects = () if law is None else (law,)
    driven = (significant(speed.min(), 5), significant(speed.max(), 5)) if known else None
    return FastPart(lambda at: level * shape(at), effects, volatility, highest, source, driven)


def shows_growth(runs: Sequence[Run]) -> bool:
    """Whether fast movement grows with the speed beyond chance, and as steering noise does."""
    try:
        power, speed = _windows(runs)
    except NotEnoughDataError:
        return False
    if not np.isfinite(speed).all() or np.ptp(speed) == 0.0:
        return False
    slope, error = _growth(power, speed)
    return slope > ERROR_FACTOR * error and abs(slope - 1.0) <= ERROR_FACTOR * error


def _windows(runs: Sequence[Run]) -> tuple[FloatArray, FloatArray]:
    """Power densities of windows, shape (n, m) [m2/Hz], and the mean speed in each, shape (n,), NaN: unknown. [m/s]"""
    size = round(WINDOW / STEP)
    power, speed = [], []
    for run in runs:
        if len(run) >= size:
            densities = periodograms(run.offset, size, detrend=Detrend.ENDS)
            power.append(densities)
            driven = np.full(len(run), np.nan) if run.speed is None else run.speed
            speed.append([driven[k * (size // 2) : k * (size // 2) + size].mean() for k in range(len(densities))])
    count = sum(map(len, power))
    if count < LEAST_WINDOWS:
        what = f"{count} stretches of {WINDOW:g} s without a cut; fast movement takes {LEAST_WINDOWS}"
        raise NotEnoughDataError(what)
    return 2.0 * STEP * np.concatenate(power) + 1e-30, np.concatenate(speed)


def _growth(power: FloatArray, speed: FloatArray) -> tuple[float, float]:
    """By how many times log g the log power in `GROWTH_BAND` grows, and its standard error; windows half overlap."""
    frequency = np.fft.rfftfreq(round(WINDOW / STEP), STEP)
    band = (frequency >= GROWTH_BAND[0]) & (frequency < GROWTH_BAND[1])
    level, gain = np.log(power[:, band]).mean(axis=1), np.log(steering_gain(speed))
    about = gain - gain.mean()
    size = float(about @ about)
    if size < 1e-9:
        return 1.0, np.inf
    slope = float(about @ level) / size
    score = about * (level - level.mean() - slope * about)
    # neighbours share half their rows, and a manoeuvre lasts: products up to four windows apart count (Bartlett)
    variance = float(score @ score) + sum(
        2.0 * (1.0 - lag / LAG_COUNT) * float(score[lag:] @ score[:-lag]) for lag in range(1, LAG_COUNT)
    )
    return slope, float(np.sqrt(max(variance, 0.0))) / size


LAG_COUNT = 5


def _strengths(speed: FloatArray, law: Piecewise | None) -> FloatArray:
    """Of the law at speeds [m/s], shape (n,): logarithm of the factor on the amplitude. [-]"""
    return np.zeros(len(speed)) if law is None else law.weighed(law.response(STEP, {"speed": speed}))


def _smooth_density(frequency: FloatArray, density: FloatArray, highest: float) -> Density:
    """A polygon of log density over log frequency, least squares on what was measured; goes on straight beyond."""
    use = (frequency > 0.0) & (frequency <= highest)
    first = int(np.searchsorted(KNOTS, frequency[use][0], side="right")) - 1
    last = int(np.searchsorted(KNOTS, highest)) + 1
    knots = KNOTS[first:last]
    basis = interpolation(frequency[use])[:, first:last]
    bends = np.diff(np.eye(len(knots)), 2, axis=0) * BEND_WEIGHT
    values = np.linalg.lstsq(
        np.concatenate([basis, bends]),
        np.concatenate([np.log(density[use]), np.zeros(len(bends))]),
        rcond=None,
    )[0]
    slope = (values[-1] - values[-2]) / np.log(knots[-1] / knots[-2])

    def at(hertz: FloatArray) -> FloatArray:
        log = np.log(np.maximum(hertz, knots[0]))
        return np.asarray(
            np.exp(np.interp(log, np.log(knots), values) + slope * np.maximum(log - np.log(knots[-1]), 0.0))
        )

    return at


BEND_WEIGHT = 0.1
"""Of a bend between two knots, so that one without data goes on as its neighbours do. [-]"""


def _volatility(runs: Sequence[Run], law: Piecewise | None, density: Density) -> Volatility:
    """How far the power of fast movement varies beyond that of steady movement of the same spectrum."""
    window, n_lags = round(VOLATILE_WINDOW / STEP), round(60.0 / VOLATILE_WINDOW)
    kernel = low_pass_between(0.5 * SPLIT_AT, 2.0 * SPLIT_AT, STEP, 40.0)
    series = []
    for run in runs:
        fast = run.offset - filtered(run.offset, kernel)
        driven = np.full(len(run), np.nan) if run.speed is None else run.speed
        series.append(log_power(fast * np.exp(-_strengths(driven, law)), window))
    n = round(STEADY_TIME / STEP)
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(n, STEP), dtype=np.float64)
    frequency[0] = frequency[1]
    gain = np.sqrt(density(frequency) / (2.0 * STEP))
    steady = np.fft.irfft(np.fft.rfft(np.random.default_rng(SEED).normal(size=n)) * gain, n)
    expected, _ = autocovariance([log_power(steady - filtered(steady, kernel), window)], n_lags)
    measured, counts = autocovariance([one for one in series if len(one)], n_lags)
    several = len({run.drive for run in runs}) > 1
    return fit_volatility(measured - expected, counts, VOLATILE_WINDOW, population=several)


# ---- from a profile, and into one ------------------------------------------------------------------------------------
def density_of(profile: DriverProfile) -> Density:
    """Mean power density of a profile's offsets about a driver's own mean, every column at its reference.

    Raises `DriverProfileError` if its model is not autoregressive: its movement has no parts by frequency.
    """
    model = _autoregressive(profile)

    def at(hertz: FloatArray) -> FloatArray:
        slower = np.minimum(hertz, 0.5 / model.step)
        knots = slower * model.step
        power = coarse_power(model.coarse, knots) + fine_power(model.fine, knots)
        return np.asarray(2.0 * model.step * profile.lane_width**2 * power)

    return at


def fast_part_of(profile: DriverProfile) -> FastPart:
    """A profile's fast movement, and what the speed does to it; raises as `density_of`."""
    effects = tuple(
        effect
        for effect in profile.effects
        if isinstance(effect, ColumnEffect) and effect.acts is Acts.FINE and effect.columns == ("speed",)
    )
    volatility = _autoregressive(profile).fine_volatility
    known = profile.validity
    highest, speed = known.highest_frequency or np.inf, known.speed
    return FastPart(density_of(profile), effects, volatility, highest, f"profile {profile.name}", speed)


def with_fast_part(profile: DriverProfile, fast: FastPart | None, below: float) -> DriverProfile:
    """A profile whose movement is its own below a frequency [Hz], and above it that of a fast part, or none.

    Level, drivers' spreads and all effects but those on the fine part by speed or acceleration, which describe what is
    replaced, stay. Raises as `density_of`.
    """
    model, corner = _autoregressive(profile), ROLL_OFF * below
    hertz = FREQUENCIES / (COARSE_EVERY * model.step)
    coarse = scaled_spectrum(model.coarse, np.sqrt(_roll_off(hertz, corner)))
    at = np.linspace(0.0, 0.5 / model.step, FINE_SETTINGS.n_knots)
    kept_power = fine_power(model.fine, at * model.step) * _roll_off(at, corner)
    if fast is not None:
        power = fast.density(np.maximum(at, at[1])) / (2.0 * model.step * profile.lane_width**2)
        risen = np.clip((at / corner - RISE_SHARES[0]) / (RISE_SHARES[1] - RISE_SHARES[0]), 0.0, 1.0)
        share = np.sin(0.5 * np.pi * risen) ** 2
        lacking = power - kept_power - coarse_power(coarse, at * model.step)
        kept_power = kept_power + share**2 * np.maximum(lacking, 0.0)
    volatility = model.fine_volatility if fast is None or corner > BORDER else fast.volatility
    fine = shaped(np.sqrt(kept_power / NOISE_VARIANCE), FINE_SETTINGS)
    made = replace(model, coarse=coarse, fine=fine, fine_volatility=volatility)
    kept = [
        effect
        for effect in profile.effects
        if not (isinstance(effect, ColumnEffect) and effect.acts is Acts.FINE and MOTION_COLUMNS & set(effect.columns))
    ]
    return replace(profile, model=rounded(made), effects=(*kept, *(() if fast is None else fast.effects)))


def _roll_off(hertz: FloatArray, corner: float) -> FloatArray:
    """Share of a recording's power that is kept, shape of the frequencies. [-]"""
    return np.asarray(1.0 / (1.0 + (hertz / corner) ** ROLL_OFF_ORDER))


def _autoregressive(profile: DriverProfile) -> AutoregressiveModel:
    if not isinstance(profile.model, AutoregressiveModel):
        what = f"is of the model {profile.model.kind}, expected autoregressive: its movement has no parts by frequency"
        raise DriverProfileError(f"profile {profile.name} {what}")
    return profile.model
