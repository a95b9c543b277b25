"""Which controller drives which domain, by the names that players know, and since when."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.scenario_files import action, entity, made, private, speed_action, story, teleport
from tests.kit.scenario_files import event as timed_event
from xosc_lateral.world.scenario.controllers import (
    Domains,
    DrivingControllers,
    controlled_entities,
    kind_of,
    vehicles_under_test,
)
from xosc_lateral.world.scenario.dependence import dependence
from xosc_lateral.world.scenario.entity import Controller
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.private_actions import (
    ActivateControllerAction,
    AssignControllerAction,
    OverrideControllerValueAction,
)

HERE = Place("made.xosc", 1, "Controller")
ALONG, ACROSS, BOTH, NOTHING = Domains.LONGITUDINAL, Domains.LATERAL, Domains.BOTH, Domains.NONE


def one(name: str, **properties: str) -> Controller:
    return Controller(name, HERE, properties)


def activate(*, lateral: bool | None = None, longitudinal: bool | None = None, ref: str | None = None) -> object:
    return ActivateControllerAction(lateral, longitudinal, ref, place=HERE)


@pytest.mark.parametrize(
    ("controller", "drives", "is_external"),
    [
        (one("any", esminiController="ACCController"), ALONG, False),
        (one("acccontroller"), ALONG, False),
        (one("any", ESMINICONTROLLER="externalcontroller"), BOTH, True),
        (one("ExternalController"), BOTH, True),
        (one("ExternalController", esminiController="ACCController"), ALONG, False),
        (one("any", esminiController="ControllerRel2Abs"), NOTHING, False),
        (one("any", module="external_control"), BOTH, True),
        (one("any", module="srunner/scenariomanager/actorcontrols/carla_autopilot.py"), BOTH, False),
        (one("any", module="npc_vehicle_control"), NOTHING, False),
        (one("any", module="simple_vehicle_control"), NOTHING, False),
        (one("any", module="simple_vehicle_control", consider_obstacles="false"), NOTHING, False),
        (one("any", module="simple_vehicle_control", consider_obstacles="true"), ALONG, False),
        (one("any", module="simple_vehicle_control", max_deceleration="4"), ALONG, False),
        (one("our driver", version="3"), BOTH, False),
        (one("any", module="our_control.py"), BOTH, False),
    ],
)  # fmt: skip
def test_a_controller_is_known_by_its_players_property_else_by_its_name(
    controller: Controller, drives: Domains, is_external: bool
) -> None:
    kind = kind_of(controller)
    assert (kind.drives, kind.is_external) == (drives, is_external)


def test_a_controller_drives_where_it_is_active_and_a_domain_has_one_driver() -> None:
    driver, acc = one("driver"), one("ACCController")
    controllers = DrivingControllers([driver, acc], for_carla=False)
    assert controllers.domains is NOTHING and controllers.words() == ""
    controllers.follow(activate(lateral=True, longitudinal=True, ref="driver"))
    assert controllers.words() == "'driver' along and across the road"
    controllers.follow(activate(longitudinal=True, lateral=False, ref="ACCController"))
    assert controllers.words() == "'driver' across the road, 'ACCController' along the road"
    controllers.follow(activate(lateral=False, ref="driver"))
    assert controllers.domains is ALONG
    controllers.follow(activate(longitudinal=False))  # the last one that was assigned
    assert controllers.domains is NOTHING


def test_who_activates_an_acc_across_the_road_gets_nothing_and_a_natural_driver_changes_lanes_all_the_same() -> None:
    acc = DrivingControllers([one("ACCController")], for_carla=False)
    acc.follow(activate(lateral=True))
    assert acc.domains is NOTHING
    natural = DrivingControllers([one("NaturalDriver")], for_carla=False)
    natural.follow(activate(longitudinal=True, lateral=False))
    assert natural.domains is BOTH


def test_an_assignment_activates_where_it_says_so_and_in_carla_at_once() -> None:
    controllers = DrivingControllers([], for_carla=False)
    controllers.follow(AssignControllerAction(one("ours"), True, None, place=HERE))
    assert controllers.domains is ACROSS
    controllers.follow(AssignControllerAction(one("any", module="vehicle_longitudinal_control"), place=HERE))
    assert controllers.domains is ALONG
    controllers.follow(AssignControllerAction(one("any", module="npc_vehicle_control"), place=HERE))
    assert controllers.domains is NOTHING


def test_to_override_a_controllers_pedals_is_to_drive() -> None:
    controllers = DrivingControllers([one("ours")], for_carla=False)
    controllers.follow(OverrideControllerValueAction((("Brake", True, 1.0), ("SteeringWheel", False, 0.0)), place=HERE))
    assert controllers.domains is ALONG
    controllers.follow(OverrideControllerValueAction((("Brake", False, 0.0),), place=HERE))
    assert controllers.domains is NOTHING


def test_in_a_file_for_carla_an_activation_is_the_autopilots() -> None:
    controllers = DrivingControllers([], for_carla=True)
    controllers.follow(activate(longitudinal=True))
    assert controllers.words() == "'CARLA's autopilot' along and across the road"
    controllers.follow(activate(longitudinal=False))
    assert controllers.domains is NOTHING


def object_controller(name: str, properties: str = "") -> str:
    made_properties = f"<Properties>{properties}</Properties>"
    return f'<ObjectController><Controller name="{name}">{made_properties}</Controller></ObjectController>'


def activation(**flags: str) -> str:
    said = " ".join(f'{name}="{value}"' for name, value in flags.items())
    return f"<PrivateAction><ControllerAction><ActivateControllerAction {said}/></ControllerAction></PrivateAction>"


def test_an_entity_is_controlled_if_something_activates_its_controller_at_any_time(tmp_path: Path) -> None:
    on = timed_event("on", action("on", activation(longitudinal="true", lateral="true")), time=4.0)
    for events, found in (((), {}), ((on,), {"Ego": "'ACCController': along the road"})):
        scenario = made(
            tmp_path,
            entities=entity("Ego", controller=object_controller("ACCController")),
            stories=story(timed_event("own", action("own", speed_action("33"))), *events),
        )
        assert {name: str(control) for name, control in controlled_entities(scenario).items()} == found


def test_an_external_controller_by_its_name_alone_leaves_the_vehicle_to_somebody_else(tmp_path: Path) -> None:
    scenario = made(tmp_path, entities=entity("Ego", controller=object_controller("ExternalController")))
    assert vehicles_under_test(scenario) == {"Ego": "controller 'ExternalController'"}


def test_a_vehicle_whose_controller_never_drives_depends_on_nobody(tmp_path: Path) -> None:
    names = ("Ego", "Other")
    scenario = made(
        tmp_path,
        entities=entity("Ego") + entity("Other", controller=object_controller("dummy")),
        init="".join(private(name, teleport(s)) for name, s in zip(names, ("50", "90"), strict=True)),
    )
    assert dependence(scenario, {"Ego"}).entities == {"Ego"}
