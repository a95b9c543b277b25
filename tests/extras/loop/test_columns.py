"""What kind of quantity a column holds, from its values alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.kit.coarse import timeline_of
from xosc_lateral.extras.loop.columns import MAX_LEVELS, MIN_SHARE, Column, Values, known_columns

N = 6000
RNG = np.random.default_rng(121)
NUMBER = RNG.normal(size=N)
SWITCH = (RNG.random(N) < 0.3).astype(float)
LANES = RNG.integers(0, 3, N).astype(float)
NOBODY = RNG.random(N) < 0.4


def roles(**columns: np.ndarray) -> tuple[dict[str, Column], dict[str, str]]:
    found, unused = known_columns(timeline_of(np.zeros(N), columns))
    return {column.name: column for column in found}, unused


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (NUMBER, Column("c", Values.NUMBER, False)),
        (SWITCH, Column("c", Values.SWITCH, False, (0.0, 1.0))),
        (LANES, Column("c", Values.LEVELS, False, (0.0, 1.0, 2.0))),
        (np.where(NOBODY, np.nan, NUMBER), Column("c", Values.NUMBER, True)),
        (np.where(NOBODY, np.nan, SWITCH), Column("c", Values.SWITCH, True, (0.0, 1.0))),
        (RNG.integers(0, 40, N).astype(float), Column("c", Values.NUMBER, False)),
    ],
    ids=["number", "switch", "lanes", "neighbour", "neighbour's class", "counter"],
)
def test_a_column_is_what_its_values_are(values: np.ndarray, expected: Column) -> None:
    assert roles(c=values)[0]["c"] == expected


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (np.full(N, np.nan), "it is empty"),
        (np.where(np.arange(N) == 3000, 1.0, np.nan), "it is empty"),
        (np.full(N, 31.0), "it hardly varies"),
        (np.where(np.arange(N) % 500 == 0, 1.0, 0.0), "it hardly varies"),
    ],
    ids=["empty", "one value", "constant", "switch that is hardly ever on"],
)
def test_what_tells_nothing_is_left_out_with_the_reason(values: np.ndarray, why: str) -> None:
    found, unused = roles(c=values)
    assert "c" not in found
    assert unused["c"] == why


def test_a_neighbour_that_is_always_as_far_away_still_comes_and_goes() -> None:
    assert roles(c=np.where(NOBODY, np.nan, 12.0))[1]["c"] == "it hardly varies"
    near = np.where(NOBODY, np.nan, 12.0 + 1e-12 * NUMBER)
    assert roles(c=near)[0]["c"] == Column("c", Values.NUMBER, True)


def test_rare_levels_do_not_make_a_number() -> None:
    values = LANES.copy()
    values[1000] = 7.0
    assert roles(c=values)[0]["c"].levels == (0.0, 1.0, 2.0)
    assert 1.0 / N < MIN_SHARE


@pytest.mark.parametrize("count", [MAX_LEVELS, MAX_LEVELS + 1])
def test_up_to_eight_whole_numbers_are_levels(count: int) -> None:
    column = roles(c=np.arange(N) % count + 0.0)[0]["c"]
    assert column.values is (Values.LEVELS if count == MAX_LEVELS else Values.NUMBER)


def test_a_column_that_wraps_is_an_angle() -> None:
    timeline = replace(timeline_of(np.zeros(N), {"c": RNG.uniform(0.0, 360.0, N)}), periods={"c": 360.0})
    found, _ = known_columns(timeline)
    (column,) = [one for one in found if one.name == "c"]
    assert (column.values, column.period) == (Values.ANGLE, 360.0)


def test_columns_come_in_alphabetical_order_and_the_lane_s_width_is_one() -> None:
    timeline = replace(timeline_of(np.zeros(N), {"z": NUMBER, "a": NUMBER}), lane_width=3.5 + 0.1 * NUMBER)
    assert [column.name for column in known_columns(timeline)[0]] == ["a", "lane_width", "z"]


def test_only_road_following_rows_count() -> None:
    """A column that varies in a traffic jam alone tells nothing about road-following."""
    jam = np.arange(N) > 3000
    timeline = timeline_of(np.zeros(N), {"c": np.where(jam, NUMBER, 5.0)}, valid=~jam)
    assert known_columns(timeline)[1]["c"] == "it hardly varies"
