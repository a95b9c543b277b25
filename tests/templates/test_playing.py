"""Templates played: what their summary promises happens, nobody collides, nobody runs out of road."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.enrich.enrich import enrich
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.pipeline.load import Played, play_scenario
from xosc_lateral.pipeline.segments import scenario_segments
from xosc_lateral.templates import TEMPLATES, find_template


@pytest.fixture
def played(tmp_path):
    def play(name: str, **chosen: str) -> Played:
        for file, text in find_template(name).files(chosen).items():
            (tmp_path / file).write_text(text)
        return play_scenario(tmp_path / f"{name}.xosc")

    return play


def lanes(played: Played, name: str) -> list[int]:
    """Lanes of an entity in the order in which it drives on them."""
    entity = next(each for each in played.motion.entities if each.name == name)
    return entity.lane[np.flatnonzero(np.diff(entity.lane, prepend=0))].tolist()


def speed_range(played: Played, name: str) -> tuple[float, float]:
    entity = next(each for each in played.motion.entities if each.name == name)
    return float(entity.speed.min()), float(entity.speed.max())


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", [template.name for template in TEMPLATES])
def test_it_plays_as_written_to_its_end_without_a_collision_and_with_road_to_follow(name, side, played):
    found = played(name, traffic=side)
    assert found.motion.ended_by == "stop trigger"
    assert found.motion.notes == ()
    gaps = enrich(found.motion, found.network, {}, seed=0).gaps_before
    assert min(gap.distance for gap in gaps) > 1.0
    for entity in found.motion.entities:
        assert not np.any(entity.activity & (Activity.ROAD_END | Activity.OFF_ROAD))
    longest = max(row.end - row.start for row in scenario_segments(found) if row.road_following)
    assert longest > 20.0


@pytest.mark.parametrize(("side", "sign"), [("right", -1), ("left", 1)])
def test_the_maneuvers_happen_on_either_side_of_the_road(side, sign, played):
    assert lanes(played("cut-in", traffic=side), "CutIn") == [sign * 1, sign * 2]
    assert lanes(played("overtake-truck", traffic=side), "Ego") == [sign * 2, sign * 1, sign * 2]
    dense = played("dense-traffic", traffic=side)
    assert len(dense.motion.entities) == 10
    assert lanes(dense, "FastFirst") == [sign * 1, sign * 2]
    assert lanes(dense, "SlowThird") == [sign * 3, sign * 2]


def test_speeds_are_those_that_were_set(played):
    braking = played("braking-leader", slow_speed="18", speed="30")
    for name in ("Ego", "Leader"):
        assert speed_range(braking, name) == pytest.approx((18.0, 30.0))
    assert speed_range(played("jam-end"), "Ego") == pytest.approx((0.0, 31.0))
    assert speed_range(played("cut-in", slow_speed="26"), "CutIn") == pytest.approx((26.0, 35.0))


def test_the_ego_vehicle_stops_behind_the_jam_with_the_gap_that_was_set(played):
    found = played("jam-end", jam_gap="12")
    gaps = {gap.names: gap.distance for gap in enrich(found.motion, found.network, {}, seed=0).gaps_before}
    assert gaps[("Ego", "Jam00")] == pytest.approx(12.0, abs=2 * 31.0 * found.motion.step)  # braking begins on a step
