"""Effects that a profile can hold: whatever a module here defines is known, without a list."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, reduce
from operator import or_
from typing import Any

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.plugins import defined_in, entry_points
from xosc_lateral.drivers.model.effects.base import Acts, ColumnEffect, Effect, EffectTerms
from xosc_lateral.drivers.model.effects.hidden import (
    Adapted,
    Cycle,
    Drift,
    HiddenEffect,
    Population,
    Regimes,
    Step,
    TimeSmooth,
    VarianceTrend,
)
from xosc_lateral.drivers.model.effects.shapes import (
    Angular,
    Factor,
    Form,
    Levels,
    Linear,
    Magnitude,
    Nearness,
    Piecewise,
    Product,
    Proximity,
    Saturating,
    Threshold,
)

EFFECTS: tuple[type[Effect], ...] = defined_in(__name__, Effect)  # type: ignore[type-abstract]
"""The effects of this package; a profile file names them by their `kind`."""

ENTRY_POINTS = "xosc_lateral.effects"
"""Group of entry points under which other packages offer effects: each names a subclass of `Effect`."""


@cache
def known_effects() -> tuple[type[Effect], ...]:
    """Every effect that a profile may hold: those here, then those of installed plug-ins.

    Raises `DriverProfileError` if a plug-in offers something else than an effect, or one of a kind that is taken.
    """
    kinds = list(EFFECTS)
    for entry in entry_points(group=ENTRY_POINTS):
        effect = entry.load()
        if not (isinstance(effect, type) and issubclass(effect, Effect)):
            raise DriverProfileError(f"plug-in {entry.name}: {entry.value} is not an effect")
        if effect.kind in {known.kind for known in kinds}:
            raise DriverProfileError(f"plug-in {entry.name}: there is an effect of the kind {effect.kind!r} already")
        kinds.append(effect)
    return tuple(kinds)


def any_effect(kinds: Iterable[str] | None = None) -> Any:
    """The union of all effects: what an effect of a profile file is read as.

    Plug-ins are searched when a kind is not among the effects here, or no kinds are given.
    """
    here = {effect.kind for effect in EFFECTS}
    return reduce(or_, EFFECTS if kinds is not None and here.issuperset(kinds) else known_effects())


__all__ = [
    "EFFECTS",
    "Acts",
    "Adapted",
    "Angular",
    "ColumnEffect",
    "Cycle",
    "Drift",
    "Effect",
    "EffectTerms",
    "Factor",
    "Form",
    "HiddenEffect",
    "Levels",
    "Linear",
    "Magnitude",
    "Nearness",
    "Piecewise",
    "Population",
    "Product",
    "Proximity",
    "Regimes",
    "Saturating",
    "Step",
    "Threshold",
    "TimeSmooth",
    "VarianceTrend",
    "any_effect",
    "known_effects",
]
