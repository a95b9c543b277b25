"""Draws against closed-form moments; tolerances are 5 standard errors of the sample size."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from xosc_lateral.world.scenario.distribution import (
    Bin,
    Deterministic,
    DistributionError,
    Draw,
    Element,
    Histogram,
    Limits,
    LogNormal,
    Normal,
    Poisson,
    SteppedRange,
    Stochastic,
    Uniform,
    ValueSets,
    Weighted,
)
from xosc_lateral.world.scenario.place import Place

PLACE = Place("f.xosc", 1, "e")
COUNT = 4000


def bins(*parts: tuple[float, float, float]) -> Histogram:
    return Histogram(tuple(Bin(weight, limits=Limits(lower, upper)) for lower, upper, weight in parts))


def weighted(**weights: float) -> Weighted:
    return Weighted(tuple(Element(value, weight) for value, weight in weights.items()))


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
        (Uniform(limits=Limits(2.0, 6.0)), 4.0, 16.0 / 12.0),
        (Normal(3.0, 4.0), 3.0, 4.0),
        (LogNormal(5.0, 2.0), 5.0, 2.0),
        (Poisson(3.5), 3.5, 3.5),
        (bins((0.0, 2.0, 1.0), (2.0, 4.0, 3.0)), 2.5, 1.0 / 3.0 + 0.75),
    ],
)
def test_draws_have_the_stated_mean_and_variance(distribution: Draw, mean: float, variance: float) -> None:
    values = draws(distribution)
    assert values.mean() == pytest.approx(mean, abs=5.0 * np.sqrt(variance / COUNT))
    assert values.var() == pytest.approx(variance, rel=0.25)


def test_truncated_draws_stay_inside() -> None:
    values = draws(Normal(0.0, 1.0, limits=Limits(0.5, 1.0)))
    assert values.min() >= 0.5
    assert values.max() <= 1.0


def test_limits_that_nothing_meets_are_an_error() -> None:
    with pytest.raises(DistributionError, match="no value within"):
        Normal(0.0, 1e-6, limits=Limits(5.0, 6.0)).draw(np.random.default_rng(0))


def test_weighted_values_come_as_often_as_weighted() -> None:
    rng = np.random.default_rng(3)
    values = [weighted(car=3.0, truck=1.0, never=0.0).draw(rng) for _ in range(COUNT)]
    assert values.count("never") == 0
    assert values.count("car") / COUNT == pytest.approx(0.75, abs=5.0 * np.sqrt(0.75 * 0.25 / COUNT))


def test_stochastic_sets_repeat_for_the_same_seed() -> None:
    stochastic = Stochastic((("a", Uniform(limits=Limits(0.0, 1.0))), ("b", Poisson(2.0))), 3, None)
    first = [stochastic.sample(np.random.default_rng(7)) for _ in range(2)]
    assert first[0] == first[1]
    assert set(first[0]) == {"a", "b"}


# ---- whole laws, against scipy's ---------------------------------------------------------------------------------
def _log_normal(mean: float, variance: float) -> stats.rv_continuous:
    spread = np.log1p(variance / mean**2)
    return stats.lognorm(np.sqrt(spread), scale=mean / np.sqrt(1.0 + variance / mean**2))


class _Truncated:
    """A law of scipy's between two limits, by its cumulative function."""

    def __init__(self, law: object, low: float, high: float) -> None:
        self.law, self.low, self.high = law, low, high

    def cdf(self, x: np.ndarray) -> np.ndarray:
        below, above = self.law.cdf(self.low), self.law.cdf(self.high)  # type: ignore[attr-defined]
        return np.clip((self.law.cdf(x) - below) / (above - below), 0.0, 1.0)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("distribution", "law"),
    [
        (Uniform(limits=Limits(-3.0, -1.0)), stats.uniform(-3.0, 2.0)),
        (Normal(20.0, 9.0), stats.norm(20.0, 3.0)),
        (Normal(20.0, 9.0, limits=Limits(19.0, 27.5)), stats.truncnorm(-1.0 / 3.0, 2.5, 20.0, 3.0)),
        (LogNormal(2.0, 0.5), _log_normal(2.0, 0.5)),
        (LogNormal(2.0, 0.5, limits=Limits(1.5, 3.0)), _Truncated(_log_normal(2.0, 0.5), 1.5, 3.0)),
        (
            bins((0.0, 1.0, 2.0), (1.0, 4.0, 3.0), (4.0, 5.0, 5.0)),
            stats.rv_histogram((np.array([2.0, 3.0, 5.0]), np.array([0.0, 1.0, 4.0, 5.0])), density=False),
        ),
    ],
    ids=["uniform", "normal", "truncated normal", "log-normal", "truncated log-normal", "histogram"],
)
def test_draws_follow_the_whole_law_and_not_its_moments_alone(distribution: Draw, law: object) -> None:
    """A sample of 4000 lies further off than this once in 10^4 runs."""
    distance = stats.kstest(draws(distribution, seed=5), law.cdf)  # type: ignore[attr-defined]
    assert distance.pvalue > 1e-4


def test_a_truncated_poisson_keeps_the_proportions_of_what_is_left() -> None:
    counts = np.bincount(draws(Poisson(3.0, limits=Limits(2.0, 5.0)), seed=6).astype(int), minlength=7)
    assert counts[:2].sum() == 0 and counts[6:].sum() == 0
    share = stats.poisson(3.0).pmf(np.arange(2, 6))
    expected = COUNT * share / share.sum()
    assert stats.chisquare(counts[2:6], expected).pvalue > 1e-4


def test_weights_are_proportions_whatever_they_sum_to() -> None:
    """The standard lets weights sum to anything: only their ratios count."""
    words, weights = ("a", "b", "c"), (0.2, 0.5, 0.3)
    one, other = (
        weighted(**{word: k * weight for word, weight in zip(words, weights, strict=True)}).draw(
            np.random.default_rng(8)
        )
        for k in (1.0, 1000.0)
    )
    assert one == other
    rng = np.random.default_rng(9)
    found = [weighted(**dict(zip(words, weights, strict=True))).draw(rng) for _ in range(COUNT)]
    assert stats.chisquare([found.count(word) for word in words], COUNT * np.array(weights)).pvalue > 1e-4


def test_parameters_of_one_set_are_drawn_independently() -> None:
    both = Stochastic((("a", Normal(0.0, 1.0)), ("b", Normal(0.0, 1.0))), 1, None)
    rng = np.random.default_rng(10)
    rows = np.array([[float(value) for value in both.sample(rng).values()] for _ in range(COUNT)])
    assert abs(np.corrcoef(rows.T)[0, 1]) < 5.0 / np.sqrt(COUNT)


def test_a_number_that_was_drawn_is_read_back_to_the_last_bit() -> None:
    """A variant can be made again from the values in its manifest."""
    rng, again = np.random.default_rng(11), np.random.default_rng(11)
    assert float(Uniform(limits=Limits(0.0, 0.1)).draw(rng)) == again.uniform(0.0, 0.1)
    assert Poisson(1000.0).draw(rng).isdecimal()


@given(
    st.decimals(-100, 100, places=3),
    st.decimals("0.001", 5, places=3),
    st.integers(0, 40),
    st.decimals(0, "0.999", places=3),
)
def test_a_range_is_walked_in_exact_steps_and_never_beyond_its_end(
    lower: Decimal, step: Decimal, count: int, rest: Decimal
) -> None:
    upper = lower + count * step + rest * step
    values = [Decimal(one["p"]) for one in SteppedRange("p", lower, upper, step, PLACE)]
    assert len(values) == count + 1 == len(SteppedRange("p", lower, upper, step, PLACE))
    assert values == [lower + k * step for k in range(count + 1)]
    assert values[-1] <= upper < values[-1] + step


def test_a_range_that_ends_before_it_begins_has_no_values() -> None:
    backwards = SteppedRange("p", Decimal(2), Decimal(1), Decimal("0.5"), PLACE)
    assert len(backwards) == 0 and list(backwards) == []
    assert list(Deterministic((backwards, ValueSets(({"a": "1"},), PLACE)))) == []
