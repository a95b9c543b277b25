"""What drivers see at one moment is what a conversion sees there: the same gaps, sides and ways of giving way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import drive, entity, entity_context, together, two_roads
from xosc_lateral.extras.live.moment import OpenDriveRoads, Places, give_way_now, look_around
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.surroundings.give_way import Response, SampledVehicle, give_way


def traffic(network, seed: int, n: int = 24, **changes) -> NominalMotion:
    """Cars and trucks in both directions, two of them bumper to bumper, over the border of two roads."""
    rng = np.random.default_rng(seed)
    kinds = [VehicleCategory.TRUCK if rng.random() < 0.3 else VehicleCategory.CAR for _ in range(n)]
    vehicles = [entity(f"v{k}", kind, float(rng.uniform(3.5, 16.0))) for k, kind in enumerate(kinds)]
    lanes = rng.choice([-3, -2, -1, 1, 2, 3], n)
    starts = rng.uniform(150.0, 850.0, n)
    return together(*(
        drive(network, one, lane=int(lane), start=float(start), duration=0.1, **changes)
        for one, lane, start in zip(vehicles, lanes, starts, strict=True)
    ))  # fmt: skip


def places_of(motion: NominalMotion, row: int) -> Places:
    columns = (
        np.array([getattr(one, name)[row] for one in motion.entities])
        for name in ("x", "y", "heading", "road", "lane", "s")
    )
    boxes = [one.entity.bounding_box for one in motion.entities]
    size = (np.array([getattr(box, name) for box in boxes]) for name in ("length", "width", "center_x"))
    return Places(*columns, *size)


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_everybody_sees_what_he_sees_in_a_conversion(tmp_path: Path, rule: str, seed: int) -> None:
    network = two_roads(tmp_path, rule=rule)
    motion = traffic(network, seed, offset=float(seed) / 4.0)
    offset = np.array([one.offset[2] for one in motion.entities])
    trucks = np.array([one.entity.vehicle_category is VehicleCategory.TRUCK for one in motion.entities])
    found = look_around(OpenDriveRoads(network), places_of(motion, 2), offset, trucks)
    for index in range(len(motion.entities)):
        wanted = entity_context(motion, network, index, np.array([2]))
        assert set(found) >= set(wanted) - {"speed", "acceleration", "is_truck"}
        for name in found.keys() & wanted.keys():
            values = found[name]
            near = 5e-3 if name == "curvature" else 1e-9  # of the lane's centre line, there of the nominal path
            np.testing.assert_allclose(values[index], wanted[name][0], rtol=near, atol=1e-9, err_msg=f"{name} {index}")


def test_nobody_and_vehicles_off_the_road_have_no_surroundings(tmp_path: Path) -> None:
    roads = OpenDriveRoads(two_roads(tmp_path))
    none = np.empty(0)
    ids = np.empty(0, dtype=np.int64)
    found = look_around(
        roads, Places(none, none, none, ids, ids, none, none, none, none), none, np.empty(0, dtype=bool)
    )
    assert {"curvature", "left_distance", "lead_is_truck"} <= found.keys()
    places = places_of(traffic(roads.network, 1, n=3), 0)
    off = Places(places.x, places.y, places.heading, np.array([0, -1, 0]), places.lane, *(
        getattr(places, name) for name in ("s", "length", "width", "center_x")
    ))  # fmt: skip
    found = look_around(roads, off, np.zeros(3), np.zeros(3, dtype=bool))
    assert np.isnan(found["curvature"][1]) and np.isnan(found["left_distance"][1])
    assert np.isfinite(found["curvature"][[0, 2]]).all()
    cars = [
        drive(roads.network, entity(f"v{k}"), lane=-1, start=at, duration=0.1) for k, at in enumerate((0.0, 20.0, 60.0))
    ]
    row = places_of(together(*cars), 0)
    away = replace(row, road=np.array([0, -1, 0]))
    ahead = look_around(roads, away, np.zeros(3), np.zeros(3, dtype=bool))["lead_distance"]
    assert ahead[0] == pytest.approx(60.0 - 5.0) and not np.isfinite(ahead[1:]).any()
    assert look_around(roads, row, np.zeros(3), np.zeros(3, dtype=bool))["lead_distance"][1] == pytest.approx(35.0)


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_neighbours_give_way_as_in_a_conversion(tmp_path: Path, rule: str) -> None:
    network = two_roads(tmp_path, rule=rule)
    rng = np.random.default_rng(5)
    motion = traffic(network, 4, n=50, speed=0.0)
    offset = rng.normal(0.0, 0.4, len(motion.entities))
    sides = [frozenset(rng.choice(["left", "right"], rng.integers(0, 3)).tolist()) for _ in offset]
    alone = [frozenset(rng.choice(["left", "right"], rng.integers(0, 2)).tolist()) for _ in offset]
    free = rng.random(len(offset)) < 0.8
    rows = len(motion.entities[0].time)
    sampled = [
        SampledVehicle(one, np.full(rows, by), np.full(rows, can), responds, known)
        for one, by, can, responds, known in zip(motion.entities, offset, free, sides, alone, strict=True)
    ]
    wanted = [0.0 if one is None else one[0] for one in give_way(motion, network, sampled, np.arange(rows))]
    nominal = places_of(motion, 0)
    sin, cos = np.sin(nominal.heading), np.cos(nominal.heading)
    x, y = nominal.x - offset * sin, nominal.y + offset * cos
    places = Places(x, y, *(getattr(nominal, name) for name in Places.__dataclass_fields__ if name not in ("x", "y")))
    known = Response(*(
        np.array([side in one for one in ones]) for ones in (sides, alone) for side in ("left", "right")
    ))  # fmt: skip
    found = give_way_now(places, offset, offset, free, known, left_hand=rule == "LHT")
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    assert (np.abs(found) > 0.01).sum() > 3
