"""Levels of a column of whole numbers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity, strength
from xosc_lateral.drivers.model.effects import Levels


def test_a_level_is_met_by_what_is_less_than_one_away_in_part() -> None:
    """Resampling leaves 0.999999, and a scenario's lanes come and go without a jump."""
    met = quantity(made(Levels, 0.1, column="lane", levels=(1.0,)), lane=[0.999999, 1.0, 1.4, 1.6, 0.4, -1.0])
    np.testing.assert_allclose(met[:, 0], [1.0, 1.0, 0.6, 0.4, 0.4, 0.0], atol=2e-6)


def test_at_most_one_level_is_met_and_none_where_there_is_none() -> None:
    lane = np.array([0.0, 1.0, 2.0, 3.0, np.nan])
    met = quantity(made(Levels, 0.1, 0.2, column="lane", levels=(1.0, 2.0)), lane=lane)
    np.testing.assert_array_equal(met.sum(axis=1), [0.0, 1.0, 1.0, 0.0, 0.0])


def test_levels_may_stand_in_any_order() -> None:
    lane = np.random.default_rng(1).integers(0, 4, 60).astype(float)
    one = made(Levels, 0.1, -0.2, 0.05, column="lane", levels=(1.0, 2.0, 3.0))
    other = made(Levels, 0.05, 0.1, -0.2, column="lane", levels=(3.0, 1.0, 2.0))
    np.testing.assert_allclose(strength(one, lane=lane), strength(other, lane=lane), atol=1e-16)


@pytest.mark.parametrize(("levels", "words"), [((1.0,), "levels (1)"), ((0.0, 2.5), "levels (0, 2.5)")])
def test_the_shape_names_the_levels(levels: tuple[float, ...], words: str) -> None:
    assert made(Levels, *[0.1 for _ in levels], column="lane", levels=levels).shape == words
