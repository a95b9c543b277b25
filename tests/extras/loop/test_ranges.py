"""Between which values an effect's size is told: numpy's quantiles of what drives it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of
from tests.kit.effects import made
from xosc_lateral.drivers.model.effects import (
    Angular,
    ColumnEffect,
    Factor,
    Levels,
    Linear,
    Nearness,
    Product,
    Saturating,
    Threshold,
)
from xosc_lateral.extras.loop.terms.column import driving_range, span
from xosc_lateral.extras.loop.timeline import Coarse

N = 3000
INSIDE = slice(75, -75)
RNG = np.random.default_rng(1)
X, Y = RNG.normal(size=(2, N))
ANGLE = RNG.uniform(0.0, 360.0, N)
RARE = (np.arange(N) % 100 == 0).astype(float)
LEAD = np.where(np.arange(N) % 3 == 0, np.nan, RNG.uniform(5.0, 80.0, N))


@pytest.fixture(scope="module")
def coarse() -> Coarse:
    columns = {"x": X, "y": Y, "angle": ANGLE, "rare": RARE, "lead": LEAD, "lane": np.floor(np.arange(N) / 1000.0)}
    return coarse_of(np.zeros(N), columns)


@pytest.mark.parametrize(
    "effect",
    [
        made(Linear, 0.1, column="x"),
        made(Threshold, 0.1, column="x", at=0.5, jump=False),
        made(Saturating, 0.1, column="x", middle=0.2, scale=0.5),
    ],
    ids=lambda effect: effect.kind,
)
def test_a_single_number_drives_between_its_5_and_95_percent_quantile(coarse: Coarse, effect: ColumnEffect) -> None:
    ends = np.quantile(X[INSIDE], [0.05, 0.95])
    low, high = driving_range(coarse, effect)
    np.testing.assert_allclose([low, high], effect.quantity({"x": ends}))
    assert span(coarse, effect) == pytest.approx(0.1 * float(high[0] - low[0]))


def test_a_switch_that_is_hardly_ever_on_has_its_two_values(coarse: Coarse) -> None:
    low, high = driving_range(coarse, made(Linear, 0.15, column="rare"))
    assert (low[0], high[0]) == (0.0, 1.0)
    assert span(coarse, made(Linear, 0.15, column="rare")) == pytest.approx(0.15)


def test_a_product_drives_by_its_own_quantiles(coarse: Coarse) -> None:
    effect = made(Product, 0.2, factors=(Factor(column="x"), Factor(column="y")))
    product = (X * Y)[INSIDE]
    low, high = driving_range(coarse, effect)
    np.testing.assert_allclose([low[0], high[0]], np.quantile(product, [0.05, 0.95]), rtol=1e-12)


def test_an_angle_drives_between_the_directions_of_weakest_and_strongest(coarse: Coarse) -> None:
    """0.15 sin + 0.1 cos has the amplitude of their length; 5 % at either end are left out."""
    effect = made(Angular, 0.15, 0.1, column="angle")
    reach = np.hypot(0.15, 0.1) * np.cos(0.05 * np.pi)
    assert span(coarse, effect) == pytest.approx(2.0 * reach, rel=0.02)


def test_levels_drive_between_the_least_and_the_most(coarse: Coarse) -> None:
    effect = made(Levels, 0.1, -0.05, column="lane", levels=(1.0, 2.0))
    assert span(coarse, effect) == pytest.approx(0.15)


def test_where_there_is_none_does_not_count_for_a_number_and_does_for_a_neighbour(coarse: Coarse) -> None:
    there = LEAD[INSIDE][np.isfinite(LEAD[INSIDE])]
    low, high = driving_range(coarse, made(Linear, 0.01, column="lead"))
    np.testing.assert_allclose([low[0], high[0]], np.quantile(there, [0.05, 0.95]), rtol=1e-9)
    low, _ = driving_range(coarse, made(Nearness, 0.1, column="lead", scale=10.0))
    assert low[0] == 0.0


@pytest.mark.parametrize("factor", [-1.0, 3.0])
def test_spans_are_proportional_to_the_coefficient(coarse: Coarse, factor: float) -> None:
    one, other = (span(coarse, made(Linear, size, column="x")) for size in (0.1, 0.1 * factor))
    assert other == pytest.approx(factor * one)
