"""Who is under test, and what depends on them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.scenario_files import action, entity, made, private, speed_action, teleport, vehicle
from xosc_lateral.world.scenario.controllers import vehicles_under_test
from xosc_lateral.world.scenario.dependence import dependence
from xosc_lateral.world.scenario.scenario import Scenario

CONTROLLER = (
    '<ObjectController><Controller name="c"><Properties><Property name="{name}" value="{value}"/></Properties>'
    "</Controller></ObjectController>"
)

CARLA_EGO = '<Properties><Property name="type" value="ego_vehicle"/></Properties>'


def controller(name: str, value: str) -> str:
    return CONTROLLER.format(name=name, value=value)


@pytest.mark.parametrize(
    ("made_entity", "is_one"),
    [
        (entity("Car", controller=controller("esminiController", "ExternalController")), True),
        (entity("Car", controller=controller("esminiController", "UDPDriverController")), True),
        (entity("Car", controller=controller("module", "external_control")), True),
        (entity("Car", vehicle().replace("<Properties/>", CARLA_EGO)), True),
        (entity("Car", controller=controller("esminiController", "ACCController")), False),
        (entity("Car"), False),
    ],
    ids=["external", "udp", "carla", "carla type", "acc", "nobody"],
)  # fmt: skip
def test_a_vehicle_that_somebody_else_drives_is_found_by_what_says_so(
    tmp_path: Path, made_entity: str, is_one: bool
) -> None:
    own = stories(("Car", event("own", at(1.0), speed_action())))
    scenario = made(tmp_path, entities=made_entity, init=private("Car"), stories=own)
    assert bool(vehicles_under_test(scenario)) == is_one


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        *((name, True) for name in ("Ego", "ego", "EGO", "hero", "ego_vehicle", "EgoVehicle", "Ego2", "ego_vehicle_1")),
        *((name, True) for name in ("VUT", "SUT", "Host", "host vehicle", "SubjectVehicle", "subject_vehicle")),
        *((name, True) for name in ("VehicleUnderTest", "vehicle_under_test", "SystemUnderTest", "Ego_Truck", "DUT")),
        *((name, True) for name in ("EgoTruck", "EGO_VUT", "Ego_VW", "CarEgo")),
        *((name, False) for name in ("EgoTarget", "Ego_Ghost", "GVT", "Hostile")),
        *((name, False) for name in ("Egon", "Lego", "subject", "Target", "hostile", "Car1", "hero_truck_driver")),
    ],
)
def test_the_names_of_the_field_say_it_too(tmp_path: Path, name: str, is_one: bool) -> None:
    own = stories((name, event("own", at(1.0), speed_action())))
    scenario = made(tmp_path, entities=entity(name), init=private(name), stories=own)
    assert vehicles_under_test(scenario) == ({name: "by its name"} if is_one else {})


def test_a_mark_says_it_before_a_name(tmp_path: Path) -> None:
    external = entity("Car", controller=controller("esminiController", "ExternalController"))
    scenario = made(tmp_path, entities=entity("Ego") + external, init=private("Ego") + private("Car"))
    assert list(vehicles_under_test(scenario)) == ["Car"]


def event(name: str, trigger: str, content: str) -> str:
    return (
        f'<Event name="{name}" priority="parallel" maximumExecutionCount="1">{action(name + " action", content)}'
        f'<StartTrigger><ConditionGroup><Condition name="{name} when" delay="0" conditionEdge="none">{trigger}'
        "</Condition></ConditionGroup></StartTrigger></Event>"
    )


def headway(who: str, other: str) -> str:
    return (
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{who}"/>'
        f'</TriggeringEntities><EntityCondition><TimeHeadwayCondition entityRef="{other}" value="1" rule="lessThan" '
        'freespace="true" alongRoute="false"/></EntityCondition></ByEntityCondition>'
    )


def at(moment: float) -> str:
    return f'<ByValueCondition><SimulationTimeCondition value="{moment}" rule="greaterThan"/></ByValueCondition>'


def state(reference: str, of: str) -> str:
    return (
        f'<ByValueCondition><StoryboardElementStateCondition storyboardElementType="event" '
        f'storyboardElementRef="{reference}" state="{of}"/></ByValueCondition>'
    )


def stories(*groups: tuple[str, str]) -> str:
    """An act with a maneuver group for each (actor, events)."""
    made_groups = "".join(
        f'<ManeuverGroup name="{actor} group" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">'
        f'<EntityRef entityRef="{actor}"/></Actors>'
        f'<Maneuver name="{actor} maneuver">{events}</Maneuver></ManeuverGroup>'
        for actor, events in groups
    )
    start = f'<ConditionGroup><Condition name="t" delay="0" conditionEdge="none">{at(-1)}</Condition></ConditionGroup>'
    return f'<Story name="story"><Act name="act">{made_groups}<StartTrigger>{start}</StartTrigger></Act></Story>'


def four(folder: Path, *groups: tuple[str, str]) -> Scenario:
    """Ego and three others, some of them with maneuvers."""
    names = ("Ego", "A", "B", "C")
    return made(
        folder,
        entities="".join(entity(name) for name in names),
        init="".join(private(name, teleport(str(50 * k + 50)), speed_action()) for k, name in enumerate(names)),
        stories=stories(*groups),
    )


def test_dependence_goes_through_others_and_their_events_and_no_further(tmp_path: Path) -> None:
    scenario = four(
        tmp_path,
        ("A", event("brake", headway("A", "Ego"), speed_action("20"))),
        ("B", event("follow", state("brake", "completeState"), speed_action("20"))),
        ("C", event("clock", at(3.0), speed_action("20"))),
    )
    assert dependence(scenario, {"Ego"}).entities == {"Ego", "A", "B"}
    assert dependence(scenario, ()).entities == set()


def test_who_looks_at_a_dependent_vehicle_depends(tmp_path: Path) -> None:
    scenario = four(
        tmp_path,
        ("C", event("third", headway("C", "B"), speed_action("20"))),
        ("B", event("second", headway("B", "A"), speed_action("20"))),
        ("A", event("first", headway("Ego", "A"), speed_action("20"))),
    )
    assert dependence(scenario, {"Ego"}).entities == {"Ego", "A", "B", "C"}


def test_when_an_event_of_the_ego_begins_by_the_clock_is_known_and_when_it_ends_is_not(tmp_path: Path) -> None:
    def entities(of: str) -> set[str]:
        return dependence(
            four(
                tmp_path,
                ("Ego", event("own", at(2.0), speed_action("20"))),
                ("A", event("hook", state("own", of), speed_action("20"))),
            ),
            {"Ego"},
        ).entities

    assert entities("startTransition") == {"Ego"}
    assert entities("completeState") == {"Ego", "A"}
