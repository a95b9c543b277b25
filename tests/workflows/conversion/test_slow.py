"""Below 40 km/h: the process runs on its own clock, stands with the car, and its place and spread stay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import STEP, drive, entity, together, two_roads
from xosc_lateral.base.segment import LARGEST_HEADING
from xosc_lateral.files.profiles import find_profile, read_profile
from xosc_lateral.files.templates import find_template
from xosc_lateral.workflows.conversion.convert import convert
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.result import Enriched, Neighbours
from xosc_lateral.world.road.network import RoadNetwork

CARS = 60


def enriched(network: RoadNetwork, speed: np.ndarray, *, seed: int = 1, cars: int = CARS) -> Enriched:
    """Many cars that drive alike, each alone: nobody gives way."""
    profile, duration = read_profile(find_profile("motorway")), STEP * (len(speed) - 1)
    motion = together(*(drive(network, entity(f"c{k}"), speed=speed, duration=duration) for k in range(cars)))
    run = SegmentedRun(motion, network, neighbours=Neighbours.NONE)
    return enrich(run, {f"c{k}": profile for k in range(cars)}, seed=seed)


def turned(result: Enriched) -> np.ndarray:
    """Headings relative to the nominal, shape (cars, n). [rad]"""
    apart = np.array([one.trajectory.heading - one.motion.heading for one in result.entities])
    return np.abs((apart + np.pi) % (2.0 * np.pi) - np.pi)


def stop_and_go() -> np.ndarray:
    """12 m/s, to rest within 8 s, 10 s there, and off again."""
    parts = [
        np.full(500, 12.0),
        np.linspace(12.0, 0.0, 400),
        np.zeros(500),
        np.linspace(0.0, 12.0, 400),
        np.full(501, 12.0),
    ]
    return np.concatenate(parts)


def test_a_car_stops_where_its_driver_is_and_nobody_slides(tmp_path: Path) -> None:
    speed = stop_and_go()
    result = enriched(two_roads(tmp_path), speed)
    deviation = np.array([one.deviation for one in result.entities])
    stands = (speed[1:] == 0.0) & (speed[:-1] == 0.0)
    assert (np.diff(deviation, axis=1)[:, stands] == 0.0).all()
    assert 0.15 < deviation[:, 1000].std() < 0.30
    assert deviation[:, 1000].std() == pytest.approx(deviation[:, 300].std(), rel=0.3)
    assert turned(result).max() <= LARGEST_HEADING
    assert all(one.segments[0].span.last == len(speed) - 1 for one in result.entities)  # one segment, not three
    steps = np.abs(np.diff(deviation, axis=1)).max()
    assert steps < 0.012  # 0.6 m/s: no jump anywhere, not at 40 km/h either


def test_a_car_that_never_moves_stands_beside_the_middle_too(tmp_path: Path) -> None:
    result = enriched(two_roads(tmp_path), np.zeros(501))
    deviation = np.array([one.deviation for one in result.entities])
    assert (np.diff(deviation, axis=1) == 0.0).all()
    assert 0.15 < deviation[:, 0].std() < 0.30


@pytest.mark.parametrize(("speed", "measured"), [(2.5, 0.57), (4.0, 0.69), (6.0, 0.83)])
def test_slow_lateral_speed_is_that_of_the_class_of_speeds(tmp_path: Path, speed: float, measured: float) -> None:
    """Over 2 s, as the recording of a junction was measured."""
    network, rows = two_roads(tmp_path), round(2.0 / STEP)

    def lateral(pace: float) -> float:
        deviation = np.array([one.deviation for one in enriched(network, np.full(1501, pace)).entities])
        return float(np.sqrt(np.mean((deviation[:, rows:] - deviation[:, :-rows]) ** 2)))

    assert lateral(speed) / lateral(11.2) == pytest.approx(measured, abs=0.05)


def test_at_40_km_h_and_above_the_clock_changes_nothing(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    fast, equal = (enriched(network, np.full(501, pace), cars=2) for pace in (40 / 3.6, 11.1111))
    np.testing.assert_allclose(fast.entities[1].segments[0].offset, equal.entities[1].segments[0].offset, atol=1e-6)


@pytest.mark.parametrize("neighbours", ["none", "profile"])
def test_a_jam_corridor_is_left_where_it_is_asked_for_and_said_to_be_assumed(tmp_path: Path, neighbours: str) -> None:
    for file, text in find_template("jam-end").files({}).items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    plain, aside = (
        convert(
            tmp_path / "jam-end.xosc",
            seed=1,
            ego=["none"],
            mode="trajectory",
            jam_corridor=asked,
            neighbours=neighbours,
        )
        for asked in (False, True)
    )
    moved = [
        (one.deviation[-1] - other.deviation[-1], one.motion.lane[-1])
        for one, other in zip(aside.movement.entities, plain.movement.entities, strict=True)
        if one.name.startswith("Jam")
    ]
    leftmost = max(lane for _, lane in moved)
    for by, lane in moved:
        # Who overtakes keeps left of others anyway, and needs less of that where they keep right.
        least = 0.1 if lane == leftmost and neighbours == "profile" else 0.399
        assert least < by * (1.0 if lane == leftmost else -1.0) < 0.401
    assert any("jam corridor: assumed" in line for line in aside.warnings)
    assert not any("jam corridor" in line for line in plain.warnings)
    assert aside.provenance.options["jam_corridor"] is True
    assert aside.provenance.profiles == plain.provenance.profiles
