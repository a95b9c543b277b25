"""Clothoids, NURBS and polylines that entities follow, against scipy and closed forms."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import cos, nan, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import fresnel

from xosc_lateral.world.player.paths.base import nearest_s
from xosc_lateral.world.player.paths.polyline import Corner, PolylinePath, fill_times, has_gaps_in_time, merge_close
from xosc_lateral.world.player.paths.registry import ClothoidPath, Control, NurbsPath, TimedClothoid, clamped_knots
from xosc_lateral.world.road.positions import difference, is_forward, wrap

finite = st.floats(-50.0, 50.0)


# ---- angles ----------------------------------------------------------------------------------------------------------
@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_points_the_same_way_and_lies_within_a_turn(angle: float) -> None:
    wrapped = wrap(angle)
    assert 0.0 <= wrapped < 2.0 * pi
    assert (cos(wrapped), sin(wrapped)) == pytest.approx((cos(angle), sin(angle)), abs=1e-8)


@given(finite, finite)
def test_a_difference_of_angles_is_the_short_way(angle: float, reference: float) -> None:
    turn = difference(angle, reference)
    assert -pi <= turn < pi
    assert cos(reference + turn) == pytest.approx(cos(angle), abs=1e-9)


@pytest.mark.parametrize(
    ("relative", "forward"), [(0.0, True), (1.5, True), (1.6, False), (pi, False), (-1.5, True), (-1.6, False)]
)
def test_forward_is_within_a_quarter_turn_of_s(relative: float, forward: bool) -> None:
    assert is_forward(relative) is forward


# ---- clothoids -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("rate", [1e-4, -4e-3, 0.05])
def test_a_clothoid_from_the_straight_is_a_fresnel_integral(rate: float) -> None:
    """With curvature rate * s: x + iy is the Fresnel integral at s sqrt(|rate| / pi), scaled back."""
    length = 60.0
    x, y, heading = TimedClothoid(0.0, 0.0, 0.0, 0.0, rate * length, length).at(length)
    scale = sqrt(pi / abs(rate))
    sine, cosine = fresnel(length / scale)
    assert (x, y) == pytest.approx((scale * cosine, np.sign(rate) * scale * sine), abs=1e-10)
    assert difference(heading, 0.5 * rate * length**2) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-3.0, 3.0), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(0.1, 80.0))
def test_any_clothoid_is_the_integral_of_its_heading(heading: float, begin: float, end: float, length: float) -> None:
    def heading_at(u: float) -> float:
        return heading + u * begin + 0.5 * u * u * (end - begin) / length

    x, y, _ = TimedClothoid(3.0, -2.0, heading, begin, end, length).at(length)
    expected_x = 3.0 + quad(lambda u: cos(heading_at(u)), 0.0, length, limit=200, epsabs=1e-10)[0]
    expected_y = -2.0 + quad(lambda u: sin(heading_at(u)), 0.0, length, limit=200, epsabs=1e-10)[0]
    assert (x, y) == pytest.approx((expected_x, expected_y), abs=1e-7)


def test_equal_curvatures_are_an_arc_and_no_curvature_a_line() -> None:
    x, y, heading = TimedClothoid(0.0, 0.0, 0.0, 0.02, 0.02, 50.0 * pi / 2.0).at(50.0 * pi / 2.0)
    assert (x, y, heading) == pytest.approx((50.0, 50.0, pi / 2.0), abs=1e-10)
    assert TimedClothoid(1.0, 1.0, pi / 4.0, 0.0, 0.0, sqrt(2.0)).at(sqrt(2.0))[:2] == pytest.approx((2.0, 2.0))


def test_a_clothoid_path_takes_its_pieces_one_after_another() -> None:
    first = TimedClothoid(0.0, 0.0, 0.0, 0.0, 0.0, 20.0, start_time=1.0)
    second = TimedClothoid(20.0, 0.0, 0.0, 0.1, 0.1, 10.0, start_time=3.0)
    path = ClothoidPath([first, second], end_time=8.0)
    assert path.length == 30.0
    assert (path.at(10.0).x, path.at(10.0).y) == pytest.approx((10.0, 0.0))
    assert (path.at(25.0).x, path.at(25.0).y) == pytest.approx((20.0 + 10.0 * sin(0.5), 10.0 * (1.0 - cos(0.5))))
    assert path.at(-5.0) == path.at(0.0)
    assert path.at(99.0) == path.at(30.0)
    assert [path.speed_at(s) for s in (5.0, 25.0)] == [10.0, 2.0]


@pytest.mark.parametrize(
    ("time", "s"), [(0.0, 0.0), (1.0, 0.0), (2.0, 10.0), (3.0, 20.0), (5.5, 25.0), (8.0, 30.0), (9.0, 30.0)]
)
def test_time_runs_evenly_on_each_clothoid(time: float, s: float) -> None:
    pieces = [TimedClothoid(0, 0, 0, 0, 0, 20.0, start_time=1.0), TimedClothoid(20.0, 0, 0, 0, 0, 10.0, start_time=3.0)]
    path = ClothoidPath(pieces, end_time=8.0)
    assert path.s_at(time) == pytest.approx(s)
    if 1.0 <= time <= 8.0:
        assert path.time_at(s) == pytest.approx(time)


def test_pieces_without_length_or_time_stand_still() -> None:
    path = ClothoidPath([TimedClothoid(1.0, 2.0, 0.5, 0.0, 0.0, 0.0, start_time=0.0)], end_time=0.0)
    assert (path.at(0.0).x, path.at(0.0).y, path.length, path.speed_at(0.0)) == (1.0, 2.0, 0.0, 0.0)
    assert path.time_at(0.0) == 0.0


# ---- NURBS -----------------------------------------------------------------------------------------------------------
def cox_de_boor(t: float, order: int, knots: Sequence[float]) -> list[float]:
    """Basis functions by their definition (Piegl and Tiller, eq. 2.5)."""

    def ratio(part: float, whole: float) -> float:
        return part / whole if whole > 0.0 else 0.0

    row = [1.0 if a <= t < b else 0.0 for a, b in pairwise(knots)]
    for k in range(2, order + 1):
        row = [
            ratio(t - knots[i], knots[i + k - 1] - knots[i]) * row[i]
            + ratio(knots[i + k] - t, knots[i + k] - knots[i + 1]) * row[i + 1]
            for i in range(len(knots) - k)
        ]
    return row


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("count", [4, 7])
@pytest.mark.parametrize("clamped", [True, False])
def test_a_curve_is_what_its_definition_says(order: int, count: int, clamped: bool) -> None:
    rng = np.random.default_rng(order + count)
    knots = clamped_knots(count, order) if clamped else tuple(np.linspace(0.0, 1.0, count + order).tolist())
    controls = [Control(*rng.uniform((-20.0, -20.0, 0.5), (20.0, 20.0, 2.0)).tolist()) for _ in range(count)]
    path = NurbsPath(controls, knots, order)
    inside = np.linspace(knots[order - 1], knots[count] - 1e-3, 23)
    for t, found in zip(inside.tolist(), path.points(inside), strict=True):
        shares = [share * c.weight for share, c in zip(cox_de_boor(t, order, knots), controls, strict=True)]
        x = sum(share * c.x for share, c in zip(shares, controls, strict=True)) / sum(shares)
        y = sum(share * c.y for share, c in zip(shares, controls, strict=True)) / sum(shares)
        assert found == pytest.approx((x, y), abs=1e-9)


def test_a_rational_quadratic_is_a_circle() -> None:
    """Three control points with the middle weight cos(45 degrees): the textbook's quarter circle."""
    controls = [Control(10.0, 0.0), Control(10.0, 10.0, weight=sqrt(0.5)), Control(0.0, 10.0)]
    path = NurbsPath(controls, (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), 3)
    assert np.hypot(*path.points(np.linspace(0.0, 1.0, 30)).T) == pytest.approx(10.0, abs=1e-12)
    assert path.length == pytest.approx(5.0 * pi, rel=2e-3)  # of the samples' chords
    assert path.at(0.0).heading == pytest.approx(pi / 2.0, abs=2e-3)
    assert path.at(path.length).heading == pytest.approx(pi, abs=2e-3)


def test_a_clamped_curve_begins_and_ends_in_its_control_points() -> None:
    controls = [Control(0.0, 0.0), Control(30.0, 5.0), Control(60.0, -5.0), Control(90.0, 0.0)]
    path = NurbsPath(controls, clamped_knots(4, 4), 4)
    assert path.points(np.array([0.0, 1.0])) == pytest.approx(np.array([[0.0, 0.0], [90.0, 0.0]]), abs=1e-3)


def test_an_order_of_two_is_the_control_polygon() -> None:
    path = NurbsPath([Control(0.0, 0.0), Control(10.0, 0.0), Control(10.0, 10.0)], clamped_knots(3, 2), 2)
    assert path.length == pytest.approx(20.0, abs=0.3)
    assert (path.at(5.0).x, path.at(5.0).y) == pytest.approx((5.0, 0.0), abs=0.05)


def test_times_of_control_points_are_met_where_they_weigh_most() -> None:
    controls = [Control(0.0, 0.0, time=2.0), Control(50.0, 0.0, time=7.0), Control(100.0, 0.0, time=12.0)]
    path = NurbsPath(controls, clamped_knots(3, 3), 3)
    assert (path.start_time, path.end_time) == (2.0, 12.0)
    assert path.s_at(0.0) == 0.0
    assert path.s_at(20.0) == path.length
    assert path.s_at(7.0) == pytest.approx(50.0, abs=1.0)
    assert path.time_at(path.s_at(5.0)) == pytest.approx(5.0, abs=1e-6)


# ---- polylines -------------------------------------------------------------------------------------------------------
def test_a_polyline_is_its_straight_pieces() -> None:
    path = PolylinePath([Corner(0.0, 0.0), Corner(3.0, 4.0), Corner(3.0, 14.0)])
    assert path.length == 15.0
    assert (path.at(2.5).x, path.at(2.5).y) == pytest.approx((1.5, 2.0))
    assert (path.at(10.0).x, path.at(10.0).y) == pytest.approx((3.0, 9.0))
    assert path.at(10.0).tangent == pytest.approx(pi / 2.0)


@given(st.lists(st.tuples(finite, finite), min_size=1, max_size=8), st.floats(-10.0, 500.0))
def test_a_point_of_a_polyline_lies_within_its_corners(places: list[tuple[float, float]], s: float) -> None:
    path = PolylinePath([Corner(x, y) for x, y in places])
    point = path.at(s)
    xs, ys = zip(*places, strict=True)
    assert min(xs) - 1e-9 <= point.x <= max(xs) + 1e-9
    assert min(ys) - 1e-9 <= point.y <= max(ys) + 1e-9


def test_position_mode_drives_each_piece_at_its_own_even_speed() -> None:
    path = PolylinePath([Corner(0.0, 0.0, time=0.0), Corner(10.0, 0.0, time=1.0), Corner(40.0, 0.0, time=2.0)])
    assert [path.s_at(t) for t in (-1.0, 0.5, 1.5, 2.0, 9.0)] == pytest.approx([0.0, 5.0, 25.0, 40.0, 40.0])
    assert path.time_at(25.0) == pytest.approx(1.5)


def test_follow_mode_accelerates_evenly_to_be_in_time() -> None:
    """From 10 m/s, 30 m in 2 s: a = 2 (30 - 20) / 4 = 5 m/s2, 20 m/s at the end, 12.5 m after 1 s."""
    path = PolylinePath([Corner(0.0, 0.0, time=0.0), Corner(30.0, 0.0, time=2.0)], follow=True, initial_speed=10.0)
    assert path.s_at(1.0) == pytest.approx(12.5)
    assert path.speed_at(0.0) == pytest.approx(10.0)
    assert path.s_at(2.0) == pytest.approx(30.0)


def test_follow_mode_stops_instead_of_going_back() -> None:
    """From 20 m/s, 10 m in 4 s: braking to a stop within 10 m takes 1 s; there it waits."""
    path = PolylinePath([Corner(0.0, 0.0, time=0.0), Corner(10.0, 0.0, time=4.0)], follow=True, initial_speed=20.0)
    assert path.s_at(1.0) == pytest.approx(10.0)
    assert path.s_at(3.0) == pytest.approx(10.0)
    assert np.diff([path.s_at(t) for t in np.linspace(0.0, 4.0, 81)]).min() >= 0.0


def test_missing_times_are_spread_evenly_over_the_way() -> None:
    corners = [Corner(0.0, 0.0, time=1.0), Corner(30.0, 0.0), Corner(40.0, 0.0, time=5.0)]
    assert has_gaps_in_time(corners)
    assert [corner.time for corner in fill_times(corners)] == pytest.approx([1.0, 4.0, 5.0])
    assert not has_gaps_in_time(fill_times(corners))
    assert not has_gaps_in_time([Corner(0.0, 0.0), Corner(1.0, 0.0)])  # no times at all


def test_corners_that_are_hardly_apart_are_merged_but_a_stop_stays() -> None:
    driven = [Corner(float(x), 0.0, time=t) for x, t in ((0.0, 0.0), (0.05, 0.1), (5.0, 1.0), (5.05, 1.1), (10.0, 2.0))]
    assert [corner.x for corner in merge_close(driven, 0.1)] == [0.0, 5.0, 10.0]
    stopped = [
        Corner(0.0, 0.0, time=0.0),
        Corner(5.0, 0.0, time=1.0),
        Corner(5.02, 0.0, time=9.0),
        Corner(9.0, 0.0, time=10.0),
    ]
    kept = merge_close(stopped, 0.1)
    assert [corner.time for corner in kept][-1] == 10.0
    assert max(corner.time for corner in kept if corner.x < 6.0) == 9.0


@given(finite, finite)
def test_the_nearest_place_of_a_path_is_the_foot_of_the_perpendicular(x: float, y: float) -> None:
    path = PolylinePath([Corner(-20.0, 0.0), Corner(20.0, 0.0)])
    assert nearest_s(path, x, y) == pytest.approx(min(max(x + 20.0, 0.0), 40.0), abs=1e-4)


def test_headings_that_are_given_hold_at_their_corners() -> None:
    path = PolylinePath(
        [Corner(0.0, 0.0, heading=0.1), Corner(50.0, 0.0, heading=0.3), Corner(100.0, 0.0, heading=nan)]
    )
    assert path.at(0.0).heading == pytest.approx(0.1)
    assert path.at(0.0).is_headed
    assert path.at(25.0).heading == pytest.approx(0.1)  # position mode: that of the vertex at the piece's start
    turning = PolylinePath([Corner(0.0, 0.0, heading=0.1), Corner(50.0, 0.0, heading=0.3)], follow=True)
    assert turning.at(25.0).heading == pytest.approx(0.2)
