"""Findings: what was traced, in the words and units of the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect, Drift, Effect, GrowingSpread, Regimes, Step, Weave
from xosc_lateral.loop.memory import Memory
from xosc_lateral.loop.movement import Coarse
from xosc_lateral.loop.population import Population
from xosc_lateral.loop.residual import SWING
from xosc_lateral.loop.sizing import Sized, span
from xosc_lateral.loop.traced import Found, Trace

FloatArray = NDArray[np.float64]
Compared = tuple[Mapping[str, FloatArray], Mapping[str, FloatArray], Mapping[str, FloatArray]]
"""Cells of measured offsets, of the runs before and after."""

NO_WORSE = 1.1
"""What the core model had already taken up may go into an effect without the error falling; it must not rise. [-]"""

KINDS = {
    "location": "location",
    "between": "location",
    "scale": "scale",
    "fine": "scale",
    "slow": "scale",
    "dynamics": "dynamics",
    "growth": "scale",
    "regime": "regime",
    "periodic": "periodic",
}


@dataclass(frozen=True, eq=False)
class Finding:
    """One effect that the base lacked.

    Parameters
    ----------
    effect : str
        Short name, in words.
    kind : str
        As in the report's schema.
    columns : tuple of str
        That cause it; several when it is a product, or when the data can't tell them apart (`alike`).
    alike : tuple of str
        Those of the columns that are named only because they can't be told from the others.
    lag_s, response_s : float or None
    shape : str
    size_m : float
        Change of the mean between the 5 % and 95 % quantile, or amplitude [m]; factor for scale.
    size_error : float
        Standard error of it.
    p_value : float
    error_before, error_after : float
        On held-out blocks, by the effect's own quantity. [m]
    measure : str
        What that error compares.
    effects : tuple of Effect
        What the profile got.
    cell : str
        Group of the residual's cells that shows it best.
    """

    effect: str
    kind: str
    columns: tuple[str, ...]
    alike: tuple[str, ...]
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
    cell: str


def describe_finding(
    found: Found, index: int, coarse: Coarse, trace: Trace, sized: Sized, compared: Compared
) -> Finding:
    """Put sizes and words to what was traced; `index` is its place among `trace.found`."""
    if found.candidate is not None:
        same = sum(1 for other in trace.found[:index] if other.look == found.look)
        known = {
            "location": len(trace.start.terms.location),
            "between": len(trace.start.terms.between),
            "scale": len(trace.start.terms.spread),
        }.get(found.look, 0)
        key = f"{found.look} {same + known}"
        return _of_columns(found, key, coarse, sized.groups[key], compared)
    return _of_nothing(found, sized, compared)


def helps(finding: Finding) -> bool:
    """Whether the effect brings its own error down, or all but down, on blocks that it was not fitted on."""
    return finding.error_after < NO_WORSE * finding.error_before


def memory_finding(memory: Memory, compared: Compared) -> Finding:
    """The core model is replaced: the first-order chain forgets too fast."""
    worst = int(np.argmax(np.abs(np.log(memory.ratio))))
    before, after = _errors(compared, "movement by band")
    return Finding(
        effect="memory beyond one step",
        kind="memory",
        columns=(),
        alike=(),
        lag_s=None,
        response_s=None,
        shape=f"movement within {memory.bands_s[worst]:g} s is {memory.ratio[worst]:.2f} times the measured",
        size_m=float(memory.ratio[worst]),
        size_error=0.0,
        p_value=memory.p_value,
        error_before=before,
        error_after=after,
        measure="size of the movement by frequency band",
        effects=(),
        cell="movement by band",
    )


def population_finding(population: Population, compared: Compared) -> Finding:
    """The core model is replaced: one pooled driver can't be many."""
    before, after = _errors(compared, "quantiles of local spread")
    return Finding(
        effect="drivers that differ",
        kind="population",
        columns=(),
        alike=(),
        lag_s=None,
        response_s=None,
        shape=f"{population.drives} drives; their spreads scatter by a factor of {np.exp(population.log_spread):.2f}",
        size_m=population.shift,
        size_error=population.shift / np.sqrt(2.0 * population.drives),
        p_value=population.p_value,
        error_before=before,
        error_after=after,
        measure="quantiles of local spread",
        effects=(),
        cell="quantiles of local spread",
    )


def _of_columns(found: Found, key: str, coarse: Coarse, group: tuple[Effect, ...], compared: Compared) -> Finding:
    effect = group[0]
    assert isinstance(effect, ColumnEffect)
    strength = span(coarse, effect)
    on_mean = found.look in ("location", "between")
    usual = found.look == "between"
    relative = _relative_error(effect)
    size = strength if on_mean else float(np.exp(strength))
    error = abs(strength) * relative * (1.0 if on_mean else size)
    cell = f"{'mean' if on_mean else 'spread'} by effect: {key}"
    before, after = _errors(compared, cell)
    what = {
        "location": "mean offset",
        "between": "place that a drive keeps",
        "scale": "spread",
        "dynamics": "restoring strength",
        "fine": "fine noise",
        "slow": "spread",
    }[found.look]
    return Finding(
        effect=f"{what} by {_words(effect)}",
        kind=KINDS[found.look],
        columns=(*effect.columns, *found.rivals),
        alike=found.rivals,
        lag_s=None if usual else effect.lag_s,
        response_s=None if usual else effect.response_s,
        shape=f"{effect.shape}, between drives" if usual else effect.shape,
        size_m=size,
        size_error=error,
        p_value=found.p_value,
        error_before=before,
        error_after=after,
        measure=f"{'mean offset' if on_mean else 'spread'} by fifths of the effect's own quantity",
        effects=group,
        cell=cell,
    )


def _of_nothing(found: Found, sized: Sized, compared: Compared) -> Finding:
    key = {"periodic": "weave"}.get(found.look, found.look)
    if found.look == "wander":
        key = "step" if "step" in sized.groups else "drift"
    group = sized.groups[key]
    effect = group[0]
    name, kind, shape, size, error, cell = _hidden_words(effect)
    before, after = _errors(compared, cell)
    return Finding(
        effect=name,
        kind=kind,
        columns=(),
        alike=(),
        lag_s=None,
        response_s=None,
        shape=shape,
        size_m=size,
        size_error=error,
        p_value=found.p_value,
        error_before=before,
        error_after=after,
        measure=cell,
        effects=group,
        cell=cell,
    )


def _hidden_words(effect: Effect) -> tuple[str, str, str, float, float, str]:
    if isinstance(effect, Weave):
        shape = f"period {effect.period_s:.1f} s"
        return "weave", "periodic", shape, effect.amplitude, effect.amplitude_error, SWING
    if isinstance(effect, Step):
        return "step", "step", f"at {effect.at_s:.0f} s", effect.size, effect.size_error, "mean by effect: step"
    if isinstance(effect, Drift):
        shape = f"correlated over {effect.correlation_s:.0f} s"
        return "slow drift", "drift", shape, effect.size, effect.size_error, "movement by band"
    if isinstance(effect, GrowingSpread):
        word = "growing" if effect.factor > 1 else "shrinking"
        return f"{word} spread", "scale", "log-linear in time", effect.factor, effect.factor_error, "spread by time"
    assert isinstance(effect, Regimes)
    shape = f"on for {effect.on_s:.0f} s, off for {effect.off_s:.0f} s on average"
    return "on/off regimes", "regime", shape, effect.factor, effect.factor_error, "quantiles of local spread"


def _errors(compared: Compared, cell: str) -> tuple[float, float]:
    real, before, after = compared
    if cell not in real:
        return 0.0, 0.0
    return tuple(  # type: ignore[return-value]
        float(np.sqrt(np.nanmean((real[cell] - other[cell]) ** 2))) for other in (before, after)
    )


def _relative_error(effect: ColumnEffect) -> float:
    sizes, errors = np.asarray(effect.coefficients), np.asarray(effect.errors)
    return float(np.sqrt(np.sum(errors**2)) / max(float(np.sqrt(np.sum(sizes**2))), 1e-12))


def _words(effect: ColumnEffect) -> str:
    return " and ".join(effect.columns)
