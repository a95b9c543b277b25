"""A conversion's page, its JSON and its figures do not deny each other: sentences, tiles, tables and scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from lxml import html

import xosc_lateral as xl
from tests.kit.enriched import converted, made_enriched
from tests.kit.made.actions import ACTIONS
from tests.kit.made.scenario import made as made_scenario
from xosc_lateral.workflows.conversion.ego_drives import OTHER_RUNS
from xosc_lateral.workflows.conversion.equivalent_paths import EquivalentPaths
from xosc_lateral.workflows.conversion.page import conversion_page
from xosc_lateral.workflows.conversion.result import NOMINAL_RUN, EventShift
from xosc_lateral.workflows.conversion.shifts import Change, Comparison
from xosc_lateral.workflows.playing.figures import accelerations_over_time

TEMPLATES = Path(__file__).resolve().parents[3] / "templates"

TRAILER = list(ACTIONS).index("connect_trailer")

KINDS: list[tuple[str | int, dict[str, Any]]] = [
    ("cut-in", {"seed": 1, "parameters": {"ego_speed": "28"}}),
    ("cut-in", {"seed": 2, "mode": "lane-offset"}),
    ("cut-in", {"ego": ["none"]}),
    ("cut-in traffic=left", {"ego": ["none"], "mode": "trajectory", "time_limit": 12.0}),
    ("cut-in", {"ego": ["Ego", "CutIn", "Truck"], "mode": "trajectory"}),
    ("overtake-truck", {}),
    ("overtake-truck", {"ego": ["none"], "lane_changes": "lifelike"}),
    ("overtake-truck", {"mode": "trajectory", "entity": {"Truck": "motorway-vehicle-1"}, "variant": 3}),
    ("braking-leader", {"seed": 3}),
    ("braking-leader", {"mode": "trajectory", "profile": "rural", "player": "carla"}),
    ("jam-end", {"only": ["Follower"]}),
    ("jam-end", {"ego": ["none"], "mode": "trajectory", "jam_corridor": True}),
    ("curves", {"seed": 4}),
    ("curves", {"seed": 4, "mode": "trajectory", "with_sensor": True}),
    ("dense-traffic", {"mode": "trajectory", "neighbours": "none", "time_limit": 8.0}),
    (TRAILER, {"mode": "trajectory"}),
    *((TRAILER + further, {}) for further in (1, 9, 20, 31, 44)),
]
"""Templates with their settings, or seeds of made scenarios; options of the conversion."""


def scenario_of(kind: str | int, folder: Path) -> Path:
    if isinstance(kind, int):
        _, road, text = made_scenario(kind)
        (folder / "road.xodr").write_text(road, encoding="utf-8")
        (folder / "made.xosc").write_text(text, encoding="utf-8")
        return folder / "made.xosc"
    name, *settings = kind.split()
    if not settings:
        return TEMPLATES / f"{name}.xosc"
    return xl.write_template(name, folder, **dict(one.split("=") for one in settings))[0]


class Read(NamedTuple):
    """A page as somebody reads it."""

    lead: str
    tiles: dict[str, tuple[float, str]]  # label -> number and note
    tables: dict[str, list[dict[str, str]]]  # by the beginning of the caption
    marked: list[dict[str, str]]  # rows that are marked as bad
    warnings: list[str]
    scene: dict[str, Any]


def read(page: str) -> Read:
    tree = html.fromstring(page.encode())
    tiles, tables, marked = {}, {}, list[dict[str, str]]()
    for box in tree.xpath("//dl[@class='figures']/div"):
        label, value, *note = (part.text_content() for part in box)
        tiles[label] = float(value.split()[0]), "".join(note)
    for table in tree.xpath("//table"):
        heads = [one.text_content() for one in table.xpath(".//th")]
        lines = [[one.text_content() for one in line.xpath("td")] for line in table.xpath(".//tbody/tr")]
        rows = [dict(zip(heads, line, strict=True)) for line in lines]
        tables[table.xpath("string(caption)").split()[0]] = rows
        classes = [line.get("class") for line in table.xpath(".//tbody/tr")]
        marked += [row for row, kind in zip(rows, classes, strict=True) if kind == "bad"]
    scene = json.loads(tree.xpath("string(//script[@id='scene'])"))
    lead = " ".join(one.text_content() for one in tree.xpath("//header/p"))
    return Read(lead, tiles, tables, marked, [one.text_content() for one in tree.xpath("//*[@role='note']")], scene)


def unpacked(column: dict[str, Any]) -> np.ndarray:
    return np.cumsum(column["d"]) * column["r"]


def numbers(rows: list[dict[str, str]], column: str) -> list[float]:
    return [float(row[column]) for row in rows if row[column] != "–"]


@pytest.mark.pages
@pytest.mark.parametrize(("kind", "options"), KINDS)
def test_no_two_numbers_for_one_name(kind: str | int, options: dict[str, Any], tmp_path: Path) -> None:
    made = xl.convert(scenario_of(kind, tmp_path), **options)
    page, values = read(conversion_page(made)), made.to_dict()
    done, gaps = page.tables.get("Enriched", []), page.tables.get("Pairs", [])

    enriched = [one["name"] for one in values["entities"] if one["profile"]]
    begin = f"{len(enriched)} of {len(values['entities'])} entities" if enriched else "No entity was enriched"
    assert page.lead.startswith(begin) and "The result is in" not in page.lead
    assert [row["entity"] for row in done] == enriched
    assert sorted(one["name"] for one in page.scene["entities"] if "enriched" in one) == sorted(enriched)
    assert f"{values['end_time']:.1f} s (ended by the {values['ended_by']})" in page.lead
    assert max(numbers(page.tables["Segments"], "to [s]")) == pytest.approx(values["end_time"], abs=0.011)
    for row, one in zip(done, (one for one in values["entities"] if one["profile"]), strict=True):
        assert float(row["std. deviation [m]"]) == pytest.approx(one["offset_spread"], rel=0.01)
        assert int(row["segments"]) == len(one["segments"])

    if not enriched:
        assert not page.tiles and not page.marked
        return
    time, _ = page.tiles["road-following, all entities together"]
    assert time == pytest.approx(sum(numbers(done, "time [s]")), abs=0.5 + 0.05 * len(done))
    _, note = page.tiles["standard deviation of the offsets"]
    largest = float(note.split()[1])
    assert largest == max(numbers(done, "max. offset [m]"))
    drawn = [np.abs(unpacked(one["added"])).max() for one in page.scene["entities"] if "added" in one]
    assert max(drawn) == pytest.approx(largest, abs=0.02), "the player shows every tenth of a second"

    acceleration, _ = page.tiles["largest added lateral acceleration"]
    assert acceleration == max(numbers(done, "acc. max. [m/s²]"))
    moved = [one for one in made.movement.entities if one.is_enriched]
    marks = (mark for panel in accelerations_over_time(made.movement, moved).panels for mark in panel.curves())
    curves = [mark.y for mark in marks if mark.label == "added"]
    assert acceleration == pytest.approx(max(np.abs(curve).max() for curve in curves), abs=0.006)

    if gaps:
        smallest, _ = page.tiles["smallest gap"]
        assert smallest == min(numbers(gaps, "enriched [m]"))
        assert smallest == pytest.approx(values["gap_after"], abs=0.006)
        assert min(numbers(gaps, "nominal [m]")) == pytest.approx(values["gap_before"], abs=0.006)
    touching = {row["pair"] for row in gaps if row["enriched [m]"] == "0.00" and row["nominal [m]"] != "0.00"}
    assert {row["pair"] for row in page.marked} == touching
    assert len([line for line in page.warnings if "touch" in line and "nominal run" in line]) == len(touching)
    assert [line.removeprefix("Warning") for line in page.warnings] == values["warnings"]

    nominal = {one.path[-2]: one.start for one in made.movement.motion.actions if len(one.path) > 1}
    events = page.tables.get("How", [])
    assert {row["run"] for row in events} <= {NOMINAL_RUN, *OTHER_RUNS}
    for row in events:
        if row["run"] == NOMINAL_RUN:
            assert float(row["at [s]"]) == pytest.approx(nominal[row["event"]], abs=0.011)
    assert not values["shifts"] or values["shifts"][0]["run"] == NOMINAL_RUN


def test_what_other_egos_cause_is_never_told_as_the_scenario_s_own(tmp_path: Path) -> None:
    """A contact and a late event in trial runs: named with their run; the tile of gaps and the table stay nominal."""
    braking = OTHER_RUNS[-1]
    shifts = tuple(
        EventShift("cut in", "Van", time, 4.0, later, later, 0.0, 0.0, run=run)
        for run, time, later in ((NOMINAL_RUN, 8.5, 0.0), (OTHER_RUNS[0], 30.0, 0.01), (braking, 37.3, 1.2))
    )
    contact = Change("contact of 'Ego' and 'Van' at 34.0 s", "Ego", 34.0, "is new", pair=("Ego", "Van"), run=braking)
    own = Change("contact of 'Slow' and 'Van' at 4.0 s", "Slow", 4.0, "is new", pair=("Slow", "Van"), run=NOMINAL_RUN)
    kept = EquivalentPaths((), tuple(Comparison((one,), ()) for one in shifts), (own, contact), {}, {})
    assert kept.shifts == shifts
    assert kept.trial_contacts == (f"{contact.what} is new with the offsets (run: {braking})",)
    lines = tuple(map(str, kept.warnings((), {("Slow", "Van")})))
    assert lines[1:] == kept.trial_contacts, "the movement's own warnings tell of the nominal contact"
    late = f"event 'cut in' of 'Van' at 37.30 s comes 1.20 s later: what it waits for does (run: {braking})"
    assert lines[0] == late, "an event that is explained comes late all the same"

    made = converted(made_enriched(tmp_path), *lines)
    made.shifts = kept.shifts
    page = read(conversion_page(made))
    assert [(row["run"], row["at [s]"]) for row in page.tables["How"]] == [(NOMINAL_RUN, "8.50"), (braking, "37.30")]
    assert page.warnings == [f"Warning{line}" for line in lines]
    assert not page.marked
