"""The reader: what the model holds after reading small scenarios, catalogs, parameters and references."""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path

import pytest

from tests.kit.scenario_files import (
    action,
    declarations,
    entity,
    event,
    made,
    parameter,
    private,
    scenario_text,
    speed_action,
    story,
    teleport,
    time_condition,
    vehicle,
    write_scenario,
)
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.references import LEVELS_UP
from xosc_lateral.world.scenario.conditions import SimulationTimeCondition, TimeHeadwayCondition
from xosc_lateral.world.scenario.enums import ConditionEdge, DynamicsShape, Priority, Rule, VehicleCategory
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.position import LanePosition, Polyline
from xosc_lateral.world.scenario.private_actions import (
    AbsoluteTargetSpeed,
    AssignRouteAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    RelativeTargetLane,
    SpeedAction,
    SynchronizeAction,
    TeleportAction,
)

DEEP = "/".join("abcdefgh"[: LEVELS_UP + 1])
UP = "../" * (LEVELS_UP + 1)
CATALOG = """<?xml version="1.0"?>
<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="" author="" description=""/>
<Catalog name="Cars">{entries}</Catalog></OpenSCENARIO>
"""


def catalog(folder: Path, entries: str, name: str = "Cars.xosc") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(CATALOG.format(entries=entries))


def locations(path: str, kind: str = "VehicleCatalog") -> str:
    return f'<{kind}><Directory path="{path}"/></{kind}>'


def reference(name: str, assignments: str = "", catalog_name: str = "Cars") -> str:
    return f'<CatalogReference catalogName="{catalog_name}" entryName="{name}">{assignments}</CatalogReference>'


def assign(name: str, value: str) -> str:
    assignment = f'<ParameterAssignment parameterRef="{name}" value="{value}"/>'
    return f"<ParameterAssignments>{assignment}</ParameterAssignments>"


def test_entities_and_init_are_read_as_written(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    ego = scenario.entity("Ego")
    assert ego.vehicle_category is VehicleCategory.CAR
    assert (ego.bounding_box.length, ego.bounding_box.width, ego.bounding_box.center_x) == (4.8, 1.9, 1.4)
    assert ego.performance.max_deceleration == 9.0
    assert ego.performance.max_acceleration_rate == float("inf")
    assert ego.axles is not None
    assert ego.axles.front is not None and ego.axles.front.position_x == 2.8
    placed, driven = (item.content for item in scenario.storyboard.init.privates[0].actions)
    assert isinstance(placed, TeleportAction)
    assert isinstance(placed.position, LanePosition)
    assert (placed.position.road_id, placed.position.lane_id, placed.position.s) == ("1", -1, 50.0)
    assert isinstance(driven, SpeedAction)
    assert driven.target == AbsoluteTargetSpeed(30.0)


def test_events_triggers_and_defaults(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    found = scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maneuvers[0].events[0]
    assert (found.name, found.priority, found.maximum_execution_count) == ("faster", Priority.PARALLEL, 1)
    assert found.start_trigger is not None
    condition = found.start_trigger.groups[0].conditions[0]
    assert (condition.edge, condition.delay, condition.triggering_entities) == (ConditionEdge.NONE, 0.0, None)
    assert isinstance(condition.content, SimulationTimeCondition)
    assert (condition.content.value, condition.content.rule) == (1.0, Rule.GREATER_THAN)


def test_places_name_file_line_and_element(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    place = scenario.entity("Ego").place
    assert place.path == str(scenario.path)
    assert place.element == "ScenarioObject 'Ego'"
    assert place.line is not None
    assert 'name="Ego"' in scenario.path.read_text().splitlines()[place.line - 1]


def test_a_scenario_survives_pickling(tmp_path: Path) -> None:
    scenario = made(tmp_path)
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_parameters_are_filled_in_and_can_be_overridden(tmp_path: Path) -> None:
    text = scenario_text(
        parameters=declarations(parameter("Kmh", "108"), parameter("Speed", "${$Kmh / 3.6}")),
        init=private("Ego", teleport(), speed_action("$Speed")),
    )
    path = write_scenario(tmp_path, text)
    for overrides, expected in (({}, 30.0), ({"Kmh": "36"}, 10.0), ({"Speed": "5"}, 5.0)):
        action_read = read_scenario(path, overrides).storyboard.init.privates[0].actions[1].content
        assert isinstance(action_read, SpeedAction)
        assert isinstance(action_read.target, AbsoluteTargetSpeed)
        assert action_read.target.value == pytest.approx(expected, abs=1e-9)


def test_overriding_an_undeclared_parameter_is_refused(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, scenario_text(parameters=declarations(parameter("Speed", "1"))))
    with pytest.raises(FormatError, match=r"parameter 'Sped' is not declared \(declared: Speed\)"):
        read_scenario(path, {"Sped": "2"})


def test_constraint_groups_refuse_overrides_and_only_remark_defaults(tmp_path: Path) -> None:
    constraint = '<ConstraintGroup><ValueConstraint rule="lessThan" value="60"/></ConstraintGroup>'
    text = scenario_text(parameters=declarations(parameter("Speed", "70", constraints=constraint)))
    path = write_scenario(tmp_path, text)
    assert [note.element for note in read_scenario(path).notes] == ["ParameterDeclaration 'Speed'"]
    assert read_scenario(path, {"Speed": "59"}).notes == ()
    with pytest.raises(FormatError, match="'61' violates lessThan 60"):
        read_scenario(path, {"Speed": "61"})


def test_one_satisfied_constraint_group_suffices(tmp_path: Path) -> None:
    groups = "".join(
        f'<ConstraintGroup><ValueConstraint rule="equalTo" value="{v}"/></ConstraintGroup>' for v in ("-1", "1")
    )
    path = write_scenario(tmp_path, scenario_text(parameters=declarations(parameter("Lane", "1", "int", groups))))
    assert read_scenario(path, {"Lane": "-1"}).notes == ()
    with pytest.raises(FormatError, match="equalTo -1 or equalTo 1"):
        read_scenario(path, {"Lane": "2"})


def test_story_and_maneuver_parameters_reach_their_elements_alone(tmp_path: Path) -> None:
    inner = declarations(parameter("Target", "${$Base + 1}"))
    scenario = made(
        tmp_path,
        parameters=declarations(parameter("Base", "20")),
        stories=story(event("e", action("a", speed_action("$Target"))), maneuver_parameters=inner),
    )
    found = scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maneuvers[0].events[0].actions[0]
    assert isinstance(found.content, SpeedAction)
    assert found.content.target == AbsoluteTargetSpeed(21.0)
    assert found.scope == {"Target": "21.000000"}
    with pytest.raises(FormatError, match="parameter 'Target' is not declared"):
        made(tmp_path, stories=story(event("e", action("a", speed_action("$Target")))))


def test_catalog_entry_takes_assigned_values_in_the_scope_of_the_reference(tmp_path: Path) -> None:
    entry = vehicle("$Top", declarations(parameter("Top", "10"))).replace('name="car"', 'name="fast"')
    catalog(tmp_path / "catalogs", entry)
    parts = {"catalogs": locations("catalogs"), "parameters": declarations(parameter("Top", "77"))}
    assigned = made(tmp_path, entities=entity("Ego", reference("fast", assign("$Top", "${$Top + 1}"))), **parts)
    assert assigned.entity("Ego").performance.max_speed == 78.0
    plain = made(tmp_path, entities=entity("Ego", reference("fast")), **parts)
    assert plain.entity("Ego").performance.max_speed == 10.0
    assert plain.input_files == (plain.path, tmp_path / "catalogs" / "Cars.xosc")


def test_catalog_is_found_by_the_name_inside(tmp_path: Path) -> None:
    catalog(tmp_path / "catalogs", vehicle(), name="whatever.xosc")
    scenario = made(tmp_path, catalogs=locations("catalogs"), entities=entity("Ego", reference("car")))
    assert scenario.entity("Ego").object_name == "car"


def test_missing_entry_names_those_that_are_there(tmp_path: Path) -> None:
    catalog(tmp_path / "catalogs", vehicle())
    with pytest.raises(FormatError, match=r"catalog 'Cars' has no entry 'bus' \(it has car\)"):
        made(tmp_path, catalogs=locations("catalogs"), entities=entity("Ego", reference("bus")))


def test_a_missing_controller_catalog_is_remarked_not_refused(tmp_path: Path) -> None:
    controller = f"<ObjectController>{reference('pilot', catalog_name='Pilots')}</ObjectController>"
    scenario = made(tmp_path, entities=entity("Ego", controller=controller))
    assert [found.name for found in scenario.entity("Ego").controllers] == ["pilot"]
    assert [note.element for note in scenario.notes] == ["CatalogReference of ScenarioObject 'Ego'"]


def test_entity_selections_are_replaced_by_their_members(tmp_path: Path) -> None:
    selection = (
        '<EntitySelection name="all"><Members><ByType objectType="vehicle"/></Members></EntitySelection>'
        '<EntitySelection name="two"><Members><EntityRef entityRef="B"/><EntityRef entityRef="Ego"/></Members>'
        "</EntitySelection>"
    )
    scenario = made(
        tmp_path,
        entities=entity("Ego") + entity("B") + selection,
        stories=story(event("e", action("a", speed_action())), actors=("two",)),
    )
    assert scenario.storyboard.stories[0].acts[0].maneuver_groups[0].actors.entity_refs == ("B", "Ego")


def test_actions_of_tier_one_to_three_are_understood(tmp_path: Path) -> None:
    change = (
        "<PrivateAction><LateralAction><LaneChangeAction targetLaneOffset='0.2'>"
        '<LaneChangeActionDynamics dynamicsShape="Sinusoidal" dynamicsDimension="time" value="4"/>'
        '<LaneChangeTarget><RelativeTargetLane entityRef="Ego" value="-1"/></LaneChangeTarget>'
        "</LaneChangeAction></LateralAction></PrivateAction>"
    )
    follow = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        '<Trajectory name="t" closed="false"><Shape><Polyline>'
        '<Vertex time="0"><Position><WorldPosition x="0" y="0"/></Position></Vertex>'
        '<Vertex><Position><WorldPosition x="9" y="0" h="0.5"/></Position></Vertex>'
        "</Polyline></Shape></Trajectory></TrajectoryRef>"
        '<TimeReference><Timing domainAbsoluteRelative="relative" scale="2" offset="1"/></TimeReference>'
        '<TrajectoryFollowingMode followingMode="follow"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )
    synchronize = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>'
        '<LanePosition roadId="1" laneId="-1" s="9"/></TargetPositionMaster><TargetPosition>'
        '<LanePosition roadId="1" laneId="-2" s="8"/></TargetPosition>'
        '<FinalSpeed><AbsoluteSpeed value="7"/></FinalSpeed></SynchronizeAction></PrivateAction>'
    )
    unknown = "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"
    actions = [action(f"a{n}", text) for n, text in enumerate((change, follow, synchronize, unknown))]
    scenario = made(tmp_path, stories=story(event("e", *actions)))
    found = [
        item.content
        for item in scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maneuvers[0].events[0].actions
    ]
    assert isinstance(found[0], LaneChangeAction)
    assert found[0].target == RelativeTargetLane("Ego", -1)
    assert (found[0].dynamics.shape, found[0].target_lane_offset) == (DynamicsShape.SINUSOIDAL, 0.2)
    assert isinstance(found[1], FollowTrajectoryAction)
    assert isinstance(found[1].trajectory.shape, Polyline)
    assert [vertex.time for vertex in found[1].trajectory.shape.vertices] == [0.0, None]
    assert found[1].timing is not None
    assert (found[1].timing.scale, found[1].timing.offset) == (2.0, 1.0)
    assert isinstance(found[2], SynchronizeAction)
    assert isinstance(found[3], Unsupported)
    assert found[3].kind == "RandomRouteAction"


def test_entity_conditions_hold_their_triggering_entities(tmp_path: Path) -> None:
    condition = (
        '<ConditionGroup><Condition name="c" delay="1.5" conditionEdge="rising"><ByEntityCondition>'
        '<TriggeringEntities triggeringEntitiesRule="all"><EntityRef entityRef="Ego"/></TriggeringEntities>'
        '<EntityCondition><TimeHeadwayCondition entityRef="B" value="2" freespace="true" rule="lessThan" '
        'alongRoute="true"/></EntityCondition></ByEntityCondition></Condition></ConditionGroup>'
    )
    scenario = made(tmp_path, entities=entity("Ego") + entity("B"), stop=condition)
    assert scenario.storyboard.stop_trigger is not None
    found = scenario.storyboard.stop_trigger.groups[0].conditions[0]
    assert (found.delay, found.edge) == (1.5, ConditionEdge.RISING)
    assert found.triggering_entities is not None
    assert found.triggering_entities.entity_refs == ("Ego",)
    assert isinstance(found.content, TimeHeadwayCondition)
    assert found.content.along_route is True


def test_siblings_of_the_folder_and_of_its_parent_are_allowed(tmp_path: Path) -> None:
    deep = tmp_path / "suite" / "scenarios" / "xosc"
    for up in ("../xodr", "../../xodr"):
        road = (deep / up).resolve()
        path = write_scenario(deep, scenario_text(road=f"{up}/road.xodr"))
        road.mkdir()
        (deep / "road.xodr").rename(road / "road.xodr")
        assert read_scenario(path).road_file == road / "road.xodr"


def test_a_folder_further_up_has_to_be_allowed(tmp_path: Path) -> None:
    path = write_scenario(tmp_path / DEEP, scenario_text(road=f"{UP}roads/far.xodr"))
    roads = tmp_path / "roads"
    roads.mkdir()
    (roads / "far.xodr").write_bytes((path.parent / "road.xodr").read_bytes())
    with pytest.raises(FormatError, match="lies outside the scenario's folders"):
        read_scenario(path)
    assert read_scenario(path, allowed=[roads]).road_file == roads / "far.xodr"


def test_a_link_out_of_the_folders_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / DEEP
    path = write_scenario(folder, scenario_text(road="linked/far.xodr"))
    roads = tmp_path / "roads"
    roads.mkdir()
    (roads / "far.xodr").write_text("<OpenDRIVE/>")
    (folder / "linked").symlink_to(roads)
    with pytest.raises(FormatError, match="lies outside"):
        read_scenario(path)


def test_a_stale_road_path_falls_back_to_the_name_beside_the_scenario_with_a_remark(tmp_path: Path) -> None:
    scenario = made(tmp_path, road="c:/somebody/else/road.xodr")
    assert scenario.road_file == tmp_path / "road.xodr"
    assert [note.element for note in scenario.notes] == ["LogicFile"]


def test_a_forged_provenance_opens_no_file_elsewhere(tmp_path: Path) -> None:
    roads = tmp_path / "roads"
    roads.mkdir()
    road = roads / "far.xodr"
    text = scenario_text(road=f"{UP}roads/far.xodr")
    path = write_scenario(tmp_path / DEEP, text)
    road.write_bytes((path.parent / "road.xodr").read_bytes())
    digest = hashlib.sha256(road.read_bytes()).hexdigest()
    marked = f'<!-- xosc-lateral provenance: {{"inputs": {{"far.xodr": "{digest}"}}}} --><FileHeader'
    path.write_text(text.replace("<FileHeader", marked))
    with pytest.raises(FormatError, match="lies outside"):
        read_scenario(path)
    assert read_scenario(path, allowed=[roads]).road_file == road


def test_external_entity_reads_nothing(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("do not read me")
    text = scenario_text().replace(
        "<!-- licence -->", f'<!DOCTYPE OpenSCENARIO [<!ENTITY s SYSTEM "{secret.as_uri()}">]>'
    )
    path = write_scenario(tmp_path, text.replace('description="test"', 'description="&s;"'))
    with pytest.raises(FormatError) as refused:
        read_scenario(path)
    assert "do not read" not in str(refused.value)


def test_missing_file_and_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no such file"):
        read_scenario(tmp_path / "nothing.xosc")
    with pytest.raises(FormatError, match="is a folder, not a file"):
        read_scenario(tmp_path)


def test_stop_trigger_may_be_missing_from_1_3_on(tmp_path: Path) -> None:
    text = scenario_text(minor=3)
    cut = text[: text.index("<StopTrigger>")] + text[text.index("</StopTrigger>") + len("</StopTrigger>") :]
    assert read_scenario(write_scenario(tmp_path, cut)).storyboard.stop_trigger is None


def test_a_changed_file_is_read_anew(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, scenario_text())
    assert read_scenario(path).header.description == "test"
    path.write_text(scenario_text().replace('description="test"', 'description="changed"'))
    assert read_scenario(path).header.description == "changed"


def test_later_versions_are_read_as_the_newest_known(tmp_path: Path) -> None:
    scenario = read_scenario(write_scenario(tmp_path, scenario_text(minor=7, stop=time_condition(3))))
    assert scenario.header.version == (1, 7)
    assert [note.element for note in scenario.notes] == ["OpenSCENARIO"]


TRAJECTORY = (
    '<Trajectory name="way" closed="false">' + declarations(parameter("Far", "50")) + "<Shape><Polyline>"
    '<Vertex><Position><WorldPosition x="0" y="0"/></Position></Vertex>'
    '<Vertex><Position><WorldPosition x="$Far" y="0"/></Position></Vertex></Polyline></Shape></Trajectory>'
)
ROUTE = (
    '<Route name="way" closed="false">' + declarations(parameter("Far", "50")) + '<Waypoint routeStrategy="shortest">'
    '<Position><LanePosition roadId="1" laneId="-1" s="0"/></Position></Waypoint><Waypoint routeStrategy="shortest">'
    '<Position><LanePosition roadId="1" laneId="-1" s="$Far"/></Position></Waypoint></Route>'
)


@pytest.mark.parametrize("assigned", [None, "80"])
def test_a_trajectory_and_a_route_of_a_catalog_take_assigned_values(tmp_path: Path, assigned: str | None) -> None:
    catalog(tmp_path / "catalogs", TRAJECTORY, name="Ways.xosc")
    catalog(tmp_path / "routes", ROUTE, name="Routes.xosc")
    for folder, name in (("catalogs", "Ways"), ("routes", "Routes")):
        path = tmp_path / folder / f"{name}.xosc"
        path.write_text(path.read_text().replace('name="Cars"', f'name="{name}"'))
    given = "" if assigned is None else assign("Far", assigned)
    follow = (
        f"<PrivateAction><RoutingAction><FollowTrajectoryAction>{reference('way', given, catalog_name='Ways')}"
        '<TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )
    route = (
        f"<PrivateAction><RoutingAction><AssignRouteAction>{reference('way', given, catalog_name='Routes')}"
        "</AssignRouteAction></RoutingAction></PrivateAction>"
    )
    both = locations("catalogs", "TrajectoryCatalog") + locations("routes", "RouteCatalog")
    scenario = made(tmp_path, catalogs=both, stories=story(event("e", action("a", follow), action("b", route))))
    first, second = scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maneuvers[0].events[0].actions
    far = 50.0 if assigned is None else 80.0
    assert isinstance(first.content, FollowTrajectoryAction)
    assert isinstance(second.content, AssignRouteAction)
    assert isinstance(first.content.trajectory.shape, Polyline)
    assert first.content.trajectory.shape.vertices[1].position.x == far  # type: ignore[union-attr]
    assert second.content.route.waypoints[1].position.s == far  # type: ignore[union-attr]


@pytest.mark.parametrize(("tag", "said"), [("TrailerRef", []), ("EntityRef", []), ("CatalogReference", ["Ego"])])
def test_a_trailer_is_named_as_the_standard_does_or_as_before_it(tmp_path: Path, tag: str, said: list[str]) -> None:
    hitched = vehicle().replace("</Vehicle>", f'<Trailer><{tag} entityRef="Box"/></Trailer></Vehicle>')
    scenario = made(tmp_path, entities=entity("Ego", hitched) + entity("Box", vehicle()))
    assert scenario.entity("Ego").trailer == (None if said else "Box")
    assert [note.what for note in scenario.notes] == [f"a trailer of '{name}' by a {tag} is not read" for name in said]


@pytest.mark.parametrize("folder", ["", "/nobody/has/this/folder"])
def test_a_missing_vehicle_catalog_costs_a_remark_and_a_usual_car(tmp_path: Path, folder: str) -> None:
    parts = {"entities": entity("Ego", reference("sports car"))}
    if folder:
        parts["catalogs"] = locations(folder, "VehicleCatalog")
    scenario = made(tmp_path, **parts)
    assert scenario.entity("Ego").bounding_box.length == 5.0
    assert "'Ego' is played as a car of usual size" in scenario.notes[0].what
    with pytest.raises(FormatError, match="catalog 'Cars' not found"):
        read_scenario(scenario.path, strict=True)


def test_an_empty_action_is_nothing(tmp_path: Path) -> None:
    scenario = made(tmp_path, stories=story(event("e", '<Action name="idle"/>')))
    assert scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maneuvers[0].events[0].actions == ()


def test_what_field_files_leave_out_is_taken_as_meant_and_said(tmp_path: Path) -> None:
    text = scenario_text(init=private("Ego", teleport(), "<PrivateAction></PrivateAction>"))
    text = text.replace('vehicleCategory="car"', 'vehicleCategory="EgoCar"').replace('revMinor="2"', 'revMinor="1+"')
    path = write_scenario(tmp_path, "<!-- before the declaration -->\n" + text)
    scenario = read_scenario(path)
    assert (scenario.header.minor, scenario.entities[0].vehicle_category) == (1, VehicleCategory.CAR)
    said = "; ".join(note.what for note in scenario.notes)
    assert "taken as a car" in said and "contains no action" in said


def test_a_truth_value_in_capitals_is_remarked_once_for_each_word(tmp_path):
    condition = (
        '<ConditionGroup><Condition name="near" delay="0" conditionEdge="none"><ByEntityCondition>'
        '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>'
        '<EntityCondition><TimeHeadwayCondition entityRef="Ego" value="1" freespace="True" rule="lessThan"/>'
        "</EntityCondition></ByEntityCondition></Condition></ConditionGroup>"
    )
    (note,) = [note for note in made(tmp_path, stop=2 * condition).notes if "freespace" in note.what]
    assert "freespace='True' is read as true (2 times)" in note.what
