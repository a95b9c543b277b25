"""Cutting paths and choosing vertices, against motion in closed form.

Errors are measured as the reference player drives: constant speed between two vertices.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.motion.path_pieces import VERTEX_SPACING, RowStretch, cut_path, vertex_times

STEP = 0.02
FloatArray = NDArray[np.float64]


def pieces(
    x: FloatArray, *, active: FloatArray | None = None, teleported: FloatArray | None = None
) -> list[RowStretch]:
    time = STEP * np.arange(len(x))
    there = np.ones(len(x), bool) if active is None else active.astype(bool)
    placed = np.zeros(len(x), bool) if teleported is None else teleported.astype(bool)
    activity = Activity.ACTIVE * there + Activity.TELEPORTED * placed
    return cut_path(time, x, np.zeros_like(x), activity.astype(np.uint8))


def driven(speed: FloatArray) -> FloatArray:
    return np.concatenate(([0.0], np.cumsum(speed[1:] * STEP)))


def checked(x: FloatArray, piece: RowStretch) -> tuple[FloatArray, float, float]:
    """Vertex times, least spacing, largest error of one piece."""
    time = (STEP * np.arange(len(x)))[piece.first : piece.last + 1]
    inside = x[piece.first : piece.last + 1]
    times = vertex_times(time, inside, np.zeros_like(inside))
    at = np.interp(times, time, inside)
    return times, float(np.abs(np.diff(at)).min()), float(np.abs(np.interp(time, times, at) - inside).max())


TIME = STEP * np.arange(1500)


def test_steady_driving_is_one_move_with_a_vertex_every_tenth_of_a_second() -> None:
    x = driven(np.full_like(TIME, 30.0))
    (piece,) = pieces(x)
    assert piece == RowStretch(0, len(x) - 1, placed=False, stops=False)
    times, _, error = checked(x, piece)
    assert np.diff(times) == pytest.approx(times[1] - times[0], abs=1e-9)
    assert times[1] - times[0] == pytest.approx(0.1, rel=0.01)
    assert times[-1] == pytest.approx(TIME[-1])
    assert error < 1e-9


def test_a_car_that_never_moves_has_no_move() -> None:
    assert pieces(np.zeros(200)) == []


def test_braking_standing_and_moving_off_are_two_moves_within_three_centimetres() -> None:
    speed = np.clip(20.0 - 6.0 * np.clip(TIME - 3.0, 0.0, None), 0.0, None)
    speed[TIME > 12.0] = np.minimum(2.0 * (TIME[TIME > 12.0] - 12.0), 15.0)
    x = driven(speed)
    first, second = pieces(x)
    assert first.stops
    assert not second.stops
    assert TIME[first.last] == pytest.approx(3.0 + 20.0 / 6.0, abs=2 * STEP)
    assert TIME[second.first] == pytest.approx(12.0, abs=2 * STEP)
    for piece in (first, second):
        _, spacing, error = checked(x, piece)
        assert spacing >= 0.1
        # A quarter of the spacing at the stop.
        assert error <= 0.03


@pytest.mark.parametrize("pace", [0.05, 0.2, 1.0, 4.0])
def test_creeping_stays_within_five_centimetres(pace: float) -> None:
    x = driven(pace * (1.0 + np.sin(TIME)))
    for piece in pieces(x):
        times, spacing, error = checked(x, piece) if x[piece.last] - x[piece.first] > 0.2 else (np.empty(0), 1.0, 0.0)
        assert spacing >= 0.1
        assert error <= 0.05
        assert (np.diff(times) > 0).all()


def test_a_car_that_turns_back_has_a_piece_for_each_way() -> None:
    """From 5 m/s forward to 5 m/s backward: where it turns, one piece ends and the next begins."""
    x = driven(np.clip(20.0 - 5.0 * TIME, -5.0, 5.0))
    there, back = pieces(x)
    assert x[there.last] == x.max()
    assert back.first == there.last
    assert not there.stops
    for piece in (there, back):
        assert checked(x, piece)[2] < 0.03


def test_a_sudden_change_of_speed_gets_a_vertex() -> None:
    x = driven(np.where(TIME > 10.05, 1.0, 33.0))
    (piece,) = pieces(x)
    _, spacing, error = checked(x, piece)
    assert spacing >= 0.1
    assert error < 0.02


@pytest.mark.parametrize("pace", [10.0, 30.0])
def test_a_car_that_creeps_its_last_centimetres_is_off_by_what_a_vertex_can_not_be_nearer_to_the_end(
    pace: float,
) -> None:
    """From 10 or 30 m/s it creeps 6 cm: the last vertex is 10.5 cm before the end, 4.5 cm before it creeps."""
    x = driven(np.append(np.full(100, pace), np.full(76, 0.04)))
    (piece,) = pieces(x)
    creeps = x[-1] - x[99]
    assert checked(x, piece)[2] == pytest.approx(VERTEX_SPACING - creeps, abs=0.002)


def test_a_start_in_the_second_row_is_not_smeared_over_the_first() -> None:
    speed = np.full_like(TIME, 36.0)
    speed[1] = 0.0
    x = driven(speed)
    (piece,) = pieces(x)
    assert piece.first == 1
    assert checked(x, piece)[2] < 1e-9


def test_a_teleport_begins_a_move_that_is_placed() -> None:
    x = driven(np.full_like(TIME, 10.0))
    x[700:] += 500.0
    teleported = np.zeros_like(x)
    teleported[700] = 1
    first, second = pieces(x, teleported=teleported)
    assert (first.last, second.first) == (699, 700)
    assert (first.placed, second.placed) == (False, True)


def test_a_teleport_to_a_place_to_stand_at_is_a_move_of_one_row() -> None:
    x = np.where(np.arange(300) < 100, 0.0, 50.0)
    teleported = np.zeros_like(x)
    teleported[100] = 1
    assert pieces(x, teleported=teleported) == [RowStretch(100, 100, placed=True, stops=True)]


def test_who_is_placed_drives_and_stops_has_one_move() -> None:
    x = driven(np.where(TIME < 10.0, 10.0, 0.0))
    teleported = np.zeros_like(x)
    teleported[100] = 1
    x[100:] += 500.0
    _, second = pieces(x, teleported=teleported)
    assert (second.first, second.placed, second.stops) == (100, True, True)
    assert TIME[second.last] == pytest.approx(10.0, abs=2 * STEP)


def test_who_is_there_for_the_first_row_alone_has_no_move() -> None:
    x = driven(np.full_like(TIME, 10.0))
    assert pieces(x, active=(np.arange(len(x)) < 1).astype(float)) == []


def test_an_entity_that_is_added_later_is_placed() -> None:
    x = driven(np.full_like(TIME, 10.0))
    x[:200] = np.nan
    (piece,) = pieces(x, active=(np.arange(len(x)) >= 200).astype(float))
    assert (piece.first, piece.placed) == (200, True)


def test_a_move_shorter_than_the_spacing_has_no_vertices_but_its_start() -> None:
    time = STEP * np.arange(10)
    assert len(vertex_times(time, 0.01 * np.arange(10), np.zeros(10))) == 1


def test_vertices_are_apart_in_the_plane_even_where_the_way_winds() -> None:
    """A circle of 4 cm, driven once: along the way 0.25 m, in the plane never 0.1 m apart."""
    time = np.arange(0.0, 5.0, 0.02)
    angle = 2.0 * np.pi * np.clip(time - 2.0, 0.0, 1.0)
    x = np.where(time < 2.0, time, np.where(time < 3.0, 2.0 + 0.04 * np.sin(angle), time - 1.0))
    y = 0.04 * (1.0 - np.cos(angle))
    times = vertex_times(time, x, y)
    gaps = np.hypot(np.diff(np.interp(times, time, x)), np.diff(np.interp(times, time, y)))
    assert gaps.min() >= 0.1
    assert (times[0], times[-1]) == (time[0], time[-1])


def test_who_winds_on_the_spot_has_no_vertices_but_its_start() -> None:
    """The circle of 4 cm alone: 0.25 m long, and no two places of it are 0.1 m apart."""
    time = np.arange(0.0, 1.0, 0.02)
    angle = 2.0 * np.pi * time
    assert vertex_times(time, 0.04 * np.sin(angle), 0.04 * (1.0 - np.cos(angle))).tolist() == [0.0]


def test_moves_and_vertices_of_long_runs_are_those_of_one_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows are taken in blocks, whose borders may lie anywhere: in a stop, in a turn, at a kink."""
    speed = np.clip(8.0 * np.cos(0.35 * TIME), -3.0, 6.0) * (np.abs(TIME - 20.0) > 1.5)
    way = driven(speed)
    x, y = 30.0 * np.sin(way / 30.0), 30.0 * (1.0 - np.cos(way / 30.0))
    activity = np.full(len(x), int(Activity.ACTIVE), dtype=np.uint8)

    def made() -> list[tuple[RowStretch, list[float]]]:
        parts = cut_path(TIME, x, y, activity)
        rows = (slice(one.first, one.last + 1) for one in parts)
        return [(one, vertex_times(TIME[k], x[k], y[k]).tolist()) for one, k in zip(parts, rows, strict=True)]

    whole = made()
    assert len(whole) > 3
    for size in (97, 250):
        monkeypatch.setattr("xosc_lateral.base.arrays.BLOCK", size)
        assert made() == [(one, pytest.approx(times, abs=1e-9)) for one, times in whole]
