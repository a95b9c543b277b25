"""What was found, in numbers: sizes with their errors, p-values, held-out gains. Words live in `report`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.driver.effects import Effect
from xosc_lateral.identification.core_model import DriverVariance, SpectrumShape
from xosc_lateral.identification.held_out import HeldOut
from xosc_lateral.identification.refinement import Alternatives
from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.selection import Accepted, Gain


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


def describe_finding(one: Accepted, key: str, fitted: Fitted, effects: tuple[Effect, ...], scored: HeldOut) -> Finding:
    """Put sizes and errors to what was accepted."""
    size = one.term.describe(fitted, effects, key)
    return Finding(
        size.name, one.term.kind, one.term.columns, one.alike, size.lag_s, size.response_s, size.shape, size.size,
        size.error, one.p_value, *scored.error_of(size.statistic), size.measure, effects, size.statistic, one.gain,
    )  # fmt: skip


def spectrum_finding(spectrum: SpectrumShape, scored: HeldOut) -> Finding:
    """The core model is replaced: the first-order chain forgets too fast."""
    worst = int(np.argmax(np.abs(np.log(spectrum.ratio))))
    statistic, ratio = "movement by band", float(spectrum.ratio[worst])
    return Finding(
        "memory beyond one step", "memory", (), (), None, None,
        f"movement within {spectrum.bands_s[worst]:g} s is {ratio:.2f} times the measured", ratio, 0.0,
        spectrum.p_value, *scored.error_of(statistic), "size of the movement by frequency band", (), statistic,
    )  # fmt: skip


def population_finding(population: DriverVariance, scored: HeldOut) -> Finding:
    """The core model is replaced: one pooled driver can't be many."""
    statistic, scatter = "quantiles of local spread", float(np.exp(population.log_spread))
    return Finding(
        "drivers that differ", "population", (), (), None, None,
        f"{population.drives} drives; their spreads scatter by a factor of {scatter:.2f}", population.shift,
        population.shift / float(np.sqrt(2.0 * population.drives)), population.p_value, *scored.error_of(statistic),
        statistic, (), statistic,
    )  # fmt: skip
