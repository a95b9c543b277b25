"""An effect of one or two columns: its response, its size within bounds, and what it did to the offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect
from xosc_lateral.drivers.model.effects.ends import ends_of
from xosc_lateral.extras.loop.model import Description, Fitted, Term, proper
from xosc_lateral.extras.loop.refinement import Alternatives
from xosc_lateral.extras.loop.timeline import Coarse

DRIVING_QUANTILES = (0.05, 0.95)  # Of a column in these drives: its ends. [-]
GRID = 19  # Quantiles between them at which an effect may be strongest. [-]
SHARE_WITHOUT = 0.05  # Of the time without anybody from which "none" is an end of a column. [-]
FEW_VALUES = 12  # Different values up to which each is looked at. [-]


@dataclass(frozen=True, eq=False)
class ColumnTerm(Term):
    """An effect of one or two columns."""

    acts: ClassVar[Acts]
    what: ClassVar[str]  # What it acts on, in words.
    group: ClassVar[str] = "spread"  # Mean or spread: which summary statistics show it.
    within_drives: ClassVar[bool] = True  # Whether it acts by what changes within drives.
    effect: ColumnEffect  # Without coefficients.
    alike: Alternatives = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that the effect reads."""
        return self.effect.columns

    @classmethod
    def of(cls, effect: ColumnEffect, alike: Alternatives = ()) -> Self:
        """A term of an effect that may act on something else."""
        return cls(structs.replace(effect, acts=cls.acts), alike)

    def removed(self, fitted: Fitted, effects: tuple[Effect, ...]) -> Sequence[tuple[Acts, FloatArray]]:
        """What the sized effects do."""
        return [(own.acts, fitted.coarse.strength(own)) for own in effects if isinstance(own, ColumnEffect)]

    def quantity(self, coarse: Coarse, effects: tuple[Effect, ...]) -> FloatArray:
        """What it does."""
        return coarse.strength(proper(effects, ColumnEffect))  # type: ignore[type-abstract]

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Change between the ends of its column."""
        effect = proper(effects, ColumnEffect)  # type: ignore[type-abstract]
        profile = [one for _, own in fitted.estimates.values() for one in own]
        on_mean, ends = effect.acts is Acts.LOCATION, ends_of(effect, profile)
        assert ends is not None
        size = ends.change if on_mean else float(np.exp(ends.change))
        return Description(
            effect=f"{self.what} by {' and '.join(effect.columns)}",
            shape=effect.shape,
            size_m=size,
            size_error=ends.error * (1.0 if on_mean else size),
            statistic=f"{self.group} by effect: {key}",
            measure=f"{'mean offset' if on_mean else 'spread'} by fifths of the effect",
            lag_s=effect.lag_s,
            response_s=effect.response_s,
            ends=ends,
        )

    def ends(self, coarse: Coarse) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest response that counts, shape (k,): of all for a shift, 5 % and 95 % for a factor."""
        response = coarse.response(self.effect, keep=True)[coarse.valid]
        least, most = response.min(axis=0), response.max(axis=0)
        if self.acts is Acts.LOCATION:
            return least, most
        low, high = np.quantile(response, DRIVING_QUANTILES, axis=0)
        varies = high > low  # not so for a switch that is hardly ever on
        return np.where(varies, low, least), np.where(varies, high, most)

    def bounded(self, coarse: Coarse) -> FloatArray:
        """Responses within `ends`, about their mean, shape (n, k). [unit of the quantity]"""
        response = np.clip(coarse.response(self.effect, keep=True), *self.ends(coarse))
        return np.asarray(response - response[coarse.valid].mean(axis=0))

    def sized(self, coarse: Coarse, acts: Acts, sizes: FloatArray, errors: FloatArray) -> ColumnEffect:
        """The effect with its sizes, shrunk by how sure they are, bounded, zero at its mean."""
        raw = coarse.fine_response(self.effect)[coarse.timeline.valid]
        usual, (low, high) = raw.mean(axis=0), self.ends(coarse)
        within = np.clip(raw, usual + low, usual + high)
        return structs.replace(
            self.effect,
            acts=acts,
            coefficients=tuple(shrunk(sizes, errors)),
            errors=tuple(errors),
            reference=tuple(within.mean(axis=0)),
            response_range=tuple(zip((usual + low).tolist(), (usual + high).tolist(), strict=True)),
            driven=driven_values(coarse, self.columns),
        )


def driven_values(coarse: Coarse, columns: Sequence[str]) -> tuple[tuple[float | None, ...], ...]:
    """Values of columns between their ends, rising, behind None where there often is none. [unit of the column]"""
    driven: list[tuple[float | None, ...]] = []
    for name in columns:
        values = coarse.context[name][coarse.timeline.valid]
        seen = values[np.isfinite(values)]
        levels = np.unique(seen)
        grid = (
            np.unique(np.quantile(seen, np.linspace(*DRIVING_QUANTILES, GRID), method="nearest")) if len(seen) else seen
        )
        if len(levels) <= FEW_VALUES or len(grid) == 1:  # a switch, however rarely it is on
            grid = levels if len(levels) <= FEW_VALUES else levels[[0, -1]]
        often_none = len(seen) < (1.0 - SHARE_WITHOUT) * len(values)
        driven.append((*([None] if often_none or not len(seen) else []), *grid.tolist()))
    return tuple(driven)


def shrunk(sizes: FloatArray, errors: FloatArray) -> FloatArray:
    """Positive-part James-Stein, shape and unit of `sizes`: at a z of 2 three quarters are kept, at 5 all but 4 %."""
    squares = float(np.sum(np.square(sizes / np.maximum(errors, 1e-300))))
    return np.asarray(sizes * max(0.0, 1.0 - len(sizes) / max(squares, 1e-300)))


def of_kind(fitted: Fitted, kind: type[ColumnTerm]) -> list[ColumnTerm]:
    """Terms of one kind in a fit."""
    return [term for term in fitted.terms if isinstance(term, kind)]


def columns_on_size(fitted: Fitted) -> frozenset[str]:
    """Columns that act on the movement's size."""
    terms = [one for one in fitted.terms if isinstance(one, ColumnTerm) and one.acts is not Acts.LOCATION]
    return frozenset(name for term in terms for name in term.columns)
