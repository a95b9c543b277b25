"""A track: columns of known kind that nobody writes into, rows of it, its pieces, and even instants."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from xosc_lateral.base.track import Track

TIME = np.arange(0.0, 10.05, 0.1)
ROWS = np.arange(len(TIME))


def track(*breaks: int, **columns: np.ndarray[Any, Any]) -> Track:
    return Track("Car1", TIME, {"x": 30.0 * TIME, **columns}, np.array(breaks, dtype=np.intp))


def test_a_column_is_locked_and_the_callers_array_is_not() -> None:
    x = 20.0 * TIME
    made = track(x=x)
    x[0] = -1.0
    assert made.x[0] == -1.0, "no copy"
    with pytest.raises(ValueError, match="read-only"):
        made.x[0] = 0.0
    assert pickle.loads(pickle.dumps(made)).x[0] == -1.0


def test_what_is_not_there_is_named_with_its_unit_and_what_there_is() -> None:
    words = r"track 'Car1': no column 'lane_width' \[m\]; there are x"
    with pytest.raises(ValueError, match=words):
        track().validate("x", "lane_width")
    with pytest.raises(AttributeError, match=words):
        _ = track().lane_width


def test_another_length_kind_or_order_is_refused() -> None:
    with pytest.raises(ValueError, match=r"column 'lane' is float64 of .*, not int32 of shape \(101,\)"):
        track(lane=TIME)
    with pytest.raises(ValueError, match="column 'y'"):
        track(y=TIME[1:])
    with pytest.raises(ValueError, match="time does not increase"):
        Track("Car1", TIME[::-1], {}, np.empty(0, dtype=np.intp)).validate()


def test_rows_of_a_slice_are_views_and_a_break_is_at_the_first_row_that_is_left_after_it() -> None:
    made = track(20, 50)
    part = made.at(slice(10, 60))
    assert np.shares_memory(part.x, made.x) and part.breaks.tolist() == [10, 40]
    assert made.at(slice(None, None, 3)).breaks.tolist() == [7, 17]
    assert made.at(np.flatnonzero((ROWS < 15) | (ROWS > 55))).breaks.tolist() == [15]
    assert made.at(slice(50, 60)).breaks.tolist() == []


def test_pieces_end_at_breaks_gaps_and_cuts() -> None:
    made = track(20).at(np.flatnonzero((ROWS < 40) | (ROWS > 59)))
    assert [len(piece) for piece in made.pieces(1.0, cuts=[50])] == [20, 20, 10, 31]
    with pytest.raises(ValueError, match=r"breaks at rows \[20\]"):
        track(20).every(0.2)


def test_even_instants_have_what_is_between_the_rows_of_each_column() -> None:
    lateral = 3.5 * np.clip((TIME - 4.0) / 3.0, 0.0, 1.0)
    lane = np.round(lateral / 3.5)
    heading = np.mod(2.0 * np.pi - 0.5 + 0.1 * TIME, 2.0 * np.pi)
    columns = {"offset": lateral - 3.5 * lane, "lane": (-2 + lane).astype(np.int32), "lane_width": np.full(101, 3.5)}
    even = track(heading=heading, mood=np.sin(TIME), **columns).every(0.04)
    np.testing.assert_allclose(even.time, 0.04 * np.arange(251))
    np.testing.assert_allclose(even.offset + 3.5 * (even.lane + 2), np.interp(even.time, TIME, lateral), atol=1e-12)
    assert np.abs(np.diff(even.heading)).max() < 0.005 and even.lane.dtype == np.int32
    np.testing.assert_allclose(even.columns["mood"], np.interp(even.time, TIME, np.sin(TIME)))
