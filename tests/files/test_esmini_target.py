"""Written for esmini: what would stop it is taken out and named; everything else is as for anybody."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.files.test_openscenario_write import played
from tests.files.test_versions import tree, written
from tests.kit.scenario_files import action, event, speed_action, story
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.draft import target
from xosc_lateral.files.openscenario.write.fit import write_converted

RANDOM = "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"
ANGLE = (
    '<ConditionGroup><Condition name="turned" delay="3" conditionEdge="none"><ByEntityCondition>'
    '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>'
    '<EntityCondition><RelativeAngleCondition entityRef="Ego" angleType="heading" angle="0" angleTolerance="9"/>'
    "</EntityCondition></ByEntityCondition></Condition></ConditionGroup>"
)


def test_what_would_stop_it_is_left_out_and_named(tmp_path: Path) -> None:
    events = event("any", action("any", RANDOM)), event("go", action("go", speed_action("20")), time=2)
    source = tree(tmp_path, stories=story(*events))
    assert written(source, None)[1].findall(".//RandomRouteAction")
    found, root = written(source, None, "esmini")
    assert not root.findall(".//RandomRouteAction")
    assert [note for note in found.notes if "RandomRouteAction left out (esmini would stop there)" in note.what]


def test_without_such_things_it_is_what_anybody_gets(tmp_path: Path) -> None:
    source = tree(tmp_path)
    assert written(source, None, "esmini")[0].data == written(source, None)[0].data


def test_a_condition_that_stops_it_is_refused(tmp_path: Path) -> None:
    scenario = read_scenario(tree(tmp_path, stop=ANGLE))
    with pytest.raises(FormatError, match=r"Condition 'turned': esmini has no RelativeAngleCondition"):
        write_converted(
            scenario,
            played(scenario),
            {},
            tmp_path / "out.xosc",
            paths=[],
            provenance={},
            summary="",
            target=target("esmini"),
        )
    assert not (tmp_path / "out.xosc").exists()
