"""Effects with round numbers, one of each kind, and their strength on rows of context."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from xosc_lateral.drivers.model.effects import (
    Acts,
    Adapted,
    Angular,
    ColumnEffect,
    Cycle,
    Drift,
    Effect,
    Factor,
    Form,
    Levels,
    Linear,
    Magnitude,
    Nearness,
    Piecewise,
    Population,
    Product,
    Proximity,
    Regimes,
    Saturating,
    Step,
    Threshold,
    TimeSmooth,
    VarianceTrend,
)
from xosc_lateral.drivers.model.effects.jam_corridor import JamCorridor

STEP = 0.2

C = TypeVar("C", bound=ColumnEffect)

ONE: dict[str, Any] = {"coefficients": (0.5,), "errors": (0.1,), "reference": (0.0,)}
EXAMPLES: tuple[Effect, ...] = (
    Linear(acts=Acts.LOCATION, column="x", lag_s=-1.2, response_s=2.0, **ONE),
    Magnitude(acts=Acts.SPREAD, column="x", **ONE),
    Threshold(acts=Acts.LOCATION, column="x", at=1.0, above=False, jump=False, **ONE),
    Saturating(acts=Acts.SPREAD, column="x", middle=0.0, scale=2.0, **ONE),
    Piecewise(
        acts=Acts.SPREAD, column="x", knots=(1.0,), coefficients=(1.0, -1.0), errors=(0.1, 0.1), reference=(0.0, 0.0)
    ),
    Levels(acts=Acts.LOCATION, column="x", levels=(1.0,), **ONE),
    Nearness(acts=Acts.FINE, column="x", scale=10.0, **ONE),
    Proximity(acts=Acts.LOCATION, column="x", scale=10.0, lag_s=-0.4, response_s=1.0, response_order=2, **ONE),
    Angular(
        acts=Acts.LOCATION, column="x", period=360.0, coefficients=(0.3, 0.1), errors=(0.1, 0.1), reference=(0.0, 0.0)
    ),
    Product(
        acts=Acts.RATE,
        factors=(Factor(column="x"), Factor(column="y", form=Form.SINE, at=360.0)),
        **ONE,
    ),
    Drift(size=0.2),
    Step(size=0.2, at_s=40.0),
    VarianceTrend(factor=2.0, to_s=100.0),
    Cycle(amplitude=0.1, period_s=12.0),
    Regimes(factor=2.0, on_s=20.0, off_s=40.0),
    Population(shift=0.1, log_spread=0.2),
    TimeSmooth(
        location=(0.1, -0.05), location_errors=(0.02, 0.02), spread=(0.3,), spread_errors=(0.1,), fine=(0.1,), to_s=90.0
    ),
    Adapted(shift=-0.1, spread=1.2, rate=0.8, fine=1.5),
)
"""One of each kind, of columns `x` and `y`: every test of all effects takes them from here."""
OF_OTHER_COLUMNS: tuple[Effect, ...] = (JamCorridor(),)


def made(kind: type[C], *coefficients: float, acts: Acts = Acts.LOCATION, **fields: Any) -> C:
    """With coefficients, errors of a tenth of them, and nothing as the reference."""
    sizes = coefficients or (1.0,)
    known = {"errors": tuple(0.1 * abs(size) for size in sizes), "reference": (0.0,) * len(sizes)}
    return kind(acts=acts, coefficients=sizes, **known | fields)


def strength(effect: ColumnEffect, **context: object) -> np.ndarray:
    """Shape (n,); the columns are there."""
    found = effect.strength(STEP, {name: np.asarray(values, dtype=np.float64) for name, values in context.items()})
    assert found is not None
    return found


def quantity(effect: ColumnEffect, **context: object) -> np.ndarray:
    """Shape (n, k)."""
    return effect.quantity({name: np.asarray(values, dtype=np.float64) for name, values in context.items()})
