"""The dictionary: every column in every shape, and products of two columns, before lag and response.

Families have equal prior weight and their members share it evenly: a member of a family of m costs 2 log m, in the
unit of a squared score (the extended information criterion [1]_). Nothing else tells candidates apart beforehand.

References
----------
.. [1] J. Chen, Z. Chen, "Extended Bayesian information criteria for model selection with large model spaces",
   Biometrika 95, 2008.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model import effects
from xosc_lateral.drivers.model.effects import EFFECTS, Acts, ColumnEffect, Factor, Form, Product, known_effects
from xosc_lateral.extras.loop.columns import Column, Role, Values

LIMITS = (0.1, 0.25, 0.5, 0.75, 0.9)  # Quantiles at which limits are tried first; refined later. [-]
FINE_LIMITS = tuple(np.linspace(0.05, 0.95, 37).tolist())  # The quantiles at which they are refined. [-]
KNOTS = (0.1, 0.3, 0.5, 0.7, 0.9)  # Quantiles at which a curve may bend. [-]
SCALES = (0.25, 0.5, 0.75)  # Quantiles of a distance that are tried as scale of its influence. [-]
# Scales that refinement tries, alone and in products, as shares of the median distance. [-]
FINE_SCALES = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
NEAR_SHARE = 2.0 / 3.0  # A distance comes near: its 5 % quantile is below this share of its median. [-]
# Directions that an angle is projected on: at most 8 % of a score is lost between two of them. [rad]
PHASES = np.pi * np.arange(4) / 4.0
LAST_SIDE = float(np.tanh(2.0))  # What a saturating quantity is at twice its scale; from there on it is +-1. [-]
# Products are tried among so many columns at most, those whose role is known first: sixty more columns must not cost
# twenty times as much.
MAX_PRODUCT_COLUMNS = 24


class Family(StrEnum):
    """Candidates that share one prior weight."""

    PLAIN = "plain"
    BENT = "bent"
    PRODUCT = "product"


@dataclass(frozen=True, eq=False)
class Candidate:
    """A quantity with one degree of freedom, not yet sized."""

    effect: ColumnEffect  # Without coefficients.
    family: Family
    cost: float  # What its family's size takes from its score. [squared score]
    contrast: tuple[float, ...] = (1.0,)  # Weights of the effect's components, where it has several.

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Columns that it reads."""
        return self.effect.columns

    @property
    def of_vector(self) -> bool:
        """Whether it is the component of a vector: of a speed and a direction, say."""
        factors = self.effect.factors if isinstance(self.effect, Product) else ()
        return any(factor.form in (Form.SINE, Form.COSINE) for factor in factors)

    def values(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Quantity before lag and response, shape (n,); NaN: as usual."""
        return np.asarray(self.effect.seen(context) @ np.asarray(self.contrast))


def candidates_of(columns: Sequence[Column], context: Mapping[str, FloatArray]) -> list[Candidate]:
    """All candidates, from the road-following rows of `context`."""
    known_first = sorted(columns, key=lambda column: column.role is Role.UNKNOWN)[:MAX_PRODUCT_COLUMNS]
    paired = [column for column in columns if column in known_first]
    factors = {column.name: _factors(column, context[column.name]) for column in columns}
    families: dict[Family, list[ColumnEffect]] = {
        Family.PLAIN: [shape for column in columns for shape in _plain(column, context[column.name])],
        Family.BENT: [shape for column in columns for shape in _bent(column, context[column.name])],
        Family.PRODUCT: [
            Product(acts=Acts.LOCATION, factors=pair)
            for first, second in combinations(paired, 2)
            for pair in _pairs(first, second, factors)
        ],
    }

    def contrasts(effect: ColumnEffect) -> list[tuple[float, ...]]:
        """Weights of its components with which an effect is tried."""
        if isinstance(effect, effects.Angular):
            return [(float(np.sin(phase)), float(np.cos(phase))) for phase in PHASES]
        return [(1.0,) * effect.quantity({name: context[name][:1] for name in effect.columns}).shape[1]]

    candidates = []
    for family, shapes in families.items():
        members = [(effect, contrast) for effect in shapes for contrast in contrasts(effect)]
        candidates += [Candidate(effect, family, 2.0 * float(np.log(len(members))), one) for effect, one in members]
    return candidates


def shapes_of(
    column: Column, values: FloatArray, *, curves: bool
) -> tuple[list[ColumnEffect], list[ColumnEffect], float]:
    """Plain shapes of a column, bent ones in fine steps, and how many times as many as the dictionary has."""
    bent = _unique((*_bent(column, values, FINE_LIMITS), *_fading(column, values)))
    bent += _curves(column, values) if curves else []
    return _unique(_plain(column, values)), bent, len(bent) / max(1, len(_unique(_bent(column, values))))


def _unique(shapes: Iterable[ColumnEffect]) -> list[ColumnEffect]:
    return list({repr(effect): effect for effect in shapes}.values())


def _fading(column: Column, values: FloatArray, shares: Sequence[float] = FINE_SCALES) -> Iterator[ColumnEffect]:
    if column.gaps and column.values is Values.NUMBER and (scale := _scale(values, 0.5)) > 0.0:
        for share in shares:
            yield effects.Proximity(acts=Acts.LOCATION, column=column.name, scale=share * scale)


def _curves(column: Column, values: FloatArray) -> list[ColumnEffect]:
    """Curves with one or two bends; a neighbour that is not there is far away, which a curve does not say."""
    if column.values is not Values.NUMBER or column.gaps:
        return []
    knots = np.unique(_quantiles(values[np.isfinite(values)], KNOTS)).tolist()
    several = (some for number in (1, 2) for some in combinations(knots, number))
    return [effects.Piecewise(acts=Acts.LOCATION, column=column.name, knots=some) for some in several]


def _plain(column: Column, values: FloatArray) -> Iterator[ColumnEffect]:
    name = column.name
    if column.values is Values.ANGLE:
        yield effects.Angular(acts=Acts.LOCATION, column=name, period=column.period)
        return
    if _varies(values):
        yield effects.Linear(acts=Acts.LOCATION, column=name)
    if column.gaps:
        yield effects.Nearness(acts=Acts.LOCATION, column=name, presence=True)
        yield from _fading(column, values, (1.0,))


def _bent(column: Column, values: FloatArray, limits: Sequence[float] = LIMITS) -> Iterator[ColumnEffect]:
    name, seen = column.name, values[np.isfinite(values)]
    yield from offered_effects(name, values)
    if column.values is Values.LEVELS:
        yield from (effects.Levels(acts=Acts.LOCATION, column=name, levels=(level,)) for level in column.levels)
    if column.values is not Values.NUMBER or not _varies(values):
        return
    for at in np.unique(_quantiles(seen, limits)).tolist():
        if seen.min() < at < seen.max():
            yield effects.Threshold(acts=Acts.LOCATION, column=name, at=at)
            yield effects.Threshold(acts=Acts.LOCATION, column=name, at=at, jump=False)
    low, middle, high = _quantiles(seen, (0.1, 0.5, 0.9)).tolist()
    if high > low:
        for width in (0.2, 0.5):
            yield effects.Saturating(acts=Acts.LOCATION, column=name, middle=middle, scale=width * (high - low))
    if seen.min() < 0.0 < seen.max():
        yield effects.Magnitude(acts=Acts.LOCATION, column=name)
        sizes = np.unique(_quantiles(np.abs(seen), [share for share in limits if share >= 0.5]))
        for size in sizes[sizes > 0.0].tolist():
            yield effects.Linear(acts=Acts.LOCATION, column=name, episode=size)
            # to which side the last bend beyond the size went, however sharp it was
            to_a_side = {"middle": 0.0, "scale": 0.5 * size, "episode": LAST_SIDE}
            yield effects.Saturating(acts=Acts.LOCATION, column=name, **to_a_side)
    for share in SCALES if column.gaps else ():
        if (scale := _scale(values, share)) > 0.0:
            yield effects.Proximity(acts=Acts.LOCATION, column=name, scale=0.5 * scale)
            yield effects.Proximity(acts=Acts.LOCATION, column=name, scale=scale)
            yield effects.Proximity(acts=Acts.LOCATION, column=name, scale=scale, episode=float(np.exp(-1.0)))


def _factors(column: Column, values: FloatArray) -> list[Factor]:
    """How a column enters products: a number about its natural zero, else about its median."""
    name = column.name
    if column.values is Values.ANGLE:
        return [Factor(column=name, form=form, at=column.period) for form in (Form.SINE, Form.COSINE)]
    if column.values is Values.LEVELS:
        return [Factor(column=name, form=Form.EQUALS, at=level) for level in column.levels]
    if column.values is Values.SWITCH:
        low, high = min(column.levels), max(column.levels)
        return [Factor(column=name) if (low, high) == (0.0, 1.0) else Factor(column=name, form=Form.EQUALS, at=high)]
    if column.gaps:
        there, scale = Factor(column=name, form=Form.PRESENCE), _scale(values, 0.5)
        return [there, Factor(column=name, form=Form.PROXIMITY, at=scale)] if scale > 0.0 else [there]
    if not _varies(values):
        return []
    low, middle, high = np.quantile(values[np.isfinite(values)], [0.1, 0.5, 0.9]).tolist()
    return [Factor(column=name, at=0.0 if low < 0.0 < high else middle)]


def _pairs(first: Column, second: Column, factors: Mapping[str, list[Factor]]) -> Iterator[tuple[Factor, Factor]]:
    for factor, other in product(factors[first.name], factors[second.name]):
        if Values.ANGLE in (first.values, second.values):  # a vector's component: speed counts from its own zero
            factor, other = (Factor(column=f.column) if f.form is Form.VALUE else f for f in (factor, other))
        yield factor, other


def _quantiles(seen: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Quantiles of a column beside the few values that it mostly has, a crossfall of 2.5 % either way, say."""
    while True:
        values = np.quantile(seen, shares)
        known, times = np.unique(values, return_counts=True)
        rest = seen[~np.isin(seen, known[times > 1])]
        if len(rest) in (0, len(seen)):
            return values
        seen = rest


def _scale(values: FloatArray, share: float) -> float:
    """Quantile of the size of what is there and not zero; 0 for what never comes near, as a leader's speed."""
    size = np.abs(values[np.isfinite(values)])
    size = size[size > 0.0]
    if not len(size) or float(np.quantile(size, 0.05)) > NEAR_SHARE * float(np.median(size)):
        return 0.0
    return float(np.quantile(size, share))


def _varies(values: FloatArray) -> bool:
    seen = values[np.isfinite(values)]
    return len(seen) > 1 and bool(np.ptp(seen) > 0.0)


def offered_effects(column: str, values: NDArray[np.float64]) -> list[ColumnEffect]:
    """What installed plug-ins propose for a column with these values, shape (n,), without coefficients."""
    kinds = [kind for kind in known_effects() if kind not in EFFECTS and issubclass(kind, ColumnEffect)]
    return [effect for kind in kinds for effect in kind.proposals(column, values)]
