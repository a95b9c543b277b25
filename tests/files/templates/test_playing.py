"""Templates played: what their summary promises happens, nobody collides, nobody runs out of road."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.files.templates import TEMPLATES, find_template
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.workflows.playing.call import scenario_segments
from xosc_lateral.world.motion.nominal import Activity


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
    gaps = enrich(SegmentedRun(found.motion, found.network), {}, seed=0).gaps_before
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
    gaps = {
        gap.names: gap.distance for gap in enrich(SegmentedRun(found.motion, found.network), {}, seed=0).gaps_before
    }
    assert gaps[("Ego", "Jam00")] == pytest.approx(12.0, abs=2 * 31.0 * found.motion.step)  # braking begins on a step


@pytest.mark.parametrize(("distance", "played_out"), [("1100", True), ("1000", False)])
def test_a_jam_that_nobody_could_stop_before_is_refused(distance, played_out, played):
    """From 45 m/s at 1 m/s2: 1012 m, and the gap behind the last vehicle."""
    settings = {"speed": "45", "deceleration": "1", "jam_distance": distance, "duration": "80"}
    if not played_out:
        with pytest.raises(XoscLateralError, match="jam_distance: 1000 has to be more than the 1026 m that braking"):
            played("jam-end", **settings)
        return
    found = played("jam-end", **settings)
    gaps = {
        gap.names: gap.distance for gap in enrich(SegmentedRun(found.motion, found.network), {}, seed=0).gaps_before
    }
    assert gaps[("Ego", "Jam00")] == pytest.approx(8.0, abs=2 * 45.0 * found.motion.step)


# ---- settings mean what their description says ---------------------------------------------------------------------
def moment(played: Played, event: str) -> tuple[float, float]:
    """When the action of an event began and ended. [s]"""
    (found,) = [one for one in played.motion.actions if event in one.path]
    assert found.end is not None
    return found.start, found.end


def entity_at(played: Played, name: str, time: float) -> tuple[float, float]:
    """Place along the road [m] and speed [m/s] of an entity."""
    one = next(each for each in played.motion.entities if each.name == name)
    row = int(np.argmin(np.abs(one.time - time)))
    return float(one.s[row]), float(one.speed[row])


def headway_at(played: Played, follower: str, leader: str, time: float) -> float:
    (behind, speed), (ahead, _) = (entity_at(played, name, time) for name in (follower, leader))
    return (ahead - behind) / speed


def test_a_car_cuts_in_at_the_headway_and_for_as_long_as_was_set(played):
    found = played("cut-in", headway="0.9", lane_change_time="3.5", deceleration="4", passing_speed="36")
    start, end = moment(found, "CutInEvent")
    step = (36.0 - 30.0) * found.motion.step / 30.0  # by which a headway grows in a frame
    assert headway_at(found, "Ego", "CutIn", start) == pytest.approx(0.9, abs=2 * step)
    assert end - start == pytest.approx(3.5, abs=2 * found.motion.step)
    braking, slow = moment(found, "SlowDownEvent")
    assert braking == pytest.approx(end + 1.0, abs=3 * found.motion.step)
    assert (36.0 - 29.0) / (slow - braking) == pytest.approx(4.0, rel=0.02)


def test_a_leader_brakes_when_and_as_hard_as_was_set_and_the_ego_vehicle_reacts(played):
    found = played("braking-leader", brake_time="8", slow_speed="15", speed="30", deceleration="5", reaction_time="1.2")
    start, end = moment(found, "LeaderBrakes")
    assert start == pytest.approx(8.0, abs=2 * found.motion.step)
    assert end - start == pytest.approx((30.0 - 15.0) / 5.0, abs=2 * found.motion.step)
    assert moment(found, "EgoBrakes")[0] - start == pytest.approx(1.2, abs=2 * found.motion.step)
    recovers, _ = moment(found, "LeaderRecovers")
    assert recovers - end == pytest.approx(8.0, abs=2 * found.motion.step)
    assert moment(found, "EgoRecovers")[0] - recovers == pytest.approx(1.2, abs=2 * found.motion.step)
    # equal braking, later by the reaction: the gap shrinks by speed lost times reaction, and no more
    gap = [entity_at(found, "Leader", t)[0] - entity_at(found, "Ego", t)[0] for t in (0.0, recovers - 0.1)]
    assert gap[0] - gap[1] == pytest.approx(15.0 * 1.2, abs=0.5)


def test_a_truck_is_overtaken_at_the_headways_that_were_set(played):
    found = played("overtake-truck", headway_before="2.0", headway_after="1.5", lane_change_time="5")
    out, back = moment(found, "PullOut"), moment(found, "PullIn")
    assert headway_at(found, "Ego", "Truck", out[0]) == pytest.approx(2.0, abs=0.02)
    assert headway_at(found, "Truck", "Ego", back[0]) == pytest.approx(1.5, abs=0.02)
    assert [end - start for start, end in (out, back)] == pytest.approx([5.0, 5.0], abs=2 * found.motion.step)


def test_bends_lead_where_and_as_steeply_as_was_set(played):
    found = played("curves", radius="600", grade="4", duration="20", speed="25")
    network, ego = found.network, next(one for one in found.motion.entities if one.name == "Ego")
    curvature = network.curvature(0, np.arange(0.0, network.roads[0].length))
    assert curvature.max() == pytest.approx(1.0 / 600.0) and curvature.min() == pytest.approx(-1.0 / 600.0)
    assert curvature[np.flatnonzero(curvature)[0]] > 0.0, "the first bend is to the left"
    climbed = (ego.z[-1] - ego.z[0]) / (ego.s[-1] - ego.s[0])
    assert climbed == pytest.approx(0.04, abs=0.004)  # the lane's crossfall adds some centimetres
    assert ego.time[-1] == pytest.approx(20.0, abs=found.motion.step)
