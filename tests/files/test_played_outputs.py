"""What a player makes of the outputs: where cars begin, how sharply they turn, what conditions refer to."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from msgspec import structs

from tests.files.test_openscenario_write import LANE_CHANGE, STEP, nominal, played, provenance
from tests.kit.motion import drive, entity, together, two_roads
from tests.kit.scenario_files import action, event, made, time_condition
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.lane_offset_scenario import write_lane_offset_scenario
from xosc_lateral.files.openscenario.write.moving import Moving, _heading_times
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.motion.offset_chain import OffsetChain, offset_chains, ramps
from xosc_lateral.world.motion.path_pieces import vertex_times
from xosc_lateral.world.motion.ramp_targets import FRAME, Ramp, acceleration, fitted
from xosc_lateral.world.motion.segments import SegmentKind, SegmentSpan


def test_a_car_that_begins_with_the_scenario_is_put_down_at_its_offset(tmp_path: Path) -> None:
    """No transition leads there, and a car that drifts from the first moment is met half way."""
    time = np.arange(0.0, 20.0, STEP)
    chain = OffsetChain("Ego", time, 0.3 + 0.3 * np.exp(-time / 2.0), is_placed=True)
    scenario = made(tmp_path, stop=time_condition(20))
    write_lane_offset_scenario(
        scenario, played(scenario, 30.0), [chain], tmp_path / "out.xosc", provenance=provenance(scenario), summary=""
    )
    ego = played(read_scenario(tmp_path / "out.xosc"), 30.0).entities[0]
    assert ego.offset[0] == pytest.approx(ramps(chain)[0].origin, abs=1e-4)
    assert np.abs(ego.offset - np.interp(ego.time, time, chain.offset_t))[ego.time < 19.5].max() < 0.03
    assert (np.abs(np.diff(ego.heading_relative)) / STEP).max() <= 0.3e-3 / 0.01


@pytest.mark.parametrize(("between", "second"), [(0, 0.3), (Activity.LATERAL, 0.0), (Activity.TELEPORTED, 0.0)])
def test_a_chain_begins_where_the_one_before_has_left_the_car(tmp_path: Path, between: int, second: float) -> None:
    """Where nothing but a slow segment lies in between; else at the nominal offset."""
    network = two_roads(tmp_path)
    activity = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
    activity[500] |= between
    motion = drive(network, entity(), duration=20.0, speed=20.0, activity=activity)
    rows = ((10, 400), (600, 900))
    spans = [SegmentSpan(SegmentKind.ROAD_FOLLOWING, a, b, STEP * a, STEP * b) for a, b in rows]
    chains = offset_chains(motion, network, np.full(1001, 0.3), spans, tows=False)
    assert [chain.start_t for chain in chains] == pytest.approx([0.0, second], abs=1e-9)


def test_after_a_flip_of_the_t_axis_a_chain_goes_on_from_the_other_side() -> None:
    time = np.arange(0.0, 20.0, STEP)
    side = np.where(time < 10.0, 1.0, -1.0)
    found = ramps(OffsetChain("Ego", time, side * 0.2 * np.sin(0.8 * time), flips=(10.0,)))
    before = [ramp for ramp in found if ramp.start < 10.0][-1]
    after = next(ramp for ramp in found if ramp.start > 10.0)
    assert before.end > 10.0
    assert after.origin == pytest.approx(-before.target)
    same = ramps(OffsetChain("Ego", time, 0.2 * np.sin(0.8 * time)))
    assert _worst(found, time, side) < 1.5 * _worst(same, time, np.ones(len(time)))


def _worst(found: list[Ramp], time: np.ndarray, side: np.ndarray) -> float:
    """Error against the sine above once it has settled: on the side of +t on which each of the transitions begins."""
    way = np.interp([ramp.start for ramp in found], time, side)
    turned = [structs.replace(r, origin=w * r.origin, target=w * r.target) for r, w in zip(found, way, strict=True)]
    return float(np.abs(_followed(turned, time) - 0.2 * np.sin(0.8 * time))[time > found[0].end].max())


def test_whoever_pulls_a_trailer_is_not_put_down_aside(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = drive(network, entity(), duration=10.0)
    span = SegmentSpan(SegmentKind.ROAD_FOLLOWING, 0, 500, 0.0, 10.0)
    for tows in (True, False):
        (chain,) = offset_chains(motion, network, np.full(501, 0.3), [span], tows=tows)
        assert chain.is_placed is not tows
        assert chain.start_t == pytest.approx(0.0 if tows else 0.3)


def test_the_offsets_come_to_rest_before_a_maneuver_may_begin() -> None:
    time = np.arange(0.0, 8.0, STEP)
    found = ramps(OffsetChain("Ego", time, 0.1 * time))
    assert found[-1].end <= time[-1] - 0.1


@pytest.mark.parametrize("still", [0, 199])
def test_a_car_that_runs_into_the_end_of_its_road_keeps_its_speed_until_there(tmp_path: Path, still: int) -> None:
    """The last 3 cm are covered within a step; a vertex of their own they can't have. The run may end there."""
    network = two_roads(tmp_path)
    speed = np.where(np.arange(302 + still) <= 300, 20.0, 0.0)
    speed[301] = 1.3
    motion = drive(network, entity(), duration=0.02 * (301 + still), speed=speed)
    (path,) = nominal(together(motion)).values()
    item = Moving(motion, path, together(motion))
    (piece,) = item.pieces
    assert (piece.last, piece.stops) == (300, True)
    assert item.path.x[300] == pytest.approx(path.x[301])


def test_the_last_step_of_a_sudden_stop_begins_farther_back_where_that_moves_the_car_less(tmp_path: Path) -> None:
    """Of 8 cm, 2.5 cm are missing to a vertex of their own: there a step earlier, the car would be 8 cm ahead."""
    speed = np.where(np.arange(501) <= 300, 20.0, 0.0)
    speed[301] = 4.0
    motion = drive(two_roads(tmp_path), entity(), duration=10.0, speed=speed)
    (path,) = nominal(together(motion)).values()
    item = Moving(motion, path, together(motion))
    (piece,) = item.pieces
    assert (piece.last, piece.stops) == (301, True)
    moved = np.hypot(item.path.x - path.x, item.path.y - path.y)
    assert moved.max() == pytest.approx(0.025, abs=1e-3)
    rows = slice(piece.first, piece.last + 1)
    assert np.interp(300, np.arange(501), path.time) in vertex_times(
        path.time[rows], item.path.x[rows], item.path.y[rows]
    )


def test_headings_are_as_late_in_short_gaps_as_in_usual_ones_and_in_time_at_the_end() -> None:
    """In the middle of each gap the player has the heading of the vertex before it: that of half a usual gap ago."""
    times = np.sort(np.append(np.linspace(0.0, 3.0, 31), 0.92))
    middle = 0.5 * (times[1:] + times[:-1])
    shown = _heading_times(times)
    late = middle - shown[:-1]
    assert late[middle < 2.0] == pytest.approx(0.05)
    assert shown[-1] == times[-1]
    assert (np.diff(shown) > 0.0).all()
    assert (np.diff(late[middle > 2.0]) / np.diff(middle[middle > 2.0])).min() > -0.06


@pytest.mark.parametrize(("radius", "most"), [(200.0, 0.1), (40.0, 0.05), (9.0, 0.02)])
def test_gaps_are_even_in_a_bend_however_sharp(radius: float, most: float) -> None:
    """Where gaps change, the player turns a car within half a gap by what belongs to both."""
    time = np.arange(0.0, 3.0, 0.02)
    turned = 25.0 * np.clip(time - 1.0, 0.0, 0.6) / radius
    ahead = 25.0 * (time - np.clip(time - 1.0, 0.0, 0.6))
    before, after = np.minimum(ahead, 25.0), np.maximum(ahead - 25.0, 0.0)
    x = before + radius * np.sin(turned) + after * np.cos(turned)
    y = radius * (1.0 - np.cos(turned)) + after * np.sin(turned)
    gaps = np.diff(vertex_times(time, x, y))
    assert gaps == pytest.approx(most, rel=0.03)


def test_targets_halve_the_error_of_an_offset_that_turns_back() -> None:
    """Led to the offset itself, transitions err on one side; none of them turns the car faster for it."""
    time = np.arange(0.0, 8.01, 0.1)
    offset = 0.05 * (time - 4.0) ** 2
    limit = np.full(len(time), 0.8)
    plain = [Ramp(2.0 * k, 2.0 * k + 1.97, offset[20 * k], offset[20 * k + 20]) for k in range(4)]
    found = fitted(plain, time, offset, limit, np.full(len(time), np.inf), settles=False, starts=True)
    worst, better = (np.abs(_followed(ramps, time) - offset).max() for ramps in (plain, found))
    assert better < 0.6 * worst
    assert all(acceleration(ramp.target - ramp.origin, ramp.end - ramp.start) <= 0.8 + 1e-9 for ramp in found)
    assert all(one.target == other.origin for one, other in pairwise(found))


def _followed(found: list[Ramp], time: np.ndarray) -> np.ndarray:
    place = np.full(len(time), found[0].origin)
    for ramp in found:
        share = np.clip((time - ramp.start - FRAME) / (ramp.end - ramp.start), 0.0, 1.0)
        place += (ramp.target - ramp.origin) * 0.5 * (1.0 - np.cos(np.pi * share))
    return place


def test_a_maneuver_of_a_catalog_is_written_out_where_the_offsets_refer_to_it(tmp_path: Path) -> None:
    """Who looks at the file alone would find no element of the name that conditions refer to."""
    (tmp_path / "catalogs").mkdir()
    inner = event("change", action("aside", LANE_CHANGE), time=8.0)
    (tmp_path / "catalogs" / "ways.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-01-01T00:00:00" description="" author=""/>'
        f'<Catalog name="ways"><Maneuver name="way">{inner}</Maneuver></Catalog></OpenSCENARIO>'
    )
    stories = (
        '<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">'
        '<Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors>'
        '<CatalogReference catalogName="ways" entryName="way"/></ManeuverGroup>'
        f"<StartTrigger>{time_condition(-1)}</StartTrigger></Act></Story>"
    )
    catalogs = '<ManeuverCatalog><Directory path="catalogs"/></ManeuverCatalog>'
    scenario = made(tmp_path, catalogs=catalogs, stories=stories, stop=time_condition(20))
    motion = played(scenario, 30.0)
    time = np.arange(0.0, 7.5, STEP)
    chain = OffsetChain("Ego", time, 0.2 * np.sin(0.8 * time))
    output = tmp_path / "out.xosc"
    write_lane_offset_scenario(scenario, motion, [chain], output, provenance=provenance(scenario), summary="")
    root = etree.parse(str(output)).getroot()
    references = {item.get("storyboardElementRef") for item in root.iter("StoryboardElementStateCondition")}
    assert "aside" in references
    assert references - {chain.entity} <= {item.get("name") for item in root.iter("Act", "Event", "Action")}
    assert played(read_scenario(output), 30.0).end_time == pytest.approx(motion.end_time)
