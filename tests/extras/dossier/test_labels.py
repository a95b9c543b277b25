"""Tags and quality results say what is in an output, and the tools that they are for take them."""

from __future__ import annotations

import json

import pytest
from lxml import etree

import xosc_lateral as xl
from xosc_lateral.cli import main


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("labels")
    xl.write_template("overtake-truck", folder)
    assert (
        main(["convert", f"{folder}/overtake-truck.xosc", "-o", f"{folder}/out.xosc", "--ego", "none", "--labels"]) == 0
    )
    return folder


def test_tags_name_what_is_there(written):
    document = json.loads((written / "out.openlabel.json").read_text(encoding="utf-8"))["openlabel"]
    tags = {tag["type"]: tag.get("tag_data") for tag in document["tags"].values()}
    assert tags["scenarioDefinition"] == document["metadata"]["tagged_file"] == "out.xosc"
    categories = [item.get("vehicleCategory") for item in etree.parse(written / "out.xosc").iterfind(".//Vehicle")]
    counted = {kind: tags[kind]["num"][0]["val"] for kind in ("VehicleCar", "VehicleTruck")}
    assert counted == {"VehicleCar": categories.count("car"), "VehicleTruck": categories.count("truck")}
    assert {"MotionLaneChangeLeft", "MotionLaneChangeRight", "MotionDrive", "RoadTypeMotorway"} <= tags.keys()
    assert all(tag["ontology_uid"] in document["ontologies"] for tag in document["tags"].values())


def test_a_quality_result_has_what_the_conversion_says(written, tmp_path):
    made = xl.convert(written / "overtake-truck.xosc", version="1.0", ego=["none"])
    _, quality = made.write_labels(tmp_path / "a.xosc")
    root = etree.parse(quality).getroot()
    assert root.tag == "CheckerResults" and len(root.findall(".//Checker")) == 4
    said = [issue.get("description") for issue in root.iter("Issue")]
    notes = [note.what for note in made.movement.motion.notes]
    assert sorted(said) == sorted([*notes, *(line for line in made.warnings if line not in notes)])
    rules = {issue.get("ruleUID") for issue in root.iter("Issue")}
    assert rules <= {rule.get("ruleUID") for rule in root.iter("AddressedRule")}


def test_both_are_replaced_as_ours_and_kept_as_others(written):
    made = xl.convert(written / "overtake-truck.xosc", seed=2)
    made.write_labels(written / "out.xosc")
    (written / "other.xqar").write_text("<CheckerResults/>")
    with pytest.raises(xl.FormatError, match=r"other\.xqar: exists and was not written by"):
        made.write_labels(written / "other.xosc")


def test_a_batch_writes_them_and_makes_those_anew_that_are_gone(tmp_path):
    xl.write_template("braking-leader", tmp_path / "in")
    made = xl.convert_many(tmp_path / "in", tmp_path / "out", labels=True, time_limit=5.0)
    assert made.failed == 0
    (tmp_path / "out" / "braking-leader.xqar").unlink()
    again = xl.convert_many(tmp_path / "in", tmp_path / "out", labels=True, time_limit=5.0).to_frame()
    assert again["state"].tolist() == ["written"] and (tmp_path / "out" / "braking-leader.xqar").is_file()


def test_their_own_tools_take_them(written):
    core = pytest.importorskip("openlabel_checker.core", reason="openlabel-checker is not installed")
    result = pytest.importorskip("qc_baselib.result", reason="asam-qc-baselib is not installed")
    report = core.check_file(str(written / "out.openlabel.json"))
    problems = [issue for outcome in report.outcomes for issue in outcome.issues]
    assert not problems
    read = result.Result()
    read.load_from_file(str(written / "out.xqar"))
    assert read.get_checker_bundle_names() == ["xosc-lateral"]
