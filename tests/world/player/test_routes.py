"""A route as a guide: where one is after some way of it, and which way it takes at junctions."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.world.player.state import NO_ROAD, Placement, RouteGuide, guide
from xosc_lateral.world.road.positions import LaneLink, RouteStep

STEPS = (RouteStep(0, 1, 20.0, 100.0), RouteStep(7, -1, 50.0, 0.0), RouteStep(3, 1, 0.0, 30.0))
"""80 m along road 0, 50 m against road 7, 30 m along road 3."""


def network(**onward: list[int]) -> Any:
    """`onward`: roads that the lanes of road `rN` lead on to."""
    return SimpleNamespace(next_lanes=lambda road, lane, way: [link(other) for other in onward.get(f"r{road}", [])])


def link(road: int) -> LaneLink:
    return LaneLink(road, -1, 0.0, 1)


@pytest.mark.parametrize(
    ("way", "place"),
    [
        (0.0, (0, 20.0, 1)),
        (30.0, (0, 50.0, 1)),
        (80.0, (0, 100.0, 1)),
        (90.0, (7, 40.0, -1)),
        (130.0, (7, 0.0, -1)),
        (145.0, (3, 15.0, 1)),
        (160.0, (3, 30.0, 1)),
        (999.0, (3, 30.0, 1)),
        (-5.0, (0, 20.0, 1)),
    ],
)
def test_so_far_along_the_route_one_is_there(way: float, place: tuple[int, float, int]) -> None:
    assert RouteGuide(network(), STEPS).at(way) == place


@given(st.floats(0.0, 160.0), st.floats(0.0, 160.0))
def test_the_way_between_two_places_is_the_way_that_was_gone(first: float, second: float) -> None:
    def gone(way: float) -> float:
        road, s, _ = RouteGuide(network(), STEPS).at(way)
        return {0: s - 20.0, 7: 80.0 + 50.0 - s, 3: 130.0 + s}[road]

    assert gone(second) - gone(first) == pytest.approx(second - first, abs=1e-9)


def test_at_a_junction_the_road_that_comes_next_is_taken() -> None:
    found = RouteGuide(network(), STEPS).choose(0, [link(5), link(7), link(9)])
    assert found is not None
    assert found.road == 7


def test_another_connecting_road_will_do_if_it_leads_to_the_road_after() -> None:
    options = [link(5), link(6)]
    found = RouteGuide(network(r5=[8], r6=[3]), STEPS).choose(0, options)
    assert found is not None
    assert found.road == 6


def test_where_the_route_says_nothing_nothing_is_chosen() -> None:
    made = RouteGuide(network(), STEPS)
    assert made.choose(99, [link(7)]) is None  # on no road of it
    assert made.choose(3, [link(7)]) is None  # at its end
    assert made.choose(0, [link(5)]) is None


def test_a_road_that_it_takes_twice_is_looked_at_from_both_times() -> None:
    twice = (STEPS[0], STEPS[1], RouteStep(0, 1, 0.0, 100.0), STEPS[2])
    made = RouteGuide(network(), twice)
    first, second = made.choose(0, [link(7)]), made.choose(0, [link(3)])
    assert first is not None
    assert second is not None
    assert (first.road, second.road) == (7, 3)


@pytest.mark.parametrize("stops", [[], [0], [0, NO_ROAD]], ids=["none", "one", "one on no road"])
def test_too_few_places_are_no_route(stops: list[int]) -> None:
    assert guide(network(), [Placement(road, -1, 5.0, 0.0, 0.0) for road in stops]) is None


def test_stops_are_asked_for_in_order_with_the_way_each_one_faces() -> None:
    asked: dict[str, Any] = {}

    def route(start: Any, end: Any, *, via: Any, ways: Any) -> tuple[RouteStep, ...]:
        asked.update(start=start, end=end, via=via, ways=ways)
        return STEPS

    stops = [Placement(road, -1, 10.0 * road, 0.0, heading) for road, heading in ((1, 0.0), (2, 3.0), (3, 0.1))]
    found = guide(SimpleNamespace(route=route), stops)  # type: ignore[arg-type]
    assert found is not None
    assert found.steps == STEPS
    assert asked == {"start": (1, -1, 10.0), "end": (3, -1, 30.0), "via": [(2, -1, 20.0)], "ways": [1, -1, 1]}
