"""Lane changes as drivers take them: what they are refused for, and which stay as written."""

from __future__ import annotations

from collections.abc import Collection

from xosc_lateral.workflows.conversion.result import Enriched, LaneChanges
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.motion.segments import SegmentKind
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.dependence import actors_of
from xosc_lateral.world.scenario.enums import DynamicsShape
from xosc_lateral.world.scenario.private_actions import LaneChangeAction


def refuse_steps(scenario: Scenario, settings: ConvertSettings, names: Collection[str]) -> None:
    """Raise `FormatError` where a lane change of these entities is to be lifelike and takes no time."""
    for _, act, group in scenario.storyboard.groups() if settings.lane_changes is LaneChanges.LIFELIKE else ():
        for _, event in group.events():
            for content in (action.content for action in event.actions):
                is_step = isinstance(content, LaneChangeAction) and content.dynamics.shape is DynamicsShape.STEP
                if is_step and set(actors_of(act, group, event)) & set(names):
                    raise content.place.error("a step has no way across: take --lane-changes written")


def stay_as_written(enriched: Enriched, settings: ConvertSettings, through: Collection[str]) -> tuple[str, ...]:
    """Which lane changes and lane offsets stay as written although they are to be lifelike, a line each."""
    if settings.lane_changes is LaneChanges.WRITTEN:
        return ()
    lines = []
    for entity in enriched.entities:
        spans = (span for span in entity.spans if span.kind is SegmentKind.LATERAL_ACTION)
        if entity.is_enriched and entity.name not in through and any(spans):
            lines.append(f"lane changes of '{entity.name}' stay as written: it keeps its actions, the player moves it")
        for one in entity.crossings if entity.is_enriched else ():
            if one.stays:
                what = "lane change" if one.is_lane_change else "lane offset"
                at = entity.motion.time[one.first]
                lines.append(f"{what} of '{entity.name}' at {at:.1f} s stays as written: {one.stays}")
    return tuple(lines)
