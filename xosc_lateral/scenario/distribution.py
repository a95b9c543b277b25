"""Parameter distributions: every combination (deterministic), or drawn (stochastic)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Protocol

import numpy as np
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


MAX_TRIES = 10_000
"""Draws until a truncated distribution gives up."""


class Draw(Protocol):
    """A distribution of one parameter."""

    def draw(self, rng: np.random.Generator) -> str:
        """One value as text."""
        ...


class Weighted(Struct, frozen=True):
    """Values with weights that need not sum to 1."""

    values: tuple[str, ...]
    weights: tuple[float, ...]

    def draw(self, rng: np.random.Generator) -> str:
        """One of the values."""
        return self.values[_weighted_index(self.weights, rng)]


class Uniform(Struct, frozen=True):
    """Evenly between two limits."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        return repr(float(rng.uniform(self.lower, self.upper)))


class Histogram(Struct, frozen=True):
    """Bins with weights, evenly inside a bin."""

    bins: tuple[tuple[float, float], ...]
    weights: tuple[float, ...]

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        lower, upper = self.bins[_weighted_index(self.weights, rng)]
        return repr(float(rng.uniform(lower, upper)))


class Normal(Struct, frozen=True):
    """Normal, by mean and variance; truncated to the limits by drawing again."""

    mean: float
    variance: float
    limits: tuple[float, float] = (-math.inf, math.inf)

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        scale = math.sqrt(self.variance)
        return repr(_truncated(lambda: float(rng.normal(self.mean, scale)), self.limits))


class LogNormal(Struct, frozen=True):
    """Log-normal; `mean` and `variance` are those of the parameter itself, not of its logarithm."""

    mean: float
    variance: float
    limits: tuple[float, float] = (-math.inf, math.inf)

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        spread = math.log1p(self.variance / self.mean**2)
        centre = math.log(self.mean) - spread / 2
        return repr(_truncated(lambda: float(rng.lognormal(centre, math.sqrt(spread))), self.limits))


class Poisson(Struct, frozen=True):
    """Poisson; whole numbers."""

    mean: float
    limits: tuple[float, float] = (-math.inf, math.inf)

    def draw(self, rng: np.random.Generator) -> str:
        """One value."""
        return str(round(_truncated(lambda: float(rng.poisson(self.mean)), self.limits)))


class DistributionError(ValueError):
    """No value of the distribution lies inside its limits. The reader adds file and line."""


class Stochastic(Struct, frozen=True):
    """`number_of_test_runs` independent draws; `seed` None: the file has none."""

    draws: tuple[tuple[str, Draw], ...]
    number_of_test_runs: int
    seed: int | None

    def sample(self, rng: np.random.Generator) -> ParameterSet:
        """One set of values."""
        return {parameter: draw.draw(rng) for parameter, draw in self.draws}


def _weighted_index(weights: Sequence[float], rng: np.random.Generator) -> int:
    cumulative = np.cumsum(weights)
    return int(np.searchsorted(cumulative, rng.uniform(0.0, cumulative[-1]), side="right").clip(0, len(weights) - 1))


def _truncated(draw: Callable[[], float], limits: tuple[float, float]) -> float:
    for _ in range(MAX_TRIES):
        value = draw()
        if limits[0] <= value <= limits[1]:
            return value
    raise DistributionError(f"no value within [{limits[0]}, {limits[1]}] in {MAX_TRIES} draws")
