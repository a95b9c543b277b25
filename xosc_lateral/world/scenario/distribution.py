"""Parameter distributions: every combination (deterministic), or drawn (stochastic)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Annotated, Protocol

import numpy as np
from msgspec import Struct

from xosc_lateral.world.scenario.place import Place, Xml, called

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
        chained = itertools.chain.from_iterable
        return (dict(chained(sets.items() for sets in combination)) for combination in _product(self.parts))


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


MAX_TRIES = 10_000
"""Draws until a truncated distribution gives up."""


class DistributionError(ValueError):
    """No value of the distribution lies inside its limits. The reader adds file and line."""


class Draw(Protocol):
    """A distribution of one parameter."""

    def draw(self, rng: np.random.Generator) -> str:
        """One value as text."""


class Limits(Struct, frozen=True):
    """From `lower` to `upper`."""

    lower: Annotated[float, Xml(("lowerLimit",), finite=False)]
    upper: Annotated[float, Xml(("upperLimit",), finite=False)]

    def __post_init__(self) -> None:
        if self.upper < self.lower:
            raise ValueError(f"upperLimit {self.upper} is below lowerLimit {self.lower}")

    def first_inside(self, draw: Callable[[], float]) -> float:
        """The first of several draws that lies inside."""
        for _ in range(MAX_TRIES):
            value = draw()
            if self.lower <= value <= self.upper:
                return value
        raise DistributionError(f"no value within [{self.lower}, {self.upper}] in {MAX_TRIES} draws")


class Limited(Struct, frozen=True, kw_only=True):
    """Within a range, or without one."""

    limits: Annotated[Limits, called("Range")] = Limits(-math.inf, math.inf)


class Uniform(Limited, frozen=True):
    """Evenly between two limits."""

    def __post_init__(self) -> None:
        if math.isinf(self.limits.lower) or math.isinf(self.limits.upper):
            raise ValueError("needs a finite Range")

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        return repr(float(rng.uniform(self.limits.lower, self.limits.upper)))


class Normal(Limited, frozen=True):
    """Normal, by mean and variance; truncated to the limits by drawing again."""

    mean: Annotated[float, called("expectedValue")]
    variance: float

    def __post_init__(self) -> None:
        if self.variance < 0:
            raise ValueError(f"variance of {self.variance} is negative")

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        scale = math.sqrt(self.variance)
        return repr(self.limits.first_inside(lambda: float(rng.normal(self.mean, scale))))


class LogNormal(Normal, frozen=True):
    """Log-normal; `mean` and `variance` are those of the parameter itself, not of its logarithm."""

    def __post_init__(self) -> None:
        if self.mean <= 0:
            raise ValueError(f"expectedValue of {self.mean} is not positive")
        Normal.__post_init__(self)

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        spread = math.log1p(self.variance / self.mean**2)
        centre = math.log(self.mean) - spread / 2
        return repr(self.limits.first_inside(lambda: float(rng.lognormal(centre, math.sqrt(spread)))))


class Poisson(Limited, frozen=True):
    """Poisson; whole numbers."""

    mean: Annotated[float, called("expectedValue")]

    def __post_init__(self) -> None:
        if not 0 <= self.mean <= 1e9:
            raise ValueError(f"expectedValue of {self.mean} is not within [0, 1e9]")

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        return str(round(self.limits.first_inside(lambda: float(rng.poisson(self.mean)))))


class Bin(Uniform, frozen=True):
    """Values evenly between two limits, with a weight."""

    weight: float


class Element(Struct, frozen=True):
    """One value, with a weight."""

    value: str
    weight: float

    def draw(self, _: np.random.Generator) -> str:
        """The value."""
        return self.value


class Weighted(Struct, frozen=True):
    """Values with weights that need not sum to 1."""

    elements: tuple[Element, ...]

    def __post_init__(self) -> None:
        _check_weights(self.elements)

    def draw(self, rng: np.random.Generator) -> str:
        """One of the values."""
        return _one_of(self.elements, rng)


class Histogram(Struct, frozen=True):
    """Bins with weights, evenly inside a bin."""

    bins: Annotated[tuple[Bin, ...], called("Bin", "HistogramBin")]

    def __post_init__(self) -> None:
        _check_weights(self.bins)

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        return _one_of(self.bins, rng)


class Stochastic(Struct, frozen=True):
    """`number_of_test_runs` independent draws; `seed` None: the file has none."""

    draws: tuple[tuple[str, Draw], ...]
    number_of_test_runs: int
    seed: int | None

    def sample(self, rng: np.random.Generator) -> ParameterSet:
        """One set of values."""
        return {parameter: draw.draw(rng) for parameter, draw in self.draws}


def _check_weights(parts: Sequence[Element | Bin]) -> None:
    weights = [part.weight for part in parts]
    if not weights or min(weights) < 0 or sum(weights) <= 0:
        raise ValueError("needs weights that are not negative and not all zero")


def _one_of(parts: Sequence[Element | Bin], rng: np.random.Generator) -> str:
    """A value of one of them, which comes as often as it is weighted."""
    cumulative = np.cumsum([part.weight for part in parts])
    index = np.searchsorted(cumulative, rng.uniform(0.0, cumulative[-1]), side="right")
    return parts[min(int(index), len(parts) - 1)].draw(rng)
