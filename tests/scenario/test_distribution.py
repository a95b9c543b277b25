"""Draws against closed-form moments; tolerances are 5 standard errors of the sample size."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest

from xosc_lateral.scenario.distribution import (
    Deterministic,
    DistributionError,
    Draw,
    Histogram,
    LogNormal,
    Normal,
    Poisson,
    SteppedRange,
    Stochastic,
    Uniform,
    ValueSets,
    Weighted,
)
from xosc_lateral.scenario.place import Place

PLACE = Place("f.xosc", 1, "e")
COUNT = 4000


def draws(distribution: Draw, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([float(distribution.draw(rng)) for _ in range(COUNT)])


def test_range_holds_both_ends_in_exact_decimals() -> None:
    values = SteppedRange("p", Decimal("1.1"), Decimal("1.5"), Decimal("0.2"), PLACE)
    assert [v["p"] for v in values] == ["1.1", "1.3", "1.5"]
    assert len(values) == 3


def test_combinations_vary_the_last_part_fastest() -> None:
    parts = (
        ValueSets(({"a": "1", "b": "x"}, {"a": "2"}), PLACE),
        SteppedRange("c", Decimal(0), Decimal(1), Decimal(1), PLACE),
    )
    combined = Deterministic(parts)
    assert len(combined) == 4
    assert list(combined) == [
        {"a": "1", "b": "x", "c": "0"},
        {"a": "1", "b": "x", "c": "1"},
        {"a": "2", "c": "0"},
        {"a": "2", "c": "1"},
    ]


def test_a_huge_product_is_made_lazily() -> None:
    part = SteppedRange("p", Decimal(0), Decimal(999_999), Decimal(1), PLACE)
    combined = Deterministic((part, part, part))
    assert len(combined) == 10**18
    assert next(iter(combined)) == {"p": "0"}


@pytest.mark.parametrize(
    ("distribution", "mean", "variance"),
    [
        (Uniform(2.0, 6.0), 4.0, 16.0 / 12.0),
        (Normal(3.0, 4.0), 3.0, 4.0),
        (LogNormal(5.0, 2.0), 5.0, 2.0),
        (Poisson(3.5), 3.5, 3.5),
        (Histogram(((0.0, 2.0), (2.0, 4.0)), (1.0, 3.0)), 2.5, 1.0 / 3.0 + 0.75),
    ],
)
def test_draws_have_the_stated_mean_and_variance(distribution: Draw, mean: float, variance: float) -> None:
    values = draws(distribution)
    assert values.mean() == pytest.approx(mean, abs=5.0 * np.sqrt(variance / COUNT))
    assert values.var() == pytest.approx(variance, rel=0.25)


def test_truncated_draws_stay_inside() -> None:
    values = draws(Normal(0.0, 1.0, (0.5, 1.0)))
    assert values.min() >= 0.5
    assert values.max() <= 1.0


def test_limits_that_nothing_meets_are_an_error() -> None:
    with pytest.raises(DistributionError, match="no value within"):
        Normal(0.0, 1e-6, (5.0, 6.0)).draw(np.random.default_rng(0))


def test_weighted_values_come_as_often_as_weighted() -> None:
    rng = np.random.default_rng(3)
    values = [Weighted(("car", "truck", "never"), (3.0, 1.0, 0.0)).draw(rng) for _ in range(COUNT)]
    assert values.count("never") == 0
    assert values.count("car") / COUNT == pytest.approx(0.75, abs=5.0 * np.sqrt(0.75 * 0.25 / COUNT))


def test_stochastic_sets_repeat_for_the_same_seed() -> None:
    stochastic = Stochastic((("a", Uniform(0.0, 1.0)), ("b", Poisson(2.0))), 3, None)
    first = [stochastic.sample(np.random.default_rng(7)) for _ in range(2)]
    assert first[0] == first[1]
    assert set(first[0]) == {"a", "b"}
