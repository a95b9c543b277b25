"""Vehicles side by side, sampled jointly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tests.kit.motion import LANE_WIDTH, drive, entity, together, two_roads
from tests.kit.profiles import simulated_profile
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.world.scenario.enums import EntityCategory
from xosc_lateral.world.surroundings.give_way import (
    GAP_QUANTILES,
    OVERTAKING_SHARE,
    RESPONDING_GAPS,
    SampledVehicle,
    give_way,
)

ROWS = np.arange(0, 501, 10)


def moved(network, *vehicles):
    """What `give_way` moves vehicles of (motion, deviation) by in the middle of the drive."""
    motion = together(*(motion for motion, _ in vehicles))
    sampled = [
        SampledVehicle(one, np.full(len(ROWS), deviation), np.ones(len(ROWS), dtype=bool))
        for one, deviation in vehicles
    ]
    return [0.0 if move is None else float(move[25]) for move in give_way(motion, network, sampled, ROWS)]


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_a_narrow_gap_becomes_that_of_real_neighbours_and_the_overtaker_moves_more(tmp_path: Path, rule: str) -> None:
    network = two_roads(tmp_path, rule=rule)
    forward = (-2, -1) if network.travel_direction(0, -2) > 0 else (2, 1)  # outer lane and the one towards the middle
    outer, inner = (drive(network, entity(str(lane)), lane=lane, start=100.0) for lane in forward)
    inwards = 1.0 if rule == "RHT" else -1.0  # left of travel is towards the road's middle, or away from it
    push = moved(network, (outer, 0.6 * inwards), (inner, -0.53 * inwards))
    undisturbed = LANE_WIDTH - 1.13 - 2.0
    wanted = float(np.interp(undisturbed, *GAP_QUANTILES)) - undisturbed
    assert wanted > 0.5
    assert push[1] * inwards == pytest.approx(OVERTAKING_SHARE * wanted, rel=0.02)
    assert push[0] * inwards == pytest.approx(-(1 - OVERTAKING_SHARE) * wanted, rel=0.02)


def test_who_is_far_away_or_comes_the_other_way_changes_nobody(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    pair = [(drive(network, entity(f"{k}"), lane=k, start=100.0), 0.3 * k) for k in (-2, -1)]
    alone = moved(network, *pair)
    far = (drive(network, entity("far"), lane=-1, start=400.0), -0.8)
    oncoming = (drive(network, entity("oncoming"), lane=1, start=700.0), 0.9)
    assert moved(network, *pair, far, oncoming)[:2] == alone
    assert moved(network, far, pair[1], oncoming, pair[0])[1::2] == alone[::-1]


def test_nobody_makes_room_for_who_walks(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    car = drive(network, entity("car"), lane=-2, start=100.0)
    beside = {
        category: drive(network, structs.replace(entity(category.value), category=category), lane=-1, start=100.0)
        for category in (EntityCategory.VEHICLE, EntityCategory.PEDESTRIAN)
    }
    pushes = {kind: moved(network, (car, 0.6), (other, -0.53))[0] for kind, other in beside.items()}
    assert pushes[EntityCategory.VEHICLE] < -0.05
    assert pushes[EntityCategory.PEDESTRIAN] == 0.0


def test_whoever_can_not_move_leaves_it_to_the_other(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    right, left = (drive(network, entity(str(k)), lane=k, start=100.0) for k in (-2, -1))
    rows = len(ROWS)
    sampled = [
        SampledVehicle(right, np.full(rows, 0.5), np.zeros(rows, dtype=bool)),
        SampledVehicle(left, np.full(rows, -0.5), np.ones(rows, dtype=bool)),
    ]
    stays, moves = give_way(together(right, left), network, sampled, ROWS)
    assert stays is None and moves is not None
    undisturbed = LANE_WIDTH - 1.0 - 2.0
    assert moves[25] == pytest.approx(float(np.interp(undisturbed, *GAP_QUANTILES)) - undisturbed, rel=0.02)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("gap", [0.3, 1.5])
def test_where_a_profile_responds_to_somebody_by_itself_the_law_adds_what_that_leaves(
    tmp_path: Path, side: str, gap: float
) -> None:
    network = two_roads(tmp_path)
    apart = 0.5 * (gap - (LANE_WIDTH - 2.0))
    sampled = [
        SampledVehicle(one, np.full(len(ROWS), deviation), np.ones(len(ROWS), dtype=bool), frozenset({side}))
        for one, deviation in (
            (drive(network, entity("right"), lane=-2, start=100.0), -apart),
            (drive(network, entity("left"), lane=-1, start=100.0), apart),
        )
    ]
    right, left = give_way(together(*(one.motion for one in sampled)), network, sampled, ROWS)
    by_law, after = (
        float(np.interp(gap, known, GAP_QUANTILES[1])) - gap for known in (GAP_QUANTILES[0], RESPONDING_GAPS)
    )
    assert 0.0 < after < by_law
    assert left is not None
    if side == "left":  # who is overtaken has done its part
        assert right is None
        assert left[25] == pytest.approx(OVERTAKING_SHARE * by_law, rel=0.02)
    else:
        assert right is not None
        assert right[25] == pytest.approx(-(1 - OVERTAKING_SHARE) * by_law, rel=0.02)
        assert left[25] == pytest.approx(after, rel=0.02)


def test_a_scenario_s_neighbours_keep_apart_whatever_their_order(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    names = {"a": -2, "b": -1, "c": -3}
    cars = {name: drive(network, entity(name), lane=lane, start=100.0) for name, lane in names.items()}
    drivers = dict.fromkeys(names, simulated_profile())
    worst = []
    for seed in range(6):
        found = enrich(SegmentedRun(together(*cars.values()), network), drivers, seed=seed)
        again = enrich(SegmentedRun(together(*reversed(cars.values())), network), drivers, seed=seed)
        for one in found.entities:
            np.testing.assert_array_equal(one.deviation, again.entity(one.name).deviation)
        worst.append(min(gap.distance for gap in found.gaps_after))
    assert min(worst) > 0.4, "no gap that real neighbours don't leave"
