"""Which vehicle is under test, and how each of the others is written."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from xosc_lateral.base.errors import FormatError, locate
from xosc_lateral.files.openscenario.write.replaced_maneuvers import replaced_groups, separable
from xosc_lateral.files.openscenario.write.target import Player
from xosc_lateral.workflows.conversion.settings import ConvertSettings, OutputMode
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.dependence import Dependence, conditions_of
from xosc_lateral.world.scenario.storyboard import Condition
from xosc_lateral.world.scenario.under_test import Control, controlled_entities, vehicles_under_test


def chosen_egos(scenario: Scenario, settings: ConvertSettings) -> dict[str, str]:
    """Vehicles under test of a conversion, and why each is one.

    Raises `FormatError`: if one of them was also to be enriched.
    """
    if settings.ego is not None and not settings.ego:
        return {}
    found = vehicles_under_test(scenario)
    names = {entity.name for entity in scenario.entities}
    found |= {name: "named by --ego" for name in sorted(settings.ego or ()) if name in names}
    for option, wanted in (("--entity", settings.entity), ("--only", settings.only or ())):
        for name in wanted:
            if name in found:
                raise FormatError(
                    f"{option} {name!r}: it is a vehicle under test ({found[name]}) and is left as it is; "
                    "with --ego none it is replayed",
                    path=scenario.path,
                )
    return found


def kept_controllers(scenario: Scenario, settings: ConvertSettings, egos: Collection[str]) -> dict[str, Control]:
    """Entities that a conversion leaves to the controllers of its player; none where everybody is replayed."""
    if not heeds_controllers(settings):
        return {}
    return {name: control for name, control in controlled_entities(scenario).items() if name not in egos}


def heeds_controllers(settings: ConvertSettings) -> bool:
    """Whether what a controller drives stays its own; else the default driver drives it."""
    return settings.mode is not OutputMode.TRAJECTORY and (settings.ego is None or bool(settings.ego))


@dataclass(frozen=True, slots=True)
class WritingPlan:
    """How the vehicles of a scenario are written.

    `trajectories`, `lane_offsets`: who follows a trajectory; who keeps its maneuvers and gets lane offsets. All others
    stay as they are; `is_replay`: everything happens by the clock of the nominal run, whoever drives; `frozen`:
    triggers that depend on a vehicle under test and no longer do in the output, a line each.
    """

    trajectories: frozenset[str]
    lane_offsets: frozenset[str]
    is_replay: bool
    frozen: tuple[str, ...] = ()

    def modes(self) -> dict[str, str]:
        """Vehicle -> how its offsets are written."""
        modes = dict.fromkeys(self.lane_offsets, OutputMode.LANE_OFFSET.value)
        return dict(sorted((modes | dict.fromkeys(self.trajectories, OutputMode.TRAJECTORY.value)).items()))


def is_replay(settings: ConvertSettings, depends: Dependence) -> bool:
    """Whether everything happens by the clock of the nominal run, whoever drives."""
    if settings.mode is OutputMode.LANE_OFFSET:
        return False
    return settings.target.player is Player.CARLA or not (depends.entities or settings.only is not None)


def follow_trajectories(
    scenario: Scenario, settings: ConvertSettings, depends: Dependence, names: Collection[str]
) -> frozenset[str]:
    """Those of the named entities that will follow trajectories if they get offsets."""
    if settings.mode is OutputMode.LANE_OFFSET:
        return frozenset()
    if settings.mode is OutputMode.TRAJECTORY or is_replay(settings, depends):
        return frozenset(names)
    return separable(scenario, set(names) - depends.entities)


def writing_plan(
    scenario: Scenario,
    settings: ConvertSettings,
    depends: Dependence,
    enriched: Collection[str],
    *,
    pulled: Mapping[str, str],
    sampled: Collection[str],
) -> WritingPlan:
    """Decide by vehicle.

    `depends`: on the vehicles under test; `enriched`: who got offsets; `pulled`: trailer -> its tractor: it goes with
    it; `sampled`: whose maneuvers the target does not know, so that only a trajectory is left.
    """
    if settings.mode is OutputMode.LANE_OFFSET:
        return WritingPlan(frozenset(), frozenset(enriched), is_replay=False)
    if is_replay(settings, depends):
        return WritingPlan(frozenset(enriched), frozenset(), is_replay=True, frozen=_frozen(scenario, depends, None))
    if settings.mode is OutputMode.TRAJECTORY:
        chosen = {*enriched, *sampled}
        chosen |= {trailer for trailer, tractor in pulled.items() if tractor in chosen}
        frozen = _frozen(scenario, depends, chosen)
        return WritingPlan(frozenset(chosen), frozenset(), is_replay=False, frozen=frozen)
    independent = set(enriched) - depends.entities
    chosen = {*separable(scenario, independent), *sampled}
    return WritingPlan(frozenset(chosen), frozenset(enriched) - chosen, is_replay=False)


def _frozen(scenario: Scenario, depends: Dependence, entities: Collection[str] | None) -> tuple[str, ...]:
    """Triggers of these entities' maneuvers (None: all) that depend on a vehicle under test, a line each."""
    names = {entity.name for entity in scenario.entities} if entities is None else entities
    conditions: list[Condition] = []
    for one in replaced_groups(scenario, names):
        conditions += [*conditions_of(one.act.start_trigger), *conditions_of(one.act.stop_trigger), *one.conditions()]
    if entities is None:
        conditions += conditions_of(scenario.storyboard.stop_trigger)
    places = [condition.place for condition in conditions if depends.of_condition(condition)]
    what = "depends on a vehicle under test or a controller, and happens at the time of the nominal run in a trajectory"
    return tuple(dict.fromkeys(locate(what, path=one.path, line=one.line, element=one.element) for one in places))
