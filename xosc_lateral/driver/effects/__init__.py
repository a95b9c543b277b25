"""Effects that a profile can hold, one per file, and the tuple of all that are known."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from xosc_lateral.driver.effects.acts import Acts
from xosc_lateral.driver.effects.angular import Angular
from xosc_lateral.driver.effects.base import Effect, EffectTerms
from xosc_lateral.driver.effects.column import ColumnEffect
from xosc_lateral.driver.effects.drift import Drift
from xosc_lateral.driver.effects.growing_spread import GrowingSpread
from xosc_lateral.driver.effects.levels import Levels
from xosc_lateral.driver.effects.linear import Linear
from xosc_lateral.driver.effects.magnitude import Magnitude
from xosc_lateral.driver.effects.nearness import Nearness
from xosc_lateral.driver.effects.piecewise import Piecewise
from xosc_lateral.driver.effects.population import Population
from xosc_lateral.driver.effects.product import Factor, Form, Product
from xosc_lateral.driver.effects.regimes import Regimes
from xosc_lateral.driver.effects.saturating import Saturating
from xosc_lateral.driver.effects.step import Step
from xosc_lateral.driver.effects.threshold import Threshold
from xosc_lateral.driver.effects.weave import Weave
from xosc_lateral.errors import DriverProfileError

EFFECTS = (
    Linear,
    Magnitude,
    Threshold,
    Saturating,
    Piecewise,
    Levels,
    Nearness,
    Angular,
    Product,
    Drift,
    Step,
    GrowingSpread,
    Weave,
    Regimes,
    Population,
)
"""Every effect that a profile file may name, by its `kind`."""


def effect_from_dict(data: Mapping[str, Any]) -> Effect:
    """Read one effect of a profile file.

    Raises
    ------
    DriverProfileError
        If its kind is unknown, a field is missing, unknown or out of range.
    """
    kind = data.get("kind")
    for effect in EFFECTS:
        if effect.kind == kind:
            return effect.from_dict(data)
    raise DriverProfileError(
        f"effect kind {kind!r} is unknown; known are {', '.join(effect.kind for effect in EFFECTS)}"
    )


def missing_columns(effects: Iterable[Effect], context: Mapping[str, object]) -> tuple[str, ...]:
    """Columns that the effects read and the context lacks: those effects stay neutral."""
    return tuple(sorted({column for effect in effects for column in effect.columns if column not in context}))


__all__ = [
    "EFFECTS",
    "Acts",
    "Angular",
    "ColumnEffect",
    "Drift",
    "Effect",
    "EffectTerms",
    "Factor",
    "Form",
    "GrowingSpread",
    "Levels",
    "Linear",
    "Magnitude",
    "Nearness",
    "Piecewise",
    "Population",
    "Product",
    "Regimes",
    "Saturating",
    "Step",
    "Threshold",
    "Weave",
    "effect_from_dict",
    "missing_columns",
]
