"""What is decided before anything is sampled: who is under test, who drives whom, how long, and how each is written."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from xosc_lateral.base.errors import FormatError, locate
from xosc_lateral.files.openscenario.write.draft import Player
from xosc_lateral.files.openscenario.write.replaced_maneuvers import replaced_groups, separable
from xosc_lateral.files.openscenario.write.trajectory_scenario import motion_unknown_to
from xosc_lateral.files.output_paths import refuse_outputs
from xosc_lateral.files.tables import ContextTable, read_context
from xosc_lateral.workflows.conversion.drivers import choose_drivers, without_proving_grounds
from xosc_lateral.workflows.conversion.enrich import Drivers
from xosc_lateral.workflows.conversion.load import Loaded, Played, play_until
from xosc_lateral.workflows.conversion.meaning import meaning_of
from xosc_lateral.workflows.conversion.result import LaneChanges
from xosc_lateral.workflows.conversion.settings import ConvertSettings, OutputMode
from xosc_lateral.world.scenario.dependence import (
    Control,
    Dependence,
    actors_of,
    conditions_of,
    controlled_entities,
    dependence,
    vehicles_under_test,
)
from xosc_lateral.world.scenario.enums import DynamicsShape
from xosc_lateral.world.scenario.private_actions import LaneChangeAction
from xosc_lateral.world.scenario.scenario import Condition, Scenario

LEAST_EXTENSION, LARGEST_EXTENSION = 1.3, 2.0
"""A vehicle under test may be later at what ends the run, or never come to it: others follow trajectories for so
many times the nominal run. A fifth slower takes a quarter longer; a file of trajectories grows with their time. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """One conversion, decided.

    - `output`, `saves`: where it goes, and whether it is written there
    - `inputs`: SHA-256 of every file that was read
    - `played`, `extended`: the nominal run; as long as others may need offsets where a vehicle under test is slower
    - `egos`: vehicles under test, and why each is one
    - `controllers`: of entities that are left to them
    - `depends`: what depends on either
    - `drivers`: per entity its profile, or why it gets none
    - `unwritable`: entities whose maneuvers the target does not know, so that only a trajectory is left, and why
    """

    settings: ConvertSettings
    variant: int
    output: Path
    saves: bool
    inputs: Mapping[Path, str]
    played: Played
    extended: Played
    egos: Mapping[str, str]
    controllers: Mapping[str, Control]
    depends: Dependence
    drivers: Drivers
    context: ContextTable | None
    unwritable: Mapping[str, str]

    @property
    def source(self) -> Path:
        """The scenario's file."""
        return self.played.scenario.path

    @property
    def is_replay(self) -> bool:
        """Whether everything happens by the clock of the nominal run, whoever drives."""
        return _is_replay(self.settings, self.depends)

    def on_trajectories(self, names: Iterable[str]) -> frozenset[str]:
        """Those of the named entities that follow trajectories if they get offsets."""
        if self.settings.mode is OutputMode.LANE_OFFSET:
            return frozenset()
        if self.settings.mode is OutputMode.TRAJECTORY or self.is_replay:
            return frozenset(names)
        return separable(self.played.scenario, set(names) - self.depends.entities)

    def written_as(self, enriched: Collection[str]) -> WrittenAs:
        """How the vehicles that got offsets are written."""
        scenario = self.played.scenario
        if self.is_replay:
            return WrittenAs(frozenset(enriched), frozenset(), _frozen(scenario, self.depends, None))
        chosen = self.on_trajectories(enriched)
        if self.settings.mode is OutputMode.TRAJECTORY:
            chosen = self.with_pulled({*chosen, *self.unwritable})
            return WrittenAs(chosen, frozenset(), _frozen(scenario, self.depends, chosen))
        chosen |= self.unwritable.keys()
        return WrittenAs(chosen, frozenset(enriched) - chosen)

    def replayed(self) -> frozenset[str]:
        """Who follows a trajectory where everything happens by the clock."""
        everybody = frozenset(entity.name for entity in self.played.motion.entities)
        only = self.settings.only
        chosen = everybody if only is None else self.with_pulled(only) | self.unwritable.keys()
        return chosen - {*self.egos, *self.controllers}

    def with_pulled(self, names: Collection[str]) -> frozenset[str]:
        """With the trailers that these entities pull from the start."""
        return frozenset(names) | {trailer for trailer, name in self.played.trailers.items() if name in names}


@dataclass(frozen=True, slots=True)
class WrittenAs:
    """Who follows a trajectory, and who keeps its maneuvers and gets lane offsets; all others stay as they are.

    `frozen`: triggers that depend on a vehicle under test and no longer do in the output, a line each.
    """

    trajectories: frozenset[str]
    lane_offsets: frozenset[str]
    frozen: tuple[str, ...] = ()

    def modes(self) -> dict[str, str]:
        """Vehicle -> how its offsets are written."""
        modes = dict.fromkeys(self.lane_offsets, OutputMode.LANE_OFFSET.value)
        return dict(sorted((modes | dict.fromkeys(self.trajectories, OutputMode.TRAJECTORY.value)).items()))


def decide(
    loaded: Loaded,
    played: Played,
    settings: ConvertSettings,
    *,
    output: Path,
    variant: int = 0,
    report: Path | None = None,
    saves: bool = True,
) -> Plan:
    """Decide; see `Plan`.

    Raises `FormatError`: the settings do not go with the scenario, or an output would replace an input;
    `DriverProfileError`: a profile is not known.
    """
    scenario = played.scenario
    _refuse_lane_offsets_for_carla(scenario, settings)
    egos = chosen_egos(scenario, settings)
    controllers = _kept_controllers(scenario, settings, egos)
    depends = dependence(scenario, (*egos, *controllers))
    context = None if settings.context is None else read_context(settings.context)
    inputs = dict(loaded.files)
    if context is not None and settings.context is not None:
        inputs[settings.context] = context.sha256
    refuse_outputs([output if saves else None, report], inputs)
    for_carla = settings.target.player is Player.CARLA
    drivers = choose_drivers(scenario, settings, egos, controllers if for_carla else {})
    plan = Plan(
        settings,
        variant,
        output,
        saves,
        inputs,
        played,
        _extended_run(played, settings, depends, tuple(egos)),
        egos,
        controllers,
        depends,
        without_proving_grounds(drivers, played.motion, played.network, settings.entity),
        context,
        _unwritable(played, settings, {*egos, *controllers}),
    )
    if settings.lane_changes is LaneChanges.LIFELIKE:
        _refuse_steps(scenario, plan.on_trajectories(drivers))
    return plan


def chosen_egos(scenario: Scenario, settings: ConvertSettings) -> dict[str, str]:
    """Vehicles under test of a conversion, and why each is one.

    Raises `FormatError`: if one of them was also to be enriched.
    """
    if settings.ego is not None and not settings.ego:
        return {}
    egos = vehicles_under_test(scenario)
    names = {entity.name for entity in scenario.entities}
    egos |= {name: "named by --ego" for name in sorted(settings.ego or ()) if name in names}
    for option, wanted in (("--entity", settings.entity), ("--only", settings.only or ())):
        for name in wanted:
            if name in egos:
                raise FormatError(
                    f"{option} {name!r}: it is a vehicle under test ({egos[name]}) and is left as it is; "
                    "with --ego none it is replayed",
                    path=scenario.path,
                )
    return egos


def _kept_controllers(scenario: Scenario, settings: ConvertSettings, egos: Collection[str]) -> dict[str, Control]:
    """Entities that a conversion leaves to the controllers of its player; none where everybody is replayed."""
    if not heeds_controllers(settings):
        return {}
    return {name: control for name, control in controlled_entities(scenario).items() if name not in egos}


def heeds_controllers(settings: ConvertSettings) -> bool:
    """Whether what a controller drives stays its own; else the default driver drives it."""
    return settings.mode is not OutputMode.TRAJECTORY and (settings.ego is None or bool(settings.ego))


def _is_replay(settings: ConvertSettings, depends: Dependence) -> bool:
    if settings.mode is OutputMode.LANE_OFFSET:
        return False
    return settings.target.player is Player.CARLA or not (depends.entities or settings.only is not None)


def _extended_run(played: Played, settings: ConvertSettings, depends: Dependence, egos: tuple[str, ...]) -> Played:
    """The run that offsets are for: a longer one where a vehicle under test decides when trajectories end."""
    ends = depends.of_trigger(played.scenario.storyboard.stop_trigger) and played.motion.cut_off is None
    if settings.mode is not OutputMode.AUTO or _is_replay(settings, depends) or not ends:
        return played
    runs = meaning_of(played, egos, step=settings.step, time_limit=settings.time_limit)
    end = min(
        max(runs.end, LEAST_EXTENSION * played.motion.end_time), LARGEST_EXTENSION * played.motion.end_time, runs.limit
    )
    return play_until(played, end, step=settings.step) if end > played.motion.end_time else played


def _unwritable(played: Played, settings: ConvertSettings, unforeseeable: Collection[str]) -> dict[str, str]:
    """See `Plan`: of those alone that `only` leaves out; the others follow trajectories anyway."""
    if settings.only is None or settings.mode is OutputMode.LANE_OFFSET:
        return {}
    left = {*settings.only, *unforeseeable}
    others = [entity.name for entity in played.motion.entities if entity.name not in left]
    if settings.target.player is Player.CARLA:
        return dict.fromkeys(others, "CARLA's ScenarioRunner plays maneuvers in ways of its own")
    return motion_unknown_to(settings.target.version_for(played.scenario), played.scenario, played.motion, others)


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


def _refuse_steps(scenario: Scenario, names: Collection[str]) -> None:
    """Raise `FormatError` where a lane change of these entities takes no time, but is to be lifelike."""
    for _, act, group in scenario.storyboard.groups():
        for _, event in group.events():
            for content in (action.content for action in event.actions):
                is_step = isinstance(content, LaneChangeAction) and content.dynamics.shape is DynamicsShape.STEP
                if is_step and set(actors_of(act, group, event)) & set(names):
                    raise content.place.error("a step has no way across: take --lane-changes written")
