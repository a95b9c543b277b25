"""What other tools read of a conversion: OpenLABEL tags for scenario databases, and an ASAM quality result."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.base.note import Note
from xosc_lateral.base.version import __version__
from xosc_lateral.workflows.conversion.result import ConvertedScenario
from xosc_lateral.world.scenario.entity import Entity

ONTOLOGY = "https://openlabel.asam.net/V1-0-0/ontologies/openlabel_ontology_scenario_tags.ttl"

ROAD_USERS = {
    "car": "VehicleCar",
    "van": "VehicleVan",
    "truck": "VehicleTruck",
    "semitrailer": "VehicleTrailer",
    "trailer": "VehicleTrailer",
    "bus": "VehicleBus",
    "motorbike": "VehicleMotorcycle",
    "bicycle": "VehicleCycle",
    "pedestrian": "HumanPedestrian",
    "wheelchair": "HumanWheelchairUser",
    "animal": "RoadUserAnimal",
}
"""The file's category of an entity -> the ontology's."""

RULES = {
    "no_new_contact": "Those touch that nominally do, and nobody else",
    "stays_in_lane": "No vehicle leaves its lane whose nominal motion does not",
    "all_is_played": "Every element of the scenario is played, as it is written",
    "no_other_warning": "Nothing else has to be known of the output",
}
"""Checks that a quality result reports, and what each asks."""


def openlabel(made: ConvertedScenario) -> str:
    """Tags of ASAM OpenLABEL 1.0.0, as JSON; the same output, the same bytes."""
    provenance, name = made.provenance, (made.output or made.source).name
    source = next((digest for file, digest in provenance.inputs.items() if Path(file).name == made.source.name), "")
    tags: list[dict[str, Any]] = [
        {"type": "scenarioName", "tag_data": Path(name).stem},
        {"type": "scenarioDefinition", "tag_data": name},
        {"type": "scenarioUniqueReference", "tag_data": f"sha256:{made.sha256}"},
        {"type": "scenarioParentReference", "tag_data": f"sha256:{source}"},
        {"type": "scenarioDescription", "tag_data": f"seed {made.movement.seed}, variant {provenance.variant}"},
        *({"type": kind, "tag_data": {"num": [{"name": "count", "type": "value", "val": count}]}}
          for kind, count in sorted(Counter(_road_users(made)).items())),
        *({"type": kind} for kind in sorted(_behaviours(made))),
    ]  # fmt: skip
    if any(road.is_motorway for road in made.movement.network.roads):
        tags.append({"type": "RoadTypeMotorway"})
    document = {
        "metadata": {"schema_version": "1.0.0", "tagged_file": name, "annotator": f"xosc-lateral {__version__}"},
        "ontologies": {"0": ONTOLOGY},
        "tags": {str(number): {"ontology_uid": "0", **tag} for number, tag in enumerate(tags)},
    }
    return json.dumps({"openlabel": document}, indent=1, ensure_ascii=False) + "\n"


def _road_users(made: ConvertedScenario) -> Iterator[str]:
    for result in made.movement.entities:
        entity: Entity = result.motion.entity
        kind = entity.vehicle_category.value if entity.vehicle_category is not None else entity.kind
        yield ROAD_USERS.get(kind, "RoadUserVehicle" if entity.is_vehicle else "RoadUser")


def _behaviours(made: ConvertedScenario) -> set[str]:
    kinds = set()
    for result in made.movement.entities:
        if result.motion.entity.is_vehicle and (result.motion.speed > 0.0).any():
            kinds.add("MotionDrive")
        for crossing in result.crossings:
            if crossing.is_lane_change and len(crossing.way):
                kinds.add("MotionLaneChangeLeft" if crossing.way[-1] > 0.0 else "MotionLaneChangeRight")
    return kinds


def quality_result(made: ConvertedScenario) -> bytes:
    """Result file (``.xqar``) of ASAM's Quality Checker Framework, which its tools read and merge."""
    movement = made.movement
    problems: dict[str, list[str | Note]] = {
        "no_new_contact": list(movement.contact_notes()),
        "stays_in_lane": [f"{one.name} by {one.beyond:.2f} m at {one.time:.1f} s" for one in movement.departures],
        "all_is_played": list(movement.motion.notes),
    }
    apart = {*movement.warnings(), *movement.motion.notes}
    problems["no_other_warning"] = [note for note in made.messages if note.is_warning and note not in apart]
    root = etree.Element("CheckerResults", version="1.0.0")
    bundle = etree.SubElement(
        root, "CheckerBundle", build_date="", name="xosc-lateral", version=__version__,
        description="Conversion into lifelike traffic", summary=f"{sum(map(len, problems.values()))} issue(s)",
    )  # fmt: skip
    etree.SubElement(bundle, "Param", name="InputFile", value=(made.output or made.source).name)
    number = 0
    for rule, asks in RULES.items():
        uid = f"xosc.lateral:xosc:{made.provenance.version}:{rule}"
        rule_problems = problems[rule]
        checker = etree.SubElement(
            bundle, "Checker", status="completed", checkerId=f"xosc_lateral_{rule}", description=asks,
            summary=f"{len(rule_problems)} issue(s)",
        )  # fmt: skip
        etree.SubElement(checker, "AddressedRule", ruleUID=uid)
        for problem in rule_problems:
            text = problem.what if isinstance(problem, Note) else problem
            level = {"no_new_contact": "1", "all_is_played": "3"}.get(rule, "2")
            issue = etree.SubElement(checker, "Issue", issueId=str(number), description=text, level=level, ruleUID=uid)
            if isinstance(problem, Note) and problem.line is not None:
                where = etree.SubElement(issue, "Locations", description=problem.element or "element")
                etree.SubElement(where, "FileLocation", row=str(problem.line), column="0")
            number += 1
    return bytes(etree.tostring(root, encoding="utf-8", xml_declaration=True, pretty_print=True))
