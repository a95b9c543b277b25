"""Public scenarios: every file loads or is refused with its place; what is written from their logs is valid."""

from __future__ import annotations

import gzip
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.distribution import read_distribution
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.world.motion.nominal import MOTION, Activity, EntityMotion, NominalMotion, PlayedAction
from xosc_lateral.world.scenario.scenario import Scenario

XSD = Path(__file__).parents[1] / "data" / "xsd"
FILES = {(1, 0): "1.0.0", (1, 1): "1.1.1", (1, 2): "1.2.0", (1, 3): "1.3.0"}


def test_every_corpus_file_loads_or_is_refused_with_file_line_and_reason(shared: Path) -> None:
    loaded, refused = 0, []
    for path in sorted((shared / "corpus").rglob("*.xosc")):
        try:
            read_scenario(path)
            loaded += 1
        except FormatError as error:
            assert error.line is not None
            assert str(error).startswith(f"{path}:{error.line}: ")
            refused.append(error.what)
    # 85 scenarios; the rest are 15 catalogs, 16 distributions and one whose catalog lies on its author's machine.
    assert loaded >= 85
    unexplained = [what for what in refused if "is a catalog" not in what and "is a parameter value" not in what]
    assert len(unexplained) <= 1


def test_every_corpus_distribution_gives_sets_that_load(shared: Path) -> None:
    found = 0
    for path in sorted((shared / "corpus").rglob("*.xosc")):
        if b"<ParameterValueDistribution" in path.read_bytes():
            logical = read_distribution(path)
            read_scenario(logical.scenario_file, next(logical.parameter_sets()))
            found += 1
    assert found >= 16


def logged_motion(scenario: Scenario, log: Path) -> tuple[NominalMotion, dict[str, Track]]:
    """Motion from the reference player's 10 Hz log; each event's actions are taken to start half a second apart."""
    rows = defaultdict(dict)
    with gzip.open(log, "rt") as file:
        header = file.readline().strip().split(",")
        for line in file:
            row = dict(zip(header, line.strip().split(","), strict=True))
            rows[row["name"]][round(float(row["time"]), 3)] = [float(row[key]) for key in ("x", "y", "z", "h", "speed")]
    time = np.array(sorted({moment for entity in rows.values() for moment in entity}))
    entities = []
    for entity in scenario.entities:
        if entity.name not in rows:
            continue
        table = np.full((len(time), 5), np.nan)
        for index, moment in enumerate(time):
            table[index] = rows[entity.name].get(float(moment), [np.nan] * 5)
        x, y, z, heading, speed = table.T
        activity = np.where(np.isfinite(x), int(Activity.ACTIVE), 0).astype(np.uint8)
        far = np.hypot(np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0])) > 10.0
        activity[far] |= np.uint8(Activity.TELEPORTED)
        zero, nowhere = np.zeros(len(time)), np.zeros(len(time), np.int32)
        columns = x, y, z, heading, zero, zero, speed, nowhere, nowhere, zero, zero, zero, activity
        entities.append(EntityMotion.of(entity, time, **dict(zip(MOTION, columns, strict=True))))
    end = {"end_time": float(time[-1]), "ended_by": "stop trigger", "notes": ()}
    motion = NominalMotion(0.1, tuple(entities), _actions(scenario), **end)
    return motion, {entity.name: entity for entity in entities}


def _actions(scenario: Scenario) -> tuple[PlayedAction, ...]:
    played: list[PlayedAction] = []
    for story in scenario.storyboard.stories:
        for act in story.acts:
            for group in act.maneuver_groups:
                for maneuver in group.maneuvers:
                    for event in maneuver.events:
                        for action in event.actions:
                            path = (story.name, act.name, group.name, maneuver.name, event.name, action.name)
                            for actor in group.actors.entity_refs if action.is_private else (None,):
                                played.append(PlayedAction(action, actor, path, 0.5 * len(played), None))
    return tuple(played)


@pytest.mark.pages
def test_what_is_written_from_the_reference_logs_is_valid_and_loads(shared: Path, tmp_path: Path) -> None:
    schemas = {v: etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{name}.xsd"))) for v, name in FILES.items()}
    written = 0
    for log in sorted((shared / "corpus" / "reference").glob("*/*.csv.gz")):
        suite = shared / "corpus" / log.parent.name.split("_")[0]
        path = next(suite.rglob(log.name.removesuffix(".csv.gz") + ".xosc"))
        scenario = read_scenario(path)
        motion, trajectories = logged_motion(scenario, log)
        output = tmp_path / path.name
        write_converted(scenario, motion, trajectories, output, provenance={}, summary="test")
        document = etree.parse(str(output))
        assert schemas[scenario.header.version].validate(document), (
            path.name,
            schemas[scenario.header.version].error_log,
        )
        again = read_scenario(output, allowed=[shared])
        assert [entity.name for entity in again.entities] == [entity.name for entity in scenario.entities]
        written += 1
    assert written >= 70


@pytest.mark.parametrize("name", ["cut-in.xosc", "slow-lead-vehicle.xosc"])
def test_reading_keeps_what_the_file_says(shared: Path, name: str) -> None:
    scenario = read_scenario(shared / "corpus" / "esmini" / "xosc" / name)
    assert scenario.road_file is not None
    assert scenario.source == scenario.path.read_bytes()
    assert all(path.is_file() for path in scenario.input_files)
