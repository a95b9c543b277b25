"""What was found, in numbers: sizes with their errors, p-values, held-out gains. Words live in `report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Effect
from xosc_lateral.identification.core_model import DriverVariance, SpectrumShape
from xosc_lateral.identification.refinement import Alternatives
from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.selection import Accepted, Gain

FloatArray = NDArray[np.float64]
Compared = tuple[Mapping[str, FloatArray], Mapping[str, FloatArray], Mapping[str, FloatArray]]
"""Summary statistics of measured offsets, before, after."""


@dataclass(frozen=True, eq=False)
class Finding:
    """One effect that the base lacked.

    Parameters
    ----------
    effect : str
        Short name.
    kind : str
        As in the report's schema.
    columns : tuple of str
        That cause it; two when it is a product.
    alike : tuple of tuple of str
        Columns of each other effect that the data can't tell from it.
    lag_s, response_s : float or None
    shape : str
    size_m : float
        Change of the mean between the 5 % and 95 % quantile, or amplitude [m]; factor for scale.
    size_error : float
        Standard error of it.
    p_value : float
        Family-wise over everything that its component tried.
    error_before, error_after : float
        On held-out blocks, by the effect's own quantity. [m]
    measure : str
        What that error compares.
    effects : tuple of Effect
        What the profile got.
    statistic : str
        Group of summary statistics that shows it best.
    gain : Gain or None
        Held-out gain, nested; None where its path can't be predicted.
    """

    effect: str
    kind: str
    columns: tuple[str, ...]
    alike: Alternatives
    lag_s: float | None
    response_s: float | None
    shape: str
    size_m: float
    size_error: float
    p_value: float
    error_before: float
    error_after: float
    measure: str
    effects: tuple[Effect, ...]
    statistic: str
    gain: Gain | None = None


def describe_finding(
    one: Accepted, key: str, fitted: Fitted, effects: tuple[Effect, ...], compared: Compared
) -> Finding:
    """Put sizes and errors to what was accepted."""
    told = one.term.describe(fitted, effects, key)
    before, after = _errors(compared, told.statistic)
    return Finding(
        told.name, one.term.kind, one.term.columns, one.alike, told.lag_s, told.response_s, told.shape, told.size,
        told.error, one.p_value, before, after, told.measure, effects, told.statistic, one.gain,
    )  # fmt: skip


def spectrum_finding(spectrum: SpectrumShape, compared: Compared) -> Finding:
    """The core model is replaced: the first-order chain forgets too fast."""
    worst = int(np.argmax(np.abs(np.log(spectrum.ratio))))
    statistic = "movement by band"
    before, after = _errors(compared, statistic)
    shape = f"movement within {spectrum.bands_s[worst]:g} s is {spectrum.ratio[worst]:.2f} times the measured"
    return Finding(
        "memory beyond one step", "memory", (), (), None, None, shape, float(spectrum.ratio[worst]), 0.0,
        spectrum.p_value, before, after, "size of the movement by frequency band", (), statistic,
    )  # fmt: skip


def population_finding(population: DriverVariance, compared: Compared) -> Finding:
    """The core model is replaced: one pooled driver can't be many."""
    statistic = "quantiles of local spread"
    before, after = _errors(compared, statistic)
    shape = f"{population.drives} drives; their spreads scatter by a factor of {np.exp(population.log_spread):.2f}"
    error = population.shift / np.sqrt(2.0 * population.drives)
    return Finding(
        "drivers that differ", "population", (), (), None, None, shape, population.shift, error,
        population.p_value, before, after, statistic, (), statistic,
    )  # fmt: skip


def _errors(compared: Compared, statistic: str) -> tuple[float, float]:
    real, before, after = compared
    if statistic not in real:
        return 0.0, 0.0
    first, second = (float(np.sqrt(np.nanmean((real[statistic] - other[statistic]) ** 2))) for other in (before, after))
    return first, second
