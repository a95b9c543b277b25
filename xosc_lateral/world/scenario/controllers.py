"""Controllers: which of a vehicle's domains each drives, by the names that players know it by, and since when."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntFlag
from functools import reduce
from operator import or_

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.base.grouping import grouped
from xosc_lateral.world.scenario import private_actions
from xosc_lateral.world.scenario.entity import Controller, Entity
from xosc_lateral.world.scenario.scenario import Action, Scenario


class Domains(IntFlag):
    """Domains of a vehicle's motion, as the standard calls them."""

    NONE = 0
    LONGITUDINAL = 1
    LATERAL = 2
    BOTH = 3

    def words(self) -> str:
        """In words."""
        return ("nothing", "along the road", "across the road", "along and across the road")[self]


class ControllerKind(Struct, frozen=True):
    """What a controller is."""

    name: str  # as its player calls it; as the file does where nobody knows it
    drives: Domains = Domains.BOTH  # it can drive these, and does in those in which it is active
    is_external: bool = False  # a program outside of the scenario drives
    as_a_whole: bool = False  # active in one domain, it drives all of its own
    at_once: bool = False  # active from its assignment on

    def active(self, asked: Domains) -> Domains:
        """What it drives where it was activated in these domains."""
        return self.drives if asked & self.drives and self.as_a_whole else asked & self.drives


def _by_name(*kinds: ControllerKind) -> dict[str, ControllerKind]:
    return {kind.name.lower(): kind for kind in kinds}


ESMINI: Mapping[str, ControllerKind] = _by_name(
    # esmini 3.6.0, EnvironmentSimulator/Modules/Controllers: names from the headers, domains from `operating_domains_`
    # and from what each `Step` writes, whatever it is active in.
    ControllerKind("ACCController", Domains.LONGITUDINAL),
    ControllerKind("ALKSController"),
    # Keeps the offset that it finds, and takes a speed sideways of its own for the other's (`dv_t`).
    ControllerKind("ALKS_R157SM_Controller", as_a_whole=True),
    ControllerKind("ECE_ALKS_RefDriverController"),
    ControllerKind("ExternalController", is_external=True),
    ControllerKind("FollowGhostController", as_a_whole=True),
    ControllerKind("FollowReferenceController", as_a_whole=True),
    ControllerKind("FollowRouteController", as_a_whole=True),  # stops and changes lanes on its own
    ControllerKind("HIDController", as_a_whole=True),  # a person
    ControllerKind("InteractiveController"),  # a person
    ControllerKind("LoomingController", as_a_whole=True),  # is registered as longitudinal, and steers
    ControllerKind("NaturalDriver", as_a_whole=True),  # is registered as longitudinal, and changes lanes
    ControllerKind("OffroadFollower", as_a_whole=True),
    ControllerKind("SloppyDriverController"),
    ControllerKind("SumoController", as_a_whole=True, at_once=True),
    ControllerKind("UDPDriverController", is_external=True, as_a_whole=True),
    ControllerKind("ControllerRel2Abs", Domains.NONE),  # exchanges actions for others of the same motion
    ControllerKind("DefaultController", Domains.NONE),
)
"""By the value of the property `esminiController`, or by the controller's own name."""

SCENARIO_RUNNER: Mapping[str, ControllerKind] = _by_name(
    # CARLA's ScenarioRunner, srunner/scenariomanager/actorcontrols: an assigned module drives from then on.
    ControllerKind("external_control", is_external=True, at_once=True),
    ControllerKind("carla_autopilot", at_once=True),
    ControllerKind("vehicle_longitudinal_control", Domains.LONGITUDINAL, at_once=True),
    # They go where the storyboard says: actor_control.py gives the first and the last to whoever has no controller.
    ControllerKind("npc_vehicle_control", Domains.NONE, at_once=True),
    ControllerKind("simple_vehicle_control", Domains.NONE, at_once=True),
    ControllerKind("vehicle_velocity_control", Domains.NONE, at_once=True),
    ControllerKind("vehicle_teleport_control", Domains.NONE, at_once=True),
    ControllerKind("pedestrian_control", Domains.NONE, at_once=True),
)
"""By the value of the property `module`."""

OBSTACLES = frozenset({"consider_obstacles", "consider_trafficlights"})
LIMITS = frozenset({"max_acceleration", "max_deceleration"})
"""Properties with which a `simple_vehicle_control` has a speed of its own: truth values, and numbers."""

AUTOPILOT = ControllerKind("CARLA's autopilot", as_a_whole=True)
"""What an ActivateControllerAction turns on and off in ScenarioRunner (openscenario_support.md)."""


def kind_of(controller: Controller) -> ControllerKind:
    """By the property of its player, else by its own name; a controller that nobody knows drives both domains."""
    properties = {name.strip().lower(): value.strip() for name, value in controller.properties.items()}
    if name := properties.get("esminicontroller", ""):
        return ESMINI.get(name.lower(), ControllerKind(name))
    if "module" in properties:
        module = properties["module"].replace("\\", "/").rpartition("/")[2].removesuffix(".py").rpartition(".")[2]
        kind = SCENARIO_RUNNER.get(module.lower(), ControllerKind(module, at_once=True))
        on = any(properties.get(name, "").lower() in ("1", "true", "yes", "y", "t", "on") for name in OBSTACLES)
        if kind.name == "simple_vehicle_control" and (on or LIMITS & properties.keys()):
            return replace(kind, drives=Domains.LONGITUDINAL)
        return kind
    return ESMINI.get(controller.name.strip().lower(), ControllerKind(controller.name))


def switches(content: object) -> Iterator[tuple[Domains, bool]]:
    """Domains that an action switches on or off; to override pedals or the wheel is to drive, too."""
    switched: tuple[tuple[Domains, bool | None], ...] = ()
    match content:
        case private_actions.AssignControllerAction():
            lateral, longitudinal = content.activate_lateral, content.activate_longitudinal
            switched = (Domains.LONGITUDINAL, longitudinal), (Domains.LATERAL, lateral)
        case private_actions.ActivateControllerAction():
            switched = (Domains.LONGITUDINAL, content.longitudinal), (Domains.LATERAL, content.lateral)
        case private_actions.OverrideControllerValueAction():
            switched = tuple(
                (Domains.LATERAL if "steering" in name.lower() else Domains.LONGITUDINAL, active)
                for name, active, _ in content.overrides
            )
    return ((domain, on) for domain, on in switched if on is not None)


def gives(content: object, domains: Domains) -> bool | None:
    """Whether an action gives one of these domains to a controller, or takes all of them back; None: neither."""
    if isinstance(content, private_actions.AssignControllerAction) and content.controller is not None:
        kind = kind_of(content.controller)
        if kind.at_once:
            return bool(domains & kind.drives)
    switched = dict(switches(content))
    on, off = (reduce(or_, (d for d in switched if switched[d] is way), Domains.NONE) for way in (True, False))
    return True if domains & on else False if domains & off == domains else None


def is_meant(controller: Controller, content: object) -> bool:
    """Whether an activation may be of this controller: it names it, or none."""
    name = content.controller_ref if isinstance(content, private_actions.ActivateControllerAction) else None
    return not name or name in (controller.object_name, controller.name)


@dataclass(slots=True)
class _Assigned:
    controller: Controller
    kind: ControllerKind
    asked: Domains = Domains.NONE


class DrivingControllers:
    """Controllers of one entity in the course of a run; `for_carla`: an activation is of CARLA's autopilot."""

    def __init__(self, controllers: Iterable[Controller], *, for_carla: bool) -> None:
        self._for_carla = for_carla
        self._assigned = list[_Assigned]()
        self._overridden = Domains.NONE
        for controller in controllers:
            self._assign(controller)

    def follow(self, content: object) -> None:
        """An action on controllers has begun."""
        if isinstance(content, private_actions.AssignControllerAction) and content.controller is not None:
            self._assign(content.controller)
        if isinstance(content, private_actions.OverrideControllerValueAction):
            self._overridden = reduce(or_, _switched_on([content]), Domains.NONE)
            return
        if self._for_carla and isinstance(content, private_actions.ActivateControllerAction):
            self._assigned = [assigned for assigned in self._assigned if assigned.kind is not AUTOPILOT]
            self._assigned.append(_Assigned(Controller(AUTOPILOT.name, content.place), AUTOPILOT))
        meant = next((each for each in reversed(self._assigned) if is_meant(each.controller, content)), None)
        if meant is None:
            return
        for domain, on in switches(content):
            for assigned in self._assigned if on else [meant]:  # a domain has one driver
                assigned.asked &= ~domain
            meant.asked |= domain if on else Domains.NONE

    @property
    def domains(self) -> Domains:
        """What they drive now."""
        driven = (assigned.kind.active(assigned.asked | self._overridden) for assigned in self._assigned)
        return reduce(or_, driven, Domains.NONE)

    def words(self) -> str:
        """Who drives what now; empty: nobody."""
        driving = ((one, one.kind.active(one.asked | self._overridden)) for one in self._assigned)
        return ", ".join(f"{named(one.controller)} {domains.words()}" for one, domains in driving if domains)

    def _assign(self, controller: Controller) -> None:
        kind = kind_of(controller)
        self._assigned = [assigned for assigned in self._assigned if assigned.controller != controller]
        for assigned in self._assigned if kind.at_once else ():
            assigned.asked = Domains.NONE
        self._assigned.append(_Assigned(controller, kind, Domains.BOTH if kind.at_once else Domains.NONE))


def named(controller: Controller) -> str:
    """By its own name, and as its player calls it."""
    kind = kind_of(controller).name
    return f"'{controller.name}'" + ("" if kind.lower() == controller.name.strip().lower() else f" ({kind})")


# ---- vehicles that the storyboard does not drive: those under test, and those that a controller has ----
EXTERNAL_ENTITIES: Mapping[str, frozenset[str]] = {
    # CARLA's ScenarioRunner, openscenario_configuration.py: ego vehicles are those of this type.
    "type": frozenset({"ego_vehicle"}),
}
"""Property of a vehicle -> values that leave it to somebody else; both in lower case."""

_WORDS, _KINDS = "ego|hero|vut|sut|dut|host", "vehicle|car|truck|van|bus|vut|sut"
NAMED_UNDER_TEST = re.compile(
    rf"(({_WORDS})[ _-]?({_KINDS})?|ego[ _-][a-z]{{2}}|(vehicle|car|truck)[ _-]?ego|subject[ _-]?(vehicle|car)"
    r"|(vehicle|system|device|car)[ _-]?under[ _-]?test)[ _-]?\d*",
    re.IGNORECASE,
)
"""What the field calls the vehicle under test: esmini and CARLA (`hero`, `ego_vehicle`), Euro NCAP (VUT), UN R157
(ego), ISO 34501 (subject vehicle), ASAM OSI (host vehicle); two letters behind a dash are a maker's (`Ego_VW`)."""

NEARLY_NAMED = re.compile(r"(^|[^a-z])(ego|hero|vut|sut|dut)([^a-z]|$)", re.IGNORECASE)
"""A name with such a word in it, which may say who drives beside the vehicle under test (`Ego_Ghost`)."""


BY_NAME = "by its name"
"""Why a vehicle is under test that nothing marks."""


def is_named_under_test(name: str) -> bool:
    """Whether an entity's name is one of those for a vehicle under test."""
    return NAMED_UNDER_TEST.fullmatch(name.strip()) is not None


def vehicles_under_test(scenario: Scenario) -> dict[str, str]:
    """Vehicles that the scenario leaves to somebody else, in its order, and what says so.

    A mark for another program (a controller, a property) says it first; without any, the name does.
    """
    assigned = assigned_controllers(scenario)
    vehicles = [entity for entity in scenario.entities if entity.is_vehicle]
    marked = {entity.name: _mark(entity, assigned[entity.name]) for entity in vehicles}
    return {name: why for name, why in marked.items() if why} or named_under_test(scenario)


def named_under_test(scenario: Scenario) -> dict[str, str]:
    """Vehicles whose name says that they are under test, in the scenario's order, and what says so."""
    names = (entity.name for entity in scenario.entities if entity.is_vehicle)
    return {name: BY_NAME for name in names if is_named_under_test(name)}


@dataclass(frozen=True, slots=True)
class Control:
    """Controllers that drive an entity at some time: their names, and the domains that they have then."""

    controllers: tuple[str, ...]
    domains: Domains

    def __str__(self) -> str:
        return f"{' and '.join(self.controllers)}: {self.domains.words()}"


def controlled_entities(scenario: Scenario) -> dict[str, Control]:
    """Entities that controllers drive at some time, by an action that makes them active, in the scenario's order."""
    assigned = assigned_controllers(scenario)
    actions = grouped(
        (actor, action.content)
        for actors, action in _private_actions(scenario)
        if isinstance(action.content, private_actions.CONTROLLER)
        for actor in actors
    )
    reasons = {}
    for entity in scenario.entities:
        names, domains = dict[str, None](), Domains.NONE
        contents = actions.get(entity.name, [])
        for controller in assigned[entity.name]:
            kind = kind_of(controller)
            switched = _switched_on(content for content in contents if is_meant(controller, content))
            asked = reduce(or_, switched, Domains.BOTH if kind.at_once else Domains.NONE)
            if kind.active(asked):
                names[named(controller)] = None
                domains |= kind.active(asked)
        activations = (content for content in contents if isinstance(content, private_actions.ActivateControllerAction))
        if scenario.header.is_left_handed and any(_switched_on(activations)):
            names[AUTOPILOT.name] = None
            domains = Domains.BOTH
        if domains:
            reasons[entity.name] = Control(tuple(names), domains)
    return reasons


def driven_from_the_start(scenario: Scenario) -> dict[str, Domains]:
    """Domains of each entity that controllers have when the storyboard begins."""
    for_carla = scenario.header.is_left_handed
    driving = {one.name: DrivingControllers(one.controllers, for_carla=for_carla) for one in scenario.entities}
    for private in scenario.storyboard.init.privates:
        for action in private.actions:
            if isinstance(action.content, private_actions.CONTROLLER) and private.entity_ref in driving:
                driving[private.entity_ref].follow(action.content)
    return {name: controllers.domains for name, controllers in driving.items() if controllers.domains}


def _switched_on(contents: Iterable[object]) -> Iterator[Domains]:
    return (domain for content in contents for domain, on in switches(content) if on)


def assigned_controllers(scenario: Scenario) -> dict[str, list[Controller]]:
    """Controllers of each entity, from the start or later."""
    later = grouped(
        (actor, action.content.controller)
        for actors, action in _private_actions(scenario)
        if isinstance(action.content, private_actions.AssignControllerAction) and action.content.controller is not None
        for actor in actors
    )
    return {entity.name: [*entity.controllers, *later.get(entity.name, ())] for entity in scenario.entities}


def _mark(entity: Entity, controllers: Iterable[Controller]) -> str:
    for controller in controllers:
        if kind_of(controller).is_external:
            return f"controller {named(controller)}"
    for name, value in entity.properties.items():
        if value.strip().lower() in EXTERNAL_ENTITIES.get(name.strip().lower(), ()):
            return f"{name} {value}"
    return ""


def _private_actions(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], Action]]:
    for private in scenario.storyboard.init.privates:
        yield from (((private.entity_ref,), action) for action in private.actions)
    for at in scenario.storyboard.events():
        yield from ((at.actors, action) for action in at.event.actions)
