"""Templates as plain files: those that ship are what their builders make, and anybody can add one."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.files.output_paths import template_mark
from xosc_lateral.files.templates import TEMPLATES, PlainTemplate, plain_templates

SCENARIO = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader description="Mine" author="me" revMajor="1" revMinor="2" date="2024-01-01T00:00:00"/>
  <ParameterDeclarations>
    <!-- a comment that stays -->
    <ParameterDeclaration name="speed" parameterType="double" value="30"/>
    <ParameterDeclaration value='1' name='lanes' parameterType='integer'/>
  </ParameterDeclarations>
</OpenSCENARIO>
"""


@pytest.fixture
def mine(tmp_path: Path) -> PlainTemplate:
    (tmp_path / "mine.xosc").write_text(SCENARIO)
    (tmp_path / "mine.xodr").write_text("<OpenDRIVE/>")
    (tmp_path / "roadless.xosc").write_text(SCENARIO)
    (found,) = plain_templates(tmp_path)
    return found


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda template: template.name)
def test_the_shipped_files_are_what_the_builder_makes_of_the_defaults(template):
    for name, text in template.files().items():
        written = (shipped_folder("templates") / name).read_text(encoding="utf-8")
        assert written == text.rstrip() + "\n" + template_mark(text), "run `make templates`"


def test_a_plain_file_has_its_declared_parameters_as_settings(mine):
    assert (mine.name, mine.summary) == ("mine", "Mine")
    assert [(one.name, one.default, one.allowed) for one in mine.parameters] == [
        ("speed", "30", "double"),
        ("lanes", "1", "integer"),
    ]


def test_a_chosen_value_is_the_only_thing_that_changes(mine):
    files = mine.files({"speed": "33", "lanes": "2"})
    assert files["mine.xodr"] == "<OpenDRIVE/>"
    assert files["mine.xosc"] == SCENARIO.replace('"30"', '"33"').replace("value='1'", 'value="2"')


TRICKY = SCENARIO.replace(
    "    <!-- a comment that stays -->",
    """    <!-- <ParameterDeclaration name="speed" parameterType="double" value="1"/> as it was -->
    <ParameterDeclaration value="$speed > 3 &amp; more" name="fast" parameterType="string"/>""",
)


@pytest.mark.parametrize(("name", "value"), [("speed", "33"), ("fast", 'a "b" > <c> & d'), ("lanes", "+2")])
def test_the_scenario_that_is_read_has_the_chosen_value_whatever_stands_around_it(name, value, tmp_path):
    """In a comment above stands the same declaration, and a value holds what ends a tag elsewhere."""
    (tmp_path / "mine.xosc").write_text(TRICKY)
    (tmp_path / "mine.xodr").write_text("<OpenDRIVE/>")
    (template,) = plain_templates(tmp_path)
    before, after = (
        {one.get("name"): one.get("value") for one in ET.fromstring(text).iter("ParameterDeclaration")}
        for text in (TRICKY, template.files({name: value})["mine.xosc"])
    )
    assert after == {**before, name: value}
    assert "<!-- <ParameterDeclaration" in template.files({name: value})["mine.xosc"]


@pytest.mark.parametrize(
    ("name", "value"),
    [("speed", "fast"), ("speed", "nan"), ("speed", "1_000"), ("lanes", "1.5"), ("lanes", "٣"), ("colour", "red")],
)
def test_a_setting_that_is_none_is_refused_by_name(mine, name, value):
    with pytest.raises(XoscLateralError, match=name):
        mine.files({name: value})


def test_all_templates_are_listed_with_their_settings():
    frame = xl.list_templates().to_frame()
    assert set(frame["template"]) == {template.name for template in TEMPLATES}
    assert set(xl.list_templates("curves").to_frame()["name"]) >= {"radius", "lane_width"}
