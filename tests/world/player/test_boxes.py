"""Boxes, gaps between them, and values that conditions compare: hand-computed, and against sampling."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from xosc_lateral.world.motion.gaps import box_distance
from xosc_lateral.world.player.actions.speed_profile import limits_of
from xosc_lateral.world.player.distances import (
    HEIGHT_APART,
    box_gaps,
    corners,
    distance_between,
    holds_point,
    overlap,
)
from xosc_lateral.world.player.simulation import TrafficSignals, Values, holds
from xosc_lateral.world.road.positions import Pose
from xosc_lateral.world.scenario.entity import BoundingBox, Performance
from xosc_lateral.world.scenario.enums import ParameterType, Rule
from xosc_lateral.world.scenario.global_actions import ModifyOperation
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.private_actions import DynamicConstraints
from xosc_lateral.world.scenario.scenario import Parameter, TrafficSignalController, TrafficSignalPhase

HERE = Place(Path("x.xosc"), 1, "X")


def car(x: float = 0.0, y: float = 0.0, heading: float = 0.0, *, z: float = 0.0, centre: float = 1.4) -> Any:
    """4 m by 2 m; its reference point is the rear axle."""
    pose = Pose(x, y, z, heading, 0.0, 0.0)
    box = BoundingBox(centre, 0.0, 0.8, 4.0, 2.0, 1.6)
    return SimpleNamespace(entity=SimpleNamespace(bounding_box=box), plane=pose, pose=pose)


# ---- boxes -----------------------------------------------------------------------------------------------------------
def test_corners_go_round_from_front_left() -> None:
    expected = ((3.4, 1.0), (-0.6, 1.0), (-0.6, -1.0), (3.4, -1.0))
    assert np.array(corners(car())) == pytest.approx(np.array(expected))
    turned = corners(car(10.0, 5.0, pi / 2.0))
    assert np.array(turned) == pytest.approx(np.array(((9.0, 8.4), (9.0, 4.4), (11.0, 4.4), (11.0, 8.4))))


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-4, 4), st.floats(-4, 4), st.sampled_from([1.4, -7.0]))
@example(17.0, 0.0, pi, 0.0, -7.0).via("two semitrailers by their kingpins, rear to rear: they reach 9 m each")
def test_boxes_overlap_when_their_exact_distance_is_nothing(
    x: float, y: float, own: float, its: float, centre: float
) -> None:
    """About rear axles, and about a point that lies outside of the box."""
    a, b = car(heading=own, centre=centre), car(x, y, its, centre=centre)
    apart = float(box_distance(np.array([corners(a)]), np.array([corners(b)]))[0])
    if apart == 0.0 or apart > 1e-3:  # in between, the player's tolerance decides
        assert overlap(a, b) is (apart == 0.0)
    if apart > 1e-3:
        assert distance_between(corners(a), corners(b)) == pytest.approx(apart, abs=1e-9)


def test_boxes_on_different_levels_do_not_touch() -> None:
    assert overlap(car(), car(1.0))
    assert not overlap(car(), car(1.0, z=HEIGHT_APART + 0.1))


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (10.0, 0.0, (6.0, 0.0)),
        (-10.0, 0.0, (-6.0, 0.0)),
        (0.0, 3.5, (0.0, 1.5)),
        (10.0, -3.5, (6.0, -1.5)),
        (3.0, 1.0, (0.0, 0.0)),
    ],
)
def test_gaps_are_positive_ahead_and_to_the_left(x: float, y: float, expected: tuple[float, float]) -> None:
    assert box_gaps(corners(car()), corners(car(x, y)), 0.0) == pytest.approx(expected)


def test_gaps_turn_with_the_entity_that_asks() -> None:
    """Heading north: what is north of it is ahead, what is west of it on the left."""
    own = car(heading=pi / 2.0, centre=0.0)
    assert box_gaps(corners(own), corners(car(0.0, 10.0, pi / 2.0, centre=0.0)), -pi / 2.0) == pytest.approx((6.0, 0.0))
    assert box_gaps(corners(own), corners(car(-5.0, 0.0, pi / 2.0, centre=0.0)), -pi / 2.0) == pytest.approx((0.0, 3.0))


def test_gaps_in_a_turned_frame() -> None:
    square = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
    there = tuple((x + 5.0, y + 5.0) for x, y in square)
    assert box_gaps(square, there, 0.0) == pytest.approx((3.0, 3.0))
    along, across = box_gaps(square, there, -pi / 4.0)  # along the diagonal between them
    assert along == pytest.approx(hypot(5.0, 5.0) - 2.0 * hypot(1.0, 1.0))
    assert across == 0.0


def test_a_point_s_distance_to_a_box_is_that_to_its_nearest_edge_or_corner() -> None:
    box = corners(car(centre=0.0))
    assert distance_between(((5.0, 0.5),), box) == pytest.approx(3.0)
    assert distance_between(((5.0, 5.0),), box) == pytest.approx(5.0)  # 3 ahead, 4 aside
    assert distance_between(box, ((0.0, -3.0),)) == pytest.approx(2.0)


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))
def test_a_box_holds_what_lies_within_it_in_its_own_frame(x: float, y: float, heading: float) -> None:
    box = corners(car(1.0, -1.0, heading))
    c, s = cos(heading), sin(heading)
    point = (1.0 + x * c - y * s, -1.0 + x * s + y * c)
    if min(abs(x - 3.4), abs(x + 0.6), abs(abs(y) - 1.0)) > 1e-6:
        assert holds_point(box, point) is (-0.6 < x < 3.4 and abs(y) < 1.0)


# ---- limits ----------------------------------------------------------------------------------------------------------
def test_limits_are_the_tighter_of_action_and_vehicle() -> None:
    performance = Performance(50.0, 4.0, 9.0, 10.0, 20.0)
    assert limits_of(None, performance).max_speed == 50.0
    assert limits_of(None, performance).max_acceleration == inf  # an action without constraints has none at all
    own = limits_of(DynamicConstraints(max_acceleration=2.0, max_deceleration=12.0), performance)
    assert own == Performance(50.0, 2.0, 9.0, 10.0, 20.0)


# ---- comparisons and values ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("rule", "below", "same", "above"),
    [
        (Rule.GREATER_THAN, False, False, True),
        (Rule.GREATER_OR_EQUAL, False, True, True),
        (Rule.LESS_THAN, True, False, False),
        (Rule.LESS_OR_EQUAL, True, True, False),
        (Rule.EQUAL_TO, False, True, False),
        (Rule.NOT_EQUAL_TO, True, False, True),
    ],
)
def test_rules_hold_as_they_say_and_hardly_apart_is_equal(rule: Rule, below: bool, same: bool, above: bool) -> None:
    assert [holds(value, rule, 10.0) for value in (9.0, 10.0, 11.0)] == [below, same, above]
    assert [holds(value, rule, 10.0) for value in (10.0 - 1e-9, 10.0 + 1e-9)] == [same, same]
    assert [rule.holds(value, 10) for value in (9, 10, 11)] == [below, same, above]
    assert holds(inf, rule, inf) is same


def declared(**values: tuple[ParameterType, str]) -> Values:
    return Values("parameter", {name: Parameter(name, kind, text, HERE) for name, (kind, text) in values.items()})


def test_values_are_read_as_their_types() -> None:
    values = declared(
        d=(ParameterType.DOUBLE, "1.5"),
        i=(ParameterType.INT, "7.0"),
        b=(ParameterType.BOOLEAN, "1"),
        s=(ParameterType.STRING, "1.5"),
    )
    assert [values[name] for name in "dibs"] == [1.5, 7, True, "1.5"]
    assert "q" not in values


def test_values_are_modified_as_numbers_and_stay_whole_where_they_were() -> None:
    values = declared(d=(ParameterType.DOUBLE, "1.5"), i=(ParameterType.INT, "7"), s=(ParameterType.STRING, "a"))
    assert values.modify("d", ModifyOperation.MULTIPLY, -2.0)
    assert values.modify("i", ModifyOperation.ADD, 0.6)
    assert (values["d"], values["i"]) == (-3.0, 7)
    assert not values.modify("s", ModifyOperation.ADD, 1.0)
    assert values["s"] == "a"


def test_values_compare_in_their_own_type() -> None:
    values = declared(i=(ParameterType.INT, "10"), s=(ParameterType.STRING, "10"), b=(ParameterType.BOOLEAN, "true"))
    assert values.compare("i", Rule.GREATER_THAN, "9")
    assert not values.compare("s", Rule.GREATER_THAN, "9")  # texts: "1" comes before "9"
    assert values.compare("b", Rule.EQUAL_TO, "1")


def test_what_is_not_of_its_type_is_compared_as_text() -> None:
    values = declared(i=(ParameterType.INT, "many"))
    assert values["i"] == "many"
    assert values.compare("i", Rule.NOT_EQUAL_TO, "7")


# ---- traffic signals -------------------------------------------------------------------------------------------------
def controller(name: str, delay: float = 0.0, reference: str | None = None) -> TrafficSignalController:
    red, green = (TrafficSignalPhase(colour, 10.0, (("lamp", colour),)) for colour in ("red", "green"))
    return TrafficSignalController(name, delay, reference, (red, green), HERE)


def test_phases_follow_each_other_for_ever() -> None:
    signals = TrafficSignals([controller("A")])
    assert [signals.phase("A", t) for t in (0.0, 9.9, 10.0, 19.9, 20.0, 1e6 + 5.0)] == [
        "red",
        "red",
        "green",
        "green",
        "red",
        "red",
    ]
    assert signals.state("lamp", 15.0) == "green"
    assert signals.state("other", 15.0) is None
    assert signals.phase("B", 0.0) is None


def test_delays_of_controllers_that_refer_to_each_other_add_up() -> None:
    signals = TrafficSignals([controller("A", 3.0), controller("B", 4.0, "A")])
    assert signals.phase("B", 6.9) is None
    assert signals.phase("B", 7.0) == "red"
    assert signals.phase("B", 17.0) == "green"


def test_controllers_that_refer_to_each_other_in_a_circle_still_start() -> None:
    signals = TrafficSignals([controller("A", 1.0, "B"), controller("B", 2.0, "A")])
    assert signals.phase("A", 3.0) == "red"


def test_a_state_that_is_set_holds_until_the_next_phase() -> None:
    signals = TrafficSignals([controller("A")])
    signals.set_state("lamp", "off", 5.0)
    assert [signals.state("lamp", t) for t in (5.0, 9.0, 10.5)] == ["off", "off", "green"]


def test_a_controller_can_be_sent_to_a_phase() -> None:
    signals = TrafficSignals([controller("A")])
    assert signals.go_to_phase("A", "green", 2.0)
    assert [signals.phase("A", t) for t in (2.0, 11.9, 12.0)] == ["green", "green", "red"]
    assert not signals.go_to_phase("A", "blue", 3.0)
    assert not signals.go_to_phase("B", "green", 3.0)
