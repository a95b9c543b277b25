"""What is decided before anything is sampled: who is under test, who drives whom, how long, and how each is written."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from xosc_lateral.base.errors import FormatError, did_you_mean, locate
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.openscenario.write.build import Version
from xosc_lateral.files.openscenario.write.draft import Player
from xosc_lateral.files.openscenario.write.reactive import LateralActions
from xosc_lateral.files.openscenario.write.replaced_maneuvers import replaced_groups, separable
from xosc_lateral.files.openscenario.write.replay import motion_unknown_to
from xosc_lateral.files.output_paths import refuse_outputs
from xosc_lateral.files.profiles import SHIPPED, find_profile, read_profile
from xosc_lateral.files.tables import ContextTable, read_context
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.workflows.conversion.prepared import Prepared
from xosc_lateral.workflows.conversion.result import Drivers, LaneChanges
from xosc_lateral.workflows.conversion.settings import AUTO, AUTO_PROFILE, ConvertSettings, OutputMode
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.controllers import (
    BY_NAME,
    NEARLY_NAMED,
    Control,
    controlled_entities,
    named_under_test,
    vehicles_under_test,
)
from xosc_lateral.world.scenario.dependence import Dependence, dependence
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.scenario.scenario import Condition, Scenario, conditions_of

LEAST_EXTENSION, LARGEST_EXTENSION = 1.3, 2.0
"""A vehicle under test may be later at what ends the run, or never come to it: others follow trajectories for so
many times the nominal run. A fifth slower takes a quarter longer; a file of trajectories grows with their time. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """One conversion, decided."""

    settings: ConvertSettings
    variant_index: int  # from 0: each has other offsets
    source: Path
    output: Path  # where it goes; it is written there if it `saves`
    saves: bool
    version: Version  # of the standard that is written
    inputs: Mapping[Path, str]  # SHA-256 of every file that was read
    prepared: Prepared
    extended: Played  # as long as others may need offsets where a vehicle under test is slower
    egos: Mapping[str, str]  # vehicles under test, and why each is one
    controllers: Mapping[str, Control]  # of entities that are left to them
    depends: Dependence  # on either
    is_replay: bool  # everything happens by the clock of the nominal run, whoever drives
    drivers: Drivers
    continuous: frozenset[str]  # whose movement goes on through lane changes: they may follow trajectories
    context: ContextTable | None
    # unwritable: entities whose maneuvers the target does not know, so that only a trajectory is left, and why
    unwritable: Mapping[str, str]
    lateral: LateralActions  # of the scenario: what is to stop paths

    @property
    def played(self) -> Played:
        """The nominal run."""
        return self.prepared.played

    def written_as(self, enriched: frozenset[str]) -> WrittenAs:
        """How the vehicles that got offsets are written."""
        scenario = self.played.scenario
        if self.is_replay:
            everybody = frozenset(entity.name for entity in self.played.motion.entities)
            only = self.settings.only
            chosen = everybody if only is None else self._with_pulled(only) | self.unwritable.keys()
            replayed = chosen - {*self.egos, *self.controllers}
            return WrittenAs(replayed, frozenset(), _frozen(scenario, self.depends, None))
        chosen = _on_trajectories(scenario, self.settings, self.depends, enriched) | self.unwritable.keys()
        if self.settings.mode is OutputMode.TRAJECTORY:
            chosen = self._with_pulled(chosen)
            return WrittenAs(chosen, frozenset(), _frozen(scenario, self.depends, chosen))
        return WrittenAs(chosen, enriched - chosen)

    def _with_pulled(self, names: Collection[str]) -> frozenset[str]:
        """With the trailers that these entities pull from the start."""
        return frozenset(names) | {trailer for trailer, name in self.played.trailers.items() if name in names}


@dataclass(frozen=True, slots=True)
class WrittenAs:
    """Who follows a trajectory, and who keeps its maneuvers and may get lane offsets; all others stay as they are."""

    trajectories: frozenset[str]
    lane_offsets: frozenset[str]
    # frozen: triggers that depend on a vehicle under test and no longer do in the output, a line each
    frozen: tuple[str, ...] = ()


def decide(
    prepared: Prepared,
    settings: ConvertSettings,
    *,
    output: Path,
    variant_index: int = 0,
    report: Path | None = None,
    saves: bool = True,
) -> Plan:
    """Decide; see `Plan`.

    Raises `FormatError`: the settings do not go with the scenario, or an output would replace an input;
    `DriverProfileError`: a profile is not known.
    """
    played, target = prepared.played, settings.target
    scenario = played.scenario
    _refuse_lane_offsets_for_carla(scenario, settings)
    egos = chosen_egos(scenario, settings)
    controllers = dict[str, Control]()  # none where everybody is replayed
    if respects_controllers(settings):
        controllers = {name: control for name, control in controlled_entities(scenario).items() if name not in egos}
    depends = dependence(scenario, (*egos, *controllers))
    context = None if settings.context is None else read_context(settings.context)
    inputs = dict(prepared.loaded.files)
    if context is not None and settings.context is not None:
        inputs[settings.context] = context.sha256
    refuse_outputs([output if saves else None, report], inputs)
    lateral, for_carla = LateralActions.of(scenario), target.player is Player.CARLA
    left = {name: control for name, control in controllers.items() if for_carla or not lateral.is_free(name)}
    drivers = choose_drivers(scenario, settings, egos, left)
    continuous = _on_trajectories(scenario, settings, depends, frozenset(drivers))
    version = target.version_for(scenario)
    is_lifelike = settings.lane_changes is LaneChanges.LIFELIKE
    return Plan(
        settings,
        variant_index,
        scenario.path,
        output,
        saves,
        version,
        inputs,
        prepared,
        _extended_by_trials(prepared, settings, depends, tuple(egos)),
        egos,
        controllers,
        depends,
        _is_replay(settings, depends),
        _without_proving_grounds(drivers, played.motion, played.network, settings.entity),
        frozenset(drivers) if is_lifelike else continuous,
        context,
        _unwritable(played, settings, version, {*egos, *controllers}),
        lateral,
    )


def _is_replay(settings: ConvertSettings, depends: Dependence) -> bool:
    if settings.mode is OutputMode.LANE_OFFSET:
        return False
    return settings.target.player is Player.CARLA or not (depends.entities or settings.only is not None)


def _on_trajectories(
    scenario: Scenario, settings: ConvertSettings, depends: Dependence, names: frozenset[str]
) -> frozenset[str]:
    """Those of the named entities that follow trajectories if they get offsets."""
    if settings.mode is OutputMode.LANE_OFFSET:
        return frozenset()
    if settings.mode is OutputMode.TRAJECTORY or _is_replay(settings, depends):
        return names
    return separable(scenario, names - depends.entities)


def chosen_egos(scenario: Scenario, settings: ConvertSettings) -> dict[str, str]:
    """Vehicles under test, and why each is one; `FormatError`: one of them was also to be enriched."""
    if settings.ego is not None and not settings.ego:
        return {}
    names = {entity.name for entity in scenario.entities}
    named = {name: "named by --ego" for name in sorted(settings.ego or ()) if name in names}
    egos = vehicles_under_test(scenario)
    if named:  # who names them means these: a name of the file says nothing then, a mark does
        egos = {name: why for name, why in egos.items() if why != BY_NAME} | named
    for option, wanted in (("--profile", settings.entity), ("--enrich", settings.only or ())):
        for name in wanted:
            if name in egos:
                raise FormatError(
                    f"{option} {name!r}: it is a vehicle under test ({egos[name]}) and is left as it is; "
                    "with --ego none it is replayed",
                    path=scenario.path,
                )
    return egos


def other_egos(scenario: Scenario, settings: ConvertSettings, egos: Mapping[str, str]) -> tuple[str, ...]:
    """Says that others could be under test as well, where nobody has named one."""
    if settings.ego is not None and (not settings.ego or "named by --ego" in egos.values()):
        return ()
    which = "--ego says which one is"
    by_name = [repr(name) for name, why in egos.items() if why == BY_NAME]
    if len(by_name) > 1:
        return (f"{' and '.join(by_name)} are called like vehicles under test, and all left as written: {which}",)
    if not egos:
        near = [one.name for one in scenario.entities if one.is_vehicle and NEARLY_NAMED.search(one.name)]
        return tuple(f"{name!r} is replayed: if it is the vehicle under test, say --ego {name!r}" for name in near)
    marked = " and ".join(f"{name!r} ({why})" for name, why in egos.items())
    others = [name for name in named_under_test(scenario) if name not in egos]
    return tuple(
        f"{name!r} is called like a vehicle under test, but {marked} is marked as one: {which}" for name in others
    )


def respects_controllers(settings: ConvertSettings) -> bool:
    """Whether what a controller drives stays its own; else the default driver drives it."""
    return settings.mode is not OutputMode.TRAJECTORY and (settings.ego is None or bool(settings.ego))


def _extended_by_trials(
    prepared: Prepared, settings: ConvertSettings, depends: Dependence, egos: tuple[str, ...]
) -> Played:
    """The run that offsets are for: a longer one where a vehicle under test decides when trajectories end."""
    played = prepared.played
    ends = depends.of_trigger(played.scenario.storyboard.stop_trigger) and played.motion.cut_off is None
    if settings.mode is not OutputMode.AUTO or _is_replay(settings, depends) or not ends:
        return played
    runs = prepared.equivalence(egos)
    end = min(
        max(runs.end, LEAST_EXTENSION * played.motion.end_time), LARGEST_EXTENSION * played.motion.end_time, runs.limit
    )
    return prepared.until(end) if end > played.motion.end_time else played


def _unwritable(
    played: Played, settings: ConvertSettings, version: Version, unforeseeable: Collection[str]
) -> dict[str, str]:
    """See `Plan`: of those alone that `only` leaves out; the others follow trajectories anyway."""
    if settings.only is None or settings.mode is OutputMode.LANE_OFFSET:
        return {}
    excluded = {*settings.only, *unforeseeable}
    others = [entity.name for entity in played.motion.entities if entity.name not in excluded]
    if settings.target.player is Player.CARLA:
        return dict.fromkeys(others, "CARLA's ScenarioRunner plays maneuvers in ways of its own")
    return motion_unknown_to(version, played.scenario, played.motion, others)


def _frozen(scenario: Scenario, depends: Dependence, entities: Collection[str] | None) -> tuple[str, ...]:
    """Triggers of these entities' maneuvers (None: all) that depend on a vehicle under test, a line each."""
    names = {entity.name for entity in scenario.entities} if entities is None else entities
    conditions: list[Condition] = []
    for group in replaced_groups(scenario, names):
        conditions += [*conditions_of(group.act.start_trigger), *conditions_of(group.act.stop_trigger)]
        conditions += group.conditions()
    if entities is None:
        conditions += conditions_of(scenario.storyboard.stop_trigger)
    places = [condition.place for condition in conditions if depends.of_condition(condition)]
    what = "depends on a vehicle under test or a controller, and happens at the time of the nominal run in a trajectory"
    lines = (locate(what, path=place.path, line=place.line, element=place.element) for place in places)
    return tuple(dict.fromkeys(lines))


def _refuse_lane_offsets_for_carla(scenario: Scenario, settings: ConvertSettings) -> None:
    if settings.mode is OutputMode.LANE_OFFSET and settings.target.player is Player.CARLA:
        raise FormatError(
            "lane offset actions have no shape in CARLA's ScenarioRunner; use --mode trajectory", path=scenario.path
        )
    if settings.mode is OutputMode.LANE_OFFSET and scenario.header.is_left_handed:
        raise FormatError(
            "is written for CARLA, whose lane offsets differ from the standard's; use --mode trajectory",
            path=scenario.path,
            element="FileHeader",
        )


NO_DRIVER = {
    VehicleCategory.TRAILER: "a trailer has no driver",
    VehicleCategory.TRAIN: "a train is bound to its track",
    VehicleCategory.TRAM: "a tram is bound to its track",
    VehicleCategory.BICYCLE: "there is no profile for bicycles; name one with --profile NAME=PROFILE",
}
"""Vehicles that "auto" leaves alone, and why."""

PROVING_GROUND_WIDTH = 6.0
"""A lane wider than this, alone in its direction, is none of a road (2 to 6 m are), but a proving ground's: vehicles
keep to lines that the scenario's geometry draws, and not to a lane. [m]"""


def choose_drivers(
    scenario: Scenario,
    settings: ConvertSettings,
    egos: Mapping[str, str] | None = None,
    controllers: Mapping[str, Control] | None = None,
) -> Drivers:
    """Per entity its profile, or why it gets none: it is under test, or left to a controller.

    Raises `FormatError`: the settings name an entity that there is not; `DriverProfileError`: a profile is not known.
    """
    known = {entity.name for entity in scenario.entities}
    asked = (("--profile", settings.entity), ("--enrich", settings.only or ()), ("--ego", settings.ego or ()))
    for option, names in () if settings.names_may_lack else asked:
        for name in sorted(names):
            if name not in known:
                raise FormatError(
                    f"{option} {name!r}: no such entity{did_you_mean(name, known)}; "
                    f"there are {', '.join(sorted(known)) or 'none'}",
                    path=scenario.path,
                )
    left = {name: f"vehicle under test: {why}" for name, why in (egos or {}).items()}
    left |= {name: f"driven by controller {control}" for name, control in (controllers or {}).items()}
    read = cache(partial(read_profile, folders=settings.library))
    return {entity.name: left.get(entity.name) or _driver(entity, settings, read) for entity in scenario.entities}


def _driver(entity: Entity, settings: ConvertSettings, read: Callable[[str], DriverProfile]) -> DriverProfile | str:
    if not entity.is_vehicle:
        return f"a {entity.category.value}, no vehicle"
    if settings.only is not None and entity.name not in settings.only:
        return "not chosen (--enrich)"
    named = settings.entity.get(entity.name, settings.profile)
    if named == AUTO:
        category = entity.vehicle_category or VehicleCategory.CAR
        if category in NO_DRIVER:
            return NO_DRIVER[category]
        named = AUTO_PROFILE
    return named if isinstance(named, DriverProfile) else read(named)


def hidden_by_libraries(libraries: tuple[Path, ...]) -> tuple[str, ...]:
    """A line where "auto" takes one of the user's profiles in place of the shipped one."""
    path = find_profile(AUTO_PROFILE, libraries)
    return () if path.parent == SHIPPED else (f"{path} hides the shipped profile {AUTO_PROFILE!r}: auto takes it",)


def _without_proving_grounds(
    drivers: Drivers, motion: NominalMotion, network: RoadNetwork, named: Iterable[str]
) -> Drivers:
    """Drivers, but for vehicles in a lone lane that is none of a road: why they get none. `named` ones keep theirs."""
    moved = dict(drivers)
    for entity in motion.entities:
        if isinstance(moved.get(entity.name), DriverProfile) and entity.name not in set(named):
            step = max(1, len(entity.time) // max(1, round(float(entity.time[-1] - entity.time[0]))))  # a row a second
            rows = np.flatnonzero((entity.road[::step] >= 0) & (entity.lane[::step] != 0)) * step
            road, lane, s = entity.road[rows], entity.lane[rows], entity.s[rows]
            width = float(np.median(network.lane_width(road, lane, s))) if len(rows) else 0.0
            if width > PROVING_GROUND_WIDTH and float(np.median(network.lane_index(road, lane, s)[1])) <= 1.0:
                moved[entity.name] = (
                    f"lane of {width:.1f} m, a proving ground's: keeps its line (--profile NAME=PROFILE moves it)"
                )
    return moved
