"""What enriched motion brings about: who leaves a lane that the nominal motion keeps, and who comes near to whom."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from tests.kit.motion import LANE_WIDTH, drive, entity, together, two_roads
from xosc_lateral.workflows.conversion.consequences import lane_departures
from xosc_lateral.workflows.conversion.result import EntityResult, SampledSegment
from xosc_lateral.world.motion.gaps import gaps_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.motion.segments import cut_segments
from xosc_lateral.world.motion.trajectory import displace
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import EntityCategory

HALF = 0.5 * LANE_WIDTH
N = 501
BUMP = np.exp(-0.5 * ((np.arange(N) * 0.02 - 6.0) / 0.8) ** 2)
"""One move aside, greatest at 6 s."""


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    return two_roads(tmp_path_factory.mktemp("roads"))


def result(network: RoadNetwork, motion: EntityMotion, deviation: np.ndarray) -> EntityResult:
    spans = cut_segments(motion, network)
    segments = tuple(
        SampledSegment(span, motion.time[[span.first, span.last]], np.zeros(2))
        for span in spans
        if span.is_road_following
    )
    return EntityResult(motion, spans, None, "", segments, deviation, displace(motion, network, deviation))


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
@pytest.mark.parametrize("lane", [-2, 2], ids=["along s", "against s"])
def test_who_leaves_the_lane_is_told_with_the_worst_moment_and_how_far(
    network: RoadNetwork, side: float, lane: int
) -> None:
    motion = drive(network, entity(), lane=lane)
    (found,) = lane_departures(result(network, motion, side * (HALF + 0.3) * BUMP), network)
    assert found.name == "car"
    assert found.time == pytest.approx(6.0)
    assert found.beyond == pytest.approx(0.3)


def test_who_stays_within_the_marking_has_left_nothing(network: RoadNetwork) -> None:
    motion = drive(network, entity())
    assert not list(lane_departures(result(network, motion, (HALF - 1e-6) * BUMP), network))


def test_nominal_and_added_offset_count_together(network: RoadNetwork) -> None:
    motion = drive(network, entity(), offset=1.0)
    assert len(list(lane_departures(result(network, motion, (HALF - 0.9) * BUMP), network))) == 1
    assert not list(lane_departures(result(network, motion, -(HALF + 0.9) * BUMP), network))


def test_what_the_scenario_does_itself_is_no_departure(network: RoadNetwork) -> None:
    """The nominal reference point is outside already."""
    motion = drive(network, entity(), offset=HALF + 0.2)
    assert not list(lane_departures(result(network, motion, 0.4 * BUMP), network))


def lateral(rows: slice) -> np.ndarray:
    activity = np.full(N, int(Activity.ACTIVE), dtype=np.uint8)
    activity[rows] |= int(Activity.LATERAL)
    return activity


def test_actions_within_a_lane_count_too(network: RoadNetwork) -> None:
    motion = drive(network, entity(), activity=lateral(slice(250, 350)))
    (found,) = lane_departures(result(network, motion, (HALF + 0.3) * BUMP), network)
    assert found.time == pytest.approx(6.0)


def test_lane_changes_cross_markings_anyway(network: RoadNetwork) -> None:
    motion = drive(network, entity(), activity=lateral(slice(100, 500)))
    lanes = motion.lane.copy()
    lanes[300:] = -1
    changing = motion.having(lane=lanes)
    assert not list(lane_departures(result(network, changing, (HALF + 0.3) * BUMP), network))


# ---- gaps ------------------------------------------------------------------------------------------------------------
def gaps(network: RoadNetwork, *motions: EntityMotion) -> dict[tuple[str, ...], float]:
    paths = [displace(motion, network, np.zeros(len(motion.time))) for motion in motions]
    return {gap.names: gap.distance for gap in gaps_of(together(*motions), paths)}


def test_the_gap_of_two_in_one_lane_is_that_of_their_boxes(network: RoadNetwork) -> None:
    behind = drive(network, entity("behind"), start=0.0, duration=8.0)
    ahead = drive(network, entity("ahead"), start=25.0, duration=8.0)
    assert gaps(network, behind, ahead) == {("behind", "ahead"): pytest.approx(20.0, abs=1e-6)}


def test_who_is_absent_is_near_nobody(network: RoadNetwork) -> None:
    """It goes after five seconds, two before the other would have run into it."""
    activity = np.full(N, int(Activity.ACTIVE), dtype=np.uint8)
    activity[251:] = 0
    slow = drive(network, entity("slow"), start=70.0, speed=20.0, activity=activity)
    other = drive(network, entity("other"), start=0.0, speed=30.0)
    assert gaps(network, slow, other) == {("slow", "other"): pytest.approx(170.0 - 150.0 - 5.0, abs=1e-6)}
    staying = drive(network, entity("slow"), start=70.0, speed=20.0)
    assert gaps(network, staying, other) == {("slow", "other"): 0.0}


def test_who_walks_has_a_gap_and_who_is_alone_has_none(network: RoadNetwork) -> None:
    walker = structs.replace(entity("walker"), category=EntityCategory.PEDESTRIAN)
    here = drive(network, walker, start=10.0)
    assert set(gaps(network, here, drive(network, entity("car"), start=0.0))) == {("walker", "car")}
    assert gaps(network, here) == {}
