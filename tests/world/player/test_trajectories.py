"""Trajectories of all shapes against closed forms."""

from __future__ import annotations

from math import atan2, cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import trapezoid

from tests.kit.stage import (
    TIMING,
    WIDTH,
    Stage,
    after,
    entity,
    event,
    follow,
    in_world,
    maneuvers,
    on_lane,
    polyline,
    row,
    speed,
    teleport,
    trajectory,
)
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.paths.polyline import Corner, PolylinePath, fill_times, merge_close
from xosc_lateral.world.player.paths.registry import ClothoidPath, Control, NurbsPath, TimedClothoid, clamped_knots

EGO = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0)}


# ---- polylines -------------------------------------------------------------------------------------------------------
def test_without_times_the_own_speed_counts(tmp_path: Path) -> None:
    way = polyline((None, in_world(30.0, -1.75)), (None, in_world(130.0, -1.75)), (None, in_world(130.0, 98.25)))
    played = Stage(tmp_path).play(maneuvers(event(follow(way), trigger=after(1.0))), start=EGO)
    motion = entity(played)
    k = row(motion, 1.0) + 1
    assert motion.activity[k] & Activity.TRAJECTORY
    driven = 20.0 * (motion.time - 1.0)
    there = (driven > 0.0) & (driven < 200.0)
    np.testing.assert_allclose(motion.x[there], np.minimum(30.0 + driven, 130.0)[there], atol=1e-6)
    np.testing.assert_allclose(motion.y[there], -1.75 + np.maximum(driven - 100.0, 0.0)[there], atol=1e-6)


def test_in_position_mode_the_heading_turns_near_corners_only(tmp_path: Path) -> None:
    path = PolylinePath([Corner(0, 0), Corner(10, 0), Corner(10, 10)])
    assert path.at(5.0).heading == 0.0
    assert path.at(10.0).heading == pytest.approx(pi / 4)
    assert path.at(9.0).heading == pytest.approx(pi / 8)
    assert path.at(11.0).heading == pytest.approx(3 * pi / 8)
    assert path.at(13.0).heading == pytest.approx(pi / 2)


def test_who_turns_back_turns_to_the_left_from_east_and_to_the_right_from_west_as_in_esmini() -> None:
    """The difference of headings in [0, 2 pi) is half a turn: its sign is that of esmini's `GetAngleDifference`."""
    there, back = PolylinePath([Corner(0, 0), Corner(10, 0), Corner(0, 0), Corner(10, 0)]), 20.0
    assert [there.at(at).heading for at in (9.0, 10.0, 11.0)] == pytest.approx([pi / 4, pi / 2, 3 * pi / 4])
    assert [there.at(back + at).heading for at in (-1.0, 0.0, 1.0)] == pytest.approx([3 * pi / 4, pi / 2, pi / 4])


def test_in_follow_mode_the_heading_turns_evenly() -> None:
    path = PolylinePath([Corner(0, 0, heading=0.0), Corner(10, 0, heading=1.0)], follow=True)
    assert path.at(2.5).heading == pytest.approx(0.25)


def test_times_are_met_at_the_vertices(tmp_path: Path) -> None:
    way = polyline((0.0, in_world(30.0, 0.0)), (2.0, in_world(50.0, 0.0)), (4.0, in_world(110.0, 0.0)))
    played = Stage(tmp_path).play(maneuvers(event(follow(way, timing=TIMING), trigger=after(1.0))), start=EGO)
    motion = entity(played)
    elapsed = motion.time - 1.0
    there = (elapsed > 0.001) & (elapsed < 4.0)
    np.testing.assert_allclose(motion.x[there], np.interp(elapsed, [0, 2, 4], [30, 50, 110])[there], atol=1e-6)
    assert motion.speed[row(motion, 2.0)] == pytest.approx(10.0)
    assert motion.speed[row(motion, 4.5)] == pytest.approx(30.0)
    assert motion.speed[-1] == pytest.approx(30.0)


def test_absolute_times_with_scale_and_offset(tmp_path: Path) -> None:
    way = polyline((0.0, in_world(0.0, 0.0)), (20.0, in_world(400.0, 0.0)))
    timing = '<Timing domainAbsoluteRelative="absolute" scale="2" offset="1"/>'
    played = Stage(tmp_path).play(maneuvers(event(follow(way, timing=timing), trigger=after(1.0))), start=EGO)
    motion = entity(played)
    k = row(motion, 3.0)
    assert motion.x[k] == pytest.approx(20.0 * (2.0 * 3.0 + 1.0), abs=1e-6)
    assert motion.speed[k] == pytest.approx(40.0, abs=1e-6)


@pytest.mark.parametrize(("moment", "is_said"), [(1.0, False), (4.0, True)])
def test_times_that_are_over_at_the_start_are_said(tmp_path: Path, moment: float, is_said: bool) -> None:
    way = polyline((0.0, in_world(0.0, 0.0)), (3.0, in_world(60.0, 0.0)))
    timing = '<Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/>'
    played = Stage(tmp_path).play(maneuvers(event(follow(way, timing=timing), trigger=after(moment))), start=EGO)
    assert any("are over when it starts" in note.what for note in played.motion.notes) is is_said


def test_in_follow_mode_the_speed_changes_evenly_from_that_before() -> None:
    path = PolylinePath([Corner(0, 0, time=0.0), Corner(30, 0, time=2.0)], follow=True, initial_speed=10.0)
    assert path.s_at(1.0) == pytest.approx(10.0 + 0.5 * 5.0)
    assert path.s_at(2.0) == pytest.approx(30.0)
    assert path.speed_at(30.0) == pytest.approx(20.0)


def test_the_end_goes_over_into_the_nearest_lane(tmp_path: Path) -> None:
    way = polyline((None, in_world(30.0, -1.75)), (None, in_world(130.0, -1.5 * WIDTH - 0.4)))
    played = Stage(tmp_path).play(maneuvers(event(follow(way))), start=EGO)
    motion = entity(played)
    assert motion.lane[-1] == -2
    assert motion.offset[-1] == pytest.approx(-0.4, abs=0.02)
    assert not motion.activity[-1] & Activity.TRAJECTORY


def test_a_jump_onto_the_trajectory_is_flagged(tmp_path: Path) -> None:
    way = polyline((None, in_world(130.0, -1.75)), (None, in_world(330.0, -1.75)))
    motion = entity(Stage(tmp_path).play(maneuvers(event(follow(way, start=20.0), trigger=after(1.0))), start=EGO))
    jump = row(motion, 1.02)
    assert motion.x[jump] == pytest.approx(150.4)
    assert motion.activity[jump] & Activity.TELEPORTED


def test_written_headings_count(tmp_path: Path) -> None:
    way = polyline((None, in_world(30.0, 0.0, 0.1)), (None, in_world(130.0, 0.0, 0.1)))
    motion = entity(Stage(tmp_path).play(maneuvers(event(follow(way))), start=EGO, last=3.0))
    np.testing.assert_allclose(motion.heading[1:], 0.1, atol=1e-9)
    way = polyline((None, in_world(30.0, -1.75, 0.1)), (None, in_world(130.0, -1.75, 0.1)))
    motion = entity(Stage(tmp_path).play(maneuvers(event(follow(way))), start=EGO, last=3.0))
    np.testing.assert_allclose(motion.heading_relative[1:], 0.1, atol=1e-9)


@pytest.mark.parametrize("repeated", [True, False])
@pytest.mark.parametrize("time", [None, 0.0], ids=["no times", "times that nothing refers to"])
def test_a_closed_trajectory_goes_round(tmp_path: Path, repeated: bool, time: float | None) -> None:
    """After 9 s at 20 m/s on a square of 160 m round: 20 m past its first corner, whether or not that is repeated."""
    corners = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0), (0.0, 0.0)][: 5 if repeated else 4]
    way = polyline(*((None if time is None else time + k, in_world(*at)) for k, at in enumerate(corners)), closed=True)
    motion = entity(Stage(tmp_path).play(maneuvers(event(follow(way))), start=EGO, last=12.0))
    assert np.hypot(np.diff(motion.x), np.diff(motion.y))[1:].max() < 0.4 + 1e-6  # no jump at the end
    assert motion.x[row(motion, 9.0)] == pytest.approx(20.0, abs=1e-6)
    assert motion.y[row(motion, 9.0)] == pytest.approx(0.0, abs=1e-6)


def test_a_closed_trajectory_that_is_followed_by_its_times_ends_with_them(tmp_path: Path) -> None:
    way = polyline((0.0, in_world(0.0, 0.0)), (2.0, in_world(40.0, 0.0)), (4.0, in_world(40.0, 40.0)), closed=True)
    motion = entity(Stage(tmp_path).play(maneuvers(event(follow(way, timing=TIMING))), start=EGO, last=4.02))
    assert (motion.x[row(motion, 4.0)], motion.y[row(motion, 4.0)]) == pytest.approx((40.0, 40.0), abs=0.5)


def test_a_closed_curve_that_does_not_end_at_its_start_is_said_to_jump(tmp_path: Path) -> None:
    shape = f'<Clothoid curvature="0" curvaturePrime="0" length="40"><Position>{in_world(0, 0)}</Position></Clothoid>'
    played = Stage(tmp_path).play(maneuvers(event(follow(trajectory(shape, closed=True)))), start=EGO, last=1.0)
    assert any("ends 40.00 m from its start" in str(note) for note in played.motion.notes)


def test_vertices_nearer_than_a_decimetre_count_as_one(tmp_path: Path) -> None:
    corners = [Corner(0, 0), Corner(0.05, 0), Corner(5, 0), Corner(5.02, 0), Corner(10, 0)]
    assert [c.x for c in merge_close(corners, 0.1)] == [0, 5, 10]
    way = polyline(*((None, in_world(x, 0.0)) for x in (0.0, 0.05, 50.0)))
    played = Stage(tmp_path).play(maneuvers(event(follow(way))), start=EGO, last=2.0)
    assert any("vertices" in note.what for note in played.motion.notes)


def test_missing_times_lie_evenly_between_the_given_ones() -> None:
    filled = fill_times([Corner(0, 0, time=1.0), Corner(30, 0), Corner(40, 0, time=5.0), Corner(50, 0, time=6.0)])
    assert [c.time for c in filled] == [1.0, 4.0, 5.0, 6.0]


def test_times_that_run_backwards_are_refused(tmp_path: Path) -> None:
    way = polyline((0.0, in_world(0, 0)), (2.0, in_world(10, 0)), (1.0, in_world(20, 0)))
    with pytest.raises(PlaybackError, match="vertex 3"):
        Stage(tmp_path).play(maneuvers(event(follow(way, timing=TIMING))), start=EGO)


def test_a_path_of_one_corner_is_a_place() -> None:
    path = PolylinePath([Corner(50.0, 1.0, time=3.0)])
    assert path.length == 0.0
    assert path.at(path.s_at(3.0))[:2] == (50.0, 1.0)


# ---- clothoids -------------------------------------------------------------------------------------------------------
def test_a_clothoid_of_constant_curvature_is_a_circle() -> None:
    path = ClothoidPath([TimedClothoid(1.0, 2.0, 0.3, 0.02, 0.02, 200.0)])
    for s in (0.0, 50.0, 123.4, 200.0):
        point = path.at(s)
        assert point.x == pytest.approx(1.0 + 50.0 * (sin(0.3 + 0.02 * s) - sin(0.3)), abs=1e-9)
        assert point.y == pytest.approx(2.0 - 50.0 * (cos(0.3 + 0.02 * s) - cos(0.3)), abs=1e-9)


def test_a_clothoid_is_the_integral_of_its_heading() -> None:
    piece = TimedClothoid(0.0, 0.0, -0.2, 0.01, -0.03, 150.0)
    u = np.linspace(0.0, 150.0, 200_001)
    heading = -0.2 + u * (0.01 + 0.5 * (-0.04 / 150.0) * u)
    x, y, end = piece.at(150.0)
    assert x == pytest.approx(trapezoid(np.cos(heading), u), abs=1e-7)
    assert y == pytest.approx(trapezoid(np.sin(heading), u), abs=1e-7)
    assert cos(end) == pytest.approx(cos(heading[-1]))


def test_a_clothoid_is_driven(tmp_path: Path) -> None:
    shape = (
        '<Clothoid curvature="0.01" curvaturePrime="0" length="100" startTime="0" stopTime="5">'
        f"<Position>{in_world(0.0, 0.0, 0.0)}</Position></Clothoid>"
    )
    played = Stage(tmp_path).play(maneuvers(event(follow(trajectory(shape), timing=TIMING))), start=EGO, last=5.0)
    motion = entity(played)
    k = row(motion, 2.5)
    assert motion.x[k] == pytest.approx(100.0 * sin(0.5), abs=1e-6)
    assert motion.speed[k] == pytest.approx(20.0, abs=1e-6)


def test_a_clothoid_that_spins_is_refused(tmp_path: Path) -> None:
    shape = (
        f'<Clothoid curvature="1e6" curvaturePrime="0" length="100"><Position>{in_world(0, 0, 0)}</Position></Clothoid>'
    )
    with pytest.raises(PlaybackError, match="turning"):
        Stage(tmp_path).play(maneuvers(event(follow(trajectory(shape)))), start=EGO)


def test_a_clothoid_spline_goes_on_from_piece_to_piece(tmp_path: Path) -> None:
    segments = (
        f'<ClothoidSplineSegment curvatureStart="0" curvatureEnd="0" length="50"><PositionStart>{in_world(0, 0, 0)}'
        '</PositionStart></ClothoidSplineSegment><ClothoidSplineSegment curvatureStart="0.02" curvatureEnd="0.02" '
        'length="78.539816"/>'
    )
    shape = trajectory(f"<ClothoidSpline>{segments}</ClothoidSpline>")
    motion = entity(Stage(tmp_path).play(maneuvers(event(follow(shape))), start=EGO, minor=3))
    k = row(motion, (50.0 + 78.539816) / 20.0)
    assert (motion.x[k], motion.y[k]) == (pytest.approx(100.0, abs=0.3), pytest.approx(50.0, abs=0.3))


# ---- NURBS -----------------------------------------------------------------------------------------------------------
def test_a_nurbs_curve_with_the_right_weights_is_a_circle() -> None:
    weight = 2.0**-0.5
    controls = [Control(50.0, 0.0), Control(50.0, 50.0, weight), Control(0.0, 50.0)]
    path = NurbsPath(controls, (0, 0, 0, 1, 1, 1), 3)
    radii = [np.hypot(*path.at(s)[:2]) for s in np.linspace(0.0, path.length, 57)]
    np.testing.assert_allclose(radii, 50.0, atol=1e-6)
    assert path.length == pytest.approx(25.0 * pi, rel=1e-4)


def test_knots_without_any_given_clamp_the_ends() -> None:
    assert clamped_knots(5, 3) == pytest.approx((0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1))
    path = NurbsPath([Control(x, x * x) for x in range(5)], clamped_knots(5, 3), 3)
    assert path.at(0.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-4)
    assert path.at(path.length)[:2] == pytest.approx((4.0, 16.0), abs=1e-4)


def nurbs(*points: tuple[float, float, float], order: int = 3) -> str:
    inside = "".join(
        f'<ControlPoint time="{t}" weight="1"><Position>{in_world(x, y)}</Position></ControlPoint>'
        for t, x, y in points
    )
    knots = "".join(f'<Knot value="{k}"/>' for k in clamped_knots(len(points), order))
    return trajectory(f'<Nurbs order="{order}">{inside}{knots}</Nurbs>')


def test_a_nurbs_curve_is_driven(tmp_path: Path) -> None:
    way = nurbs((0, 0, 0), (2, 40, 0), (4, 40, 40), (6, 80, 40))
    played = Stage(tmp_path).play(maneuvers(event(follow(way, timing=TIMING))), start=EGO, last=5.9)
    motion = entity(played)
    assert motion.x[row(motion, 3.0)] == pytest.approx(40.0, abs=1.0)
    assert motion.y[row(motion, 3.0)] == pytest.approx(20.0, abs=1.0)
    assert np.hypot(np.diff(motion.x), np.diff(motion.y))[2:].max() < 0.7


def test_a_written_heading_against_the_path_means_driving_backwards(tmp_path: Path) -> None:
    """As in the reference player: 20 m/s against the way that the car points, along the way of the path."""
    way = polyline((0.0, in_world(10.0, 0.0, pi)), (5.0, in_world(60.0, 0.0, pi)))
    start = {"Ego": teleport(in_world(0.0, 0.0))}
    played = Stage(tmp_path, None).play(maneuvers(event(follow(way, timing=TIMING))), start=start, last=4.0)
    motion = entity(played)
    assert motion.x[row(motion, 2.0)] == pytest.approx(30.0, abs=0.3)
    assert motion.speed[row(motion, 2.0)] == pytest.approx(-10.0)
    assert motion.heading[row(motion, 2.0)] == pytest.approx(pi)


def test_with_the_own_speed_a_heading_against_the_path_leads_back_to_its_start(tmp_path: Path) -> None:
    way = polyline((None, in_world(10.0, 0.0, pi)), (None, in_world(60.0, 0.0, pi)))
    start = {"Ego": teleport(in_world(0.0, 0.0)) + speed(5.0)}
    played = Stage(tmp_path, None).play(maneuvers(event(follow(way, start=30.0))), start=start, last=4.0)
    assert entity(played).x[row(entity(played), 2.0)] == pytest.approx(30.0, abs=0.2)


def test_a_pause_of_a_second_between_close_vertices_is_kept(tmp_path: Path) -> None:
    """10 m/s to x = 20, a stop from 1 to 3 s, and on: the reference player's merging keeps the times of the stop."""
    x = ((0.0, 10.0), (1.0, 20.0), (2.0, 20.01), (3.0, 20.02), (4.0, 30.0))
    way = polyline(*((time, in_world(at, 0.0)) for time, at in x))
    start = {"Ego": teleport(in_world(10.0, 0.0)) + speed(10.0)}
    played = Stage(tmp_path, None).play(maneuvers(event(follow(way, timing=TIMING))), start=start, last=4.0)
    motion = entity(played)
    for time, place in ((0.5, 15.0), (1.5, 20.0), (2.9, 20.0), (3.5, 25.0)):
        assert motion.x[row(motion, time)] == pytest.approx(place, abs=0.02)


def test_a_shorter_pause_is_driven_through(tmp_path: Path) -> None:
    x = ((0.0, 10.0), (1.0, 20.0), (1.2, 20.01), (1.4, 20.02), (1.9, 30.0))
    corners = merge_close([Corner(at, 0.0, time=time) for time, at in x], 0.1)
    assert [(c.time, c.x) for c in corners] == [(0.0, 10.0), (1.0, 20.0), (1.9, 30.0)]


def test_a_path_that_climbs_pitches(tmp_path: Path) -> None:
    climb = '<WorldPosition x="{}" y="0" z="{}"/>'
    way = polyline((None, climb.format(10, 0)), (None, climb.format(50, 30)))
    start = {"Ego": teleport(in_world(10.0, 0.0)) + speed(10.0)}
    played = Stage(tmp_path, None).play(maneuvers(event(follow(way))), start=start, last=2.0)
    motion = entity(played)
    k = row(motion, 1.0)
    assert motion.pitch[k] == pytest.approx(-atan2(30.0, 40.0))
    assert motion.z[k] == pytest.approx(0.75 * (motion.x[k] - 10.0))
