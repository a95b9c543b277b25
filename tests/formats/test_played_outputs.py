"""What a player makes of the outputs: where cars begin, how sharply they turn, what conditions refer to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.formats.made_scenario import action, event, made, time_condition
from tests.formats.test_openscenario_write import LANE_CHANGE, STEP, nominal, played, provenance
from tests.motion.made_motion import drive, entity, together, two_roads
from xosc_lateral.formats.openscenario import read_scenario
from xosc_lateral.formats.openscenario.write import OffsetChain, offset_chains, write_lane_offset_scenario
from xosc_lateral.formats.openscenario.write.moving import Moving, _heading_times
from xosc_lateral.formats.openscenario.write.offset_chain import ramps
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.motion.segments import Stretch, StretchKind


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
    """Where nothing but a slow stretch lies in between; else at the nominal offset."""
    network = two_roads(tmp_path)
    activity = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
    activity[500] |= between
    motion = drive(network, entity(), duration=20.0, speed=20.0, activity=activity)
    rows = ((10, 400), (600, 900))
    stretches = [Stretch(StretchKind.ROAD_FOLLOWING, a, b, STEP * a, STEP * b) for a, b in rows]
    chains = offset_chains(motion, network, np.full(1001, 0.3), stretches, pulls=False)
    assert [chain.start_t for chain in chains] == pytest.approx([0.0, second], abs=1e-9)


def test_after_a_flip_of_the_t_axis_a_chain_goes_on_from_the_other_side() -> None:
    time = np.arange(0.0, 20.0, STEP)
    side = np.where(time < 10.0, 1.0, -1.0)
    found = ramps(OffsetChain("Ego", time, side * 0.2 * np.sin(0.8 * time), flips=(10.0,)))
    before = [ramp for ramp in found if ramp.end < 10.0][-1]
    after = next(ramp for ramp in found if ramp.start > 10.0)
    assert after.origin == pytest.approx(-before.target)


def test_whoever_pulls_a_trailer_is_not_put_down_aside(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = drive(network, entity(), duration=10.0)
    stretch = Stretch(StretchKind.ROAD_FOLLOWING, 0, 500, 0.0, 10.0)
    for pulls in (True, False):
        (chain,) = offset_chains(motion, network, np.full(501, 0.3), [stretch], pulls=pulls)
        assert chain.is_placed is not pulls
        assert chain.start_t == pytest.approx(0.0 if pulls else 0.3)


def test_the_offsets_come_to_rest_before_a_maneuver_may_begin() -> None:
    time = np.arange(0.0, 8.0, STEP)
    found = ramps(OffsetChain("Ego", time, 0.1 * time))
    assert found[-1].end <= time[-1] - 0.1


def test_a_car_that_runs_into_the_end_of_its_road_keeps_its_speed_until_there(tmp_path: Path) -> None:
    """The last 3 cm are covered within a step; a vertex of their own they can't have."""
    network = two_roads(tmp_path)
    speed = np.where(np.arange(501) <= 300, 20.0, 0.0)
    speed[301] = 1.3
    motion = drive(network, entity(), duration=10.0, speed=speed)
    (path,) = nominal(together(motion)).values()
    item = Moving(motion, path, together(motion))
    (piece,) = item.pieces
    assert (piece.last, piece.stops) == (300, True)
    assert item.path.x[300] == pytest.approx(path.x[301])


def test_headings_are_as_late_in_short_gaps_as_in_usual_ones() -> None:
    """In the middle of each gap the player has the heading of the vertex before it: always the one of 0.05 s ago."""
    times = np.array([0.0, 0.1, 0.2, 0.22, 0.3, 0.4, 0.44])
    middle = 0.5 * (times[1:] + times[:-1])
    assert middle - _heading_times(times, stops=False)[:-1] == pytest.approx(0.05)
    assert _heading_times(times, stops=False)[-1] == pytest.approx(0.39)
    assert _heading_times(times, stops=True)[-1] == 0.44


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
