"""Everything that could drive the offset: each column in every shape, and pairs of columns.

A candidate costs something before it has said anything: a shape with a free limit, or one of the many pairs, has
more chances to fit noise than a plain column. The cost, in chi-square, is paid in the choice and in the null alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import (
    Acts,
    Angular,
    ColumnEffect,
    Factor,
    Form,
    Levels,
    Linear,
    Magnitude,
    Nearness,
    Product,
    Saturating,
    Threshold,
)
from xosc_lateral.loop.columns import Column, Role

FloatArray = NDArray[np.float64]

RESPONSES = (1.0, 2.0, 4.0)
"""Response times looked at first; refined later. [s]"""

COST_SHAPE = 4.0
COST_ANGLE = 1.0
COST_MAGNITUDE = 2.0
COST_PRODUCT = 9.0
"""Head start of a plain column over a bent one, an angle's component, its size, a product. [chi-square]"""

QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)
"""Where limits are tried first. [-]"""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A quantity with its response, not yet sized.

    Parameters
    ----------
    effect : ColumnEffect
        Without coefficients.
    cost : float
        Head start that others have. [chi-square]
    """

    effect: ColumnEffect
    cost: float

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""
        return self.effect.columns


def single_candidates(columns: Iterable[Column], context: Mapping[str, FloatArray]) -> list[Candidate]:
    """Every column in every shape, at no lag and no response."""
    return [candidate for column in columns for candidate in _shapes(column, context[column.name])]


def product_candidates(columns: Sequence[Column], context: Mapping[str, FloatArray]) -> list[Candidate]:
    """Pairs of columns; a pair that never varies (always 0, say) is left out."""
    factors = [factor for column in columns for factor in _factors(column, context[column.name])]
    pairs = (
        Product(acts=Acts.LOCATION, factors=pair)
        for pair in combinations(factors, 2)
        if pair[0].column != pair[1].column
    )
    return [Candidate(pair, _cost(pair.factors)) for pair in pairs if _varies(pair.quantity(context))]


def _cost(factors: tuple[Factor, ...]) -> float:
    """Of a product; size and direction of the same thing (wind_speed, wind_direction) are one vector, not any pair."""
    directions = [factor for factor in factors if factor.form in (Form.SINE, Form.COSINE)]
    things = {factor.column.split("_")[0] for factor in factors}
    return COST_ANGLE if len(directions) == 1 and len(things) == 1 else COST_PRODUCT


def with_responses(candidates: Iterable[Candidate], responses: Sequence[float] = RESPONSES) -> list[Candidate]:
    """Each candidate at each response time."""
    return [
        Candidate(replace(candidate.effect, response_s=response), candidate.cost)
        for candidate in candidates
        for response in responses
    ]


def _shapes(column: Column, values: FloatArray) -> list[Candidate]:
    name, acts = column.name, Acts.LOCATION
    found: list[Candidate] = []
    if column.gaps:
        found.append(Candidate(Nearness(acts=acts, column=name, presence=True), 0.0))
    if column.role is Role.ANGLE:
        found.append(Candidate(Angular(acts=acts, column=name, period=column.period), COST_ANGLE))
    elif column.role is Role.SWITCH:
        found.append(Candidate(Linear(acts=acts, column=name), 0.0))
    elif column.role is Role.LEVELS:
        found.append(Candidate(Linear(acts=acts, column=name), 0.0))
        found += [Candidate(Levels(acts=acts, column=name, levels=(level,)), COST_ANGLE) for level in column.levels]
        found.append(Candidate(Levels(acts=acts, column=name, levels=column.levels[1:]), COST_ANGLE))
    else:
        found += _number_shapes(column, values)
    return found


def _number_shapes(column: Column, values: FloatArray) -> list[Candidate]:
    name, acts = column.name, Acts.LOCATION
    finite = values[np.isfinite(values)]
    middle, scale = float(np.median(finite)), float(finite.std())
    found = [Candidate(Linear(acts=acts, column=name), 0.0)]
    found.append(Candidate(Saturating(acts=acts, column=name, middle=middle, scale=scale), COST_SHAPE))
    if finite.min() < 0.0 < finite.max():
        if min(-np.quantile(finite, 0.05), np.quantile(finite, 0.95)) > 0.0:
            found.append(Candidate(Magnitude(acts=acts, column=name), COST_MAGNITUDE))
        found.append(Candidate(Saturating(acts=acts, column=name, middle=0.0, scale=0.5 * scale), COST_SHAPE))
    for limit in limits_of(finite):
        # above: for a distance with gaps "none" counts as not acting, so only the near side makes sense
        sides = (False,) if column.distance else (True,)
        found += [
            Candidate(Threshold(acts=acts, column=name, at=limit, above=side, jump=True), COST_SHAPE) for side in sides
        ]
        both = (False,) if column.distance else (True, False)
        found += [
            Candidate(Threshold(acts=acts, column=name, at=limit, above=side, jump=False), COST_SHAPE) for side in both
        ]
    if column.distance:
        near = max(float(np.quantile(finite, 0.02)), 1e-6)
        found.append(Candidate(Nearness(acts=acts, column=name, scale=near), 0.0))
    return found


def limits_of(finite: FloatArray) -> list[float]:
    """Quantiles to try as limits; where the column sticks to a value, the middle to its next one."""
    limits = []
    for limit in np.unique(np.quantile(finite, QUANTILES)):
        share = float(np.mean(finite > limit))
        if share < 0.03 and np.any(finite < limit):
            limit = 0.5 * (limit + float(finite[finite < limit].max()))
        if 0.03 <= np.mean(finite > limit) <= 0.97:
            limits.append(float(limit))
    return limits


def _factors(column: Column, values: FloatArray) -> list[Factor]:
    name = column.name
    if column.role is Role.ANGLE:
        return [Factor(column=name, form=form, at=column.period) for form in (Form.SINE, Form.COSINE)]
    if column.role is Role.LEVELS:
        plain = [Factor(column=name)]
        return plain + [Factor(column=name, form=Form.EQUALS, at=level) for level in column.levels]
    if column.distance:
        near = max(float(np.nanquantile(values, 0.02)), 1e-6)
        return [Factor(column=name, form=Form.PRESENCE), Factor(column=name, form=Form.NEARNESS, at=near)]
    if column.gaps:
        return [Factor(column=name, form=Form.PRESENCE)]
    return [Factor(column=name)]


def _varies(quantity: FloatArray) -> bool:
    finite = quantity[np.isfinite(quantity)]
    if len(finite) == 0:
        return False
    common = np.median(finite)
    return bool(np.mean(np.abs(finite - common) > 1e-9 * (1.0 + abs(common))) > 0.01)
