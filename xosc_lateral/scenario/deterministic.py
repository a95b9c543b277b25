"""Deterministic logical scenarios: every combination of sets and ranges of values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal

from msgspec import Struct

from xosc_lateral.scenario.place import Place

ParameterSet = Mapping[str, str]


class ValueSets(Struct, frozen=True):
    """Deterministic: one of these sets of values, in this order."""

    sets: tuple[ParameterSet, ...]
    place: Place

    def __len__(self) -> int:
        """How many."""
        return len(self.sets)

    def __iter__(self) -> Iterator[ParameterSet]:
        """One after another."""
        return iter(self.sets)


class SteppedRange(Struct, frozen=True):
    """Deterministic: ``lower, lower + step ...`` up to and including `upper`, in exact decimals as written."""

    parameter: str
    lower: Decimal
    upper: Decimal
    step: Decimal
    place: Place

    def __len__(self) -> int:
        """How many values."""
        return int((self.upper - self.lower) / self.step) + 1 if self.upper >= self.lower else 0

    def __iter__(self) -> Iterator[ParameterSet]:
        """One value after another."""
        return ({self.parameter: format(self.lower + index * self.step, "f")} for index in range(len(self)))


class Deterministic(Struct, frozen=True):
    """Every combination of its parts; the part declared first varies slowest."""

    parts: tuple[ValueSets | SteppedRange, ...]

    def __len__(self) -> int:
        """Number of combinations."""
        return math.prod(len(part) for part in self.parts)

    def __iter__(self) -> Iterator[ParameterSet]:
        """One combination after another, made when asked for: there may be millions."""
        return (_merged(combination) for combination in _product(self.parts))


def _product(parts: Sequence[ValueSets | SteppedRange]) -> Iterator[tuple[ParameterSet, ...]]:
    """`itertools.product` without its copies of every part."""
    if not all(parts):
        return
    rows = [iter(part) for part in parts]
    chosen = [next(row) for row in rows]
    while True:
        yield tuple(chosen)
        for place in reversed(range(len(parts))):
            following = next(rows[place], None)
            if following is not None:
                chosen[place] = following
                break
            rows[place] = iter(parts[place])
            chosen[place] = next(rows[place])
        else:
            return


def _merged(sets: Sequence[ParameterSet]) -> ParameterSet:
    return dict(itertools.chain.from_iterable(values.items() for values in sets))
