"""What a player makes of the outputs: where cars begin, how sharply they turn, what conditions refer to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.files.test_openscenario_write import LANE_CHANGE, nominal, played, provenance, sine_path
from tests.kit.motion import drive, entity, together, two_roads
from tests.kit.scenario_files import action, event, made, time_condition
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.files.openscenario.write.moving import Moving, _heading_times
from xosc_lateral.world.motion.path_pieces import vertex_times


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
    path = sine_path("Ego")
    output = tmp_path / "out.xosc"
    write_converted(
        scenario,
        motion,
        {},
        output,
        paths=[path],
        provenance=provenance(scenario),
        summary="",
    )
    root = etree.parse(str(output)).getroot()
    references = {item.get("storyboardElementRef") for item in root.iter("StoryboardElementStateCondition")}
    assert "aside" in references
    assert references - {path.entity} <= {item.get("name") for item in root.iter("Act", "Event", "Action")}
    assert played(read_scenario(output), 30.0).end_time == pytest.approx(motion.end_time)
