"""Small scenarios and roads written by tests, read and played like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi
from pathlib import Path

import numpy as np

from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion

WIDTH = 3.5
"""Of all lanes. [m]"""

CURVES: dict[str, Callable[[float], float]] = {
    "linear": lambda u: u,
    "cubic": lambda u: u * u * (3.0 - 2.0 * u),
    "sinusoidal": lambda u: 0.5 * (1.0 - cos(pi * u)),
}
"""Share of the change at a share of the time, for each shape of a transition."""

_HEADER = '<FileHeader revMajor="1" revMinor="{minor}" date="2024-01-01T00:00:00" description="" author=""/>'


# ---- roads -----------------------------------------------------------------------------------------------------------
def lanes(*ids: int, width: str = f"{WIDTH}", links: dict[int, tuple[int | None, int | None]] | None = None) -> str:
    """Driving lanes of one width, linked to lanes of the same id unless told otherwise."""
    written = []
    for lane in ids:
        before, after = (links or {}).get(lane, (lane, lane))
        link = "" if before is None else f'<predecessor id="{before}"/>'
        link += "" if after is None else f'<successor id="{after}"/>'
        written.append(
            f'<lane id="{lane}" type="driving"><link>{link}</link>'
            f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>'
        )
    return "".join(written)


def section(left: str, right: str, s: float = 0.0) -> str:
    return (
        f'<laneSection s="{s}"><left>{left}</left><center><lane id="0" type="none"/></center>'
        f"<right>{right}</right></laneSection>"
    )


TWO_EACH_WAY = section(lanes(2, 1), lanes(-1, -2))


def road(
    name: str,
    plan: str,
    length: float,
    *,
    link: str = "",
    sections: str = TWO_EACH_WAY,
    rule: str = "RHT",
    junction: str = "-1",
    rest: str = "",
) -> str:
    return (
        f'<road id="{name}" length="{length}" junction="{junction}" rule="{rule}"><link>{link}</link>'
        f"<planView>{plan}</planView><lanes>{sections}</lanes>{rest}</road>"
    )


def line(x: float = 0.0, y: float = 0.0, heading: float = 0.0, length: float = 1000.0) -> str:
    return f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry>'


def arc(curvature: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0, length: float = 1000.0) -> str:
    inside = f'<arc curvature="{curvature}"/>'
    return f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}">{inside}</geometry>'


def map_of(*roads: str) -> str:
    return f'<?xml version="1.0"?>\n<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(roads)}</OpenDRIVE>'


STRAIGHT = map_of(road("1", line(), 1000.0))
"""Along x; two lanes each way."""


# ---- entities and positions ------------------------------------------------------------------------------------------
def car(name: str, *, top_speed: float = 70.0, acceleration: float = 10.0, deceleration: float = 10.0) -> str:
    return (
        f'<ScenarioObject name="{name}"><Vehicle name="car" vehicleCategory="car">'
        '<BoundingBox><Center x="1.5" y="0" z="0.8"/><Dimensions width="2" length="5" height="1.6"/></BoundingBox>'
        f'<Performance maxSpeed="{top_speed}" maxAcceleration="{acceleration}" maxDeceleration="{deceleration}"/>'
        '<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>'
        '<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles>'
        "<Properties/></Vehicle></ScenarioObject>"
    )


def on_lane(lane: int, s: float, *, road: str = "1", offset: float = 0.0, orientation: str = "") -> str:
    return f'<LanePosition roadId="{road}" laneId="{lane}" s="{s}" offset="{offset}">{orientation}</LanePosition>'


def in_world(x: float, y: float, heading: float | None = None) -> str:
    h = "" if heading is None else f' h="{heading}"'
    return f'<WorldPosition x="{x}" y="{y}"{h}/>'


def facing(heading: float, kind: str = "relative") -> str:
    return f'<Orientation type="{kind}" h="{heading}"/>'


# ---- actions ---------------------------------------------------------------------------------------------------------
def private_action(inside: str) -> str:
    return f"<PrivateAction>{inside}</PrivateAction>"


def teleport(position: str) -> str:
    return private_action(f"<TeleportAction><Position>{position}</Position></TeleportAction>")


def dynamics(shape: str, dimension: str, value: float, tag: str) -> str:
    return f'<{tag} dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>'


def speed(value: float, shape: str = "step", dimension: str = "time", over: float = 0.0) -> str:
    return speed_to(f'<AbsoluteTargetSpeed value="{value}"/>', shape, dimension, over)


def speed_to(target: str, shape: str = "step", dimension: str = "time", over: float = 0.0) -> str:
    return longitudinal(
        f"<SpeedAction>{dynamics(shape, dimension, over, 'SpeedActionDynamics')}"
        f"<SpeedActionTarget>{target}</SpeedActionTarget></SpeedAction>"
    )


def longitudinal(inside: str) -> str:
    return private_action(f"<LongitudinalAction>{inside}</LongitudinalAction>")


def lateral(inside: str) -> str:
    return private_action(f"<LateralAction>{inside}</LateralAction>")


def lane_change(
    target: str, shape: str = "sinusoidal", dimension: str = "time", over: float = 4.0, offset: float = 0.0
) -> str:
    return lateral(
        f'<LaneChangeAction targetLaneOffset="{offset}">{dynamics(shape, dimension, over, "LaneChangeActionDynamics")}'
        f"<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction>"
    )


def to_lane(lane: int) -> str:
    return f'<AbsoluteTargetLane value="{lane}"/>'


def by_lanes(count: int, of: str = "Ego") -> str:
    return f'<RelativeTargetLane entityRef="{of}" value="{count}"/>'


def lane_offset(target: str, *, shape: str = "cubic", acceleration: float | None = None) -> str:
    limit = "" if acceleration is None else f' maxLateralAcc="{acceleration}"'
    return lateral(
        f'<LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="{shape}"{limit}/>'
        f"<LaneOffsetTarget>{target}</LaneOffsetTarget></LaneOffsetAction>"
    )


def follow(trajectory: str, *, timing: str = "<None/>", mode: str = "position", start: float = 0.0) -> str:
    return private_action(
        f'<RoutingAction><FollowTrajectoryAction initialDistanceOffset="{start}">'
        f"<TrajectoryRef>{trajectory}</TrajectoryRef><TimeReference>{timing}</TimeReference>"
        f'<TrajectoryFollowingMode followingMode="{mode}"/></FollowTrajectoryAction></RoutingAction>'
    )


def polyline(*vertices: tuple[float | None, str], closed: bool = False) -> str:
    inside = "".join(f"<Vertex{_time(time)}><Position>{position}</Position></Vertex>" for time, position in vertices)
    return trajectory(f"<Polyline>{inside}</Polyline>", closed=closed)


def trajectory(shape: str, *, closed: bool = False) -> str:
    return f'<Trajectory name="way" closed="{str(closed).lower()}"><Shape>{shape}</Shape></Trajectory>'


def _time(value: float | None) -> str:
    return "" if value is None else f' time="{value}"'


TIMING = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'


# ---- triggers --------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Trigger:
    """Conditions, in groups: all of a group, any of the groups."""

    groups: tuple[tuple[str, ...], ...]

    def xml(self, tag: str = "StartTrigger") -> str:
        groups = "".join(f"<ConditionGroup>{''.join(group)}</ConditionGroup>" for group in self.groups)
        return f"<{tag}>{groups}</{tag}>"


def when(*conditions: str) -> Trigger:
    return Trigger((conditions,))


def by_value(inside: str, *, edge: str = "none", delay: float = 0.0) -> str:
    return (
        f'<Condition name="c" conditionEdge="{edge}" delay="{delay}"><ByValueCondition>{inside}</ByValueCondition>'
        "</Condition>"
    )


def by_entity(inside: str, *names: str, rule: str = "any", edge: str = "none", delay: float = 0.0) -> str:
    refs = "".join(f'<EntityRef entityRef="{name}"/>' for name in names or ("Ego",))
    return (
        f'<Condition name="c" conditionEdge="{edge}" delay="{delay}"><ByEntityCondition>'
        f'<TriggeringEntities triggeringEntitiesRule="{rule}">{refs}</TriggeringEntities>'
        f"<EntityCondition>{inside}</EntityCondition></ByEntityCondition></Condition>"
    )


def time_is(value: float, rule: str = "greaterOrEqual", **how: object) -> str:
    return by_value(f'<SimulationTimeCondition value="{value}" rule="{rule}"/>', **how)  # type: ignore[arg-type]


def state_of(name: str, state: str, kind: str = "event", **how: object) -> str:
    about = f'storyboardElementType="{kind}" storyboardElementRef="{name}"'
    return by_value(f'<StoryboardElementStateCondition {about} state="{state}"/>', **how)  # type: ignore[arg-type]


def after(seconds: float) -> Trigger:
    return when(time_is(seconds))


# ---- the storyboard --------------------------------------------------------------------------------------------------
def event(
    *actions: str, name: str = "event", trigger: Trigger | None = None, priority: str = "parallel", count: int = 1
) -> str:
    inside = "".join(f'<Action name="{name}-{k}">{action}</Action>' for k, action in enumerate(actions))
    return (
        f'<Event name="{name}" priority="{priority}" maximumExecutionCount="{count}">{inside}'
        f"{(trigger or after(0.0)).xml()}</Event>"
    )


def maneuvers(*events: str, actors: tuple[str, ...] = ("Ego",), count: int = 1, name: str = "group") -> str:
    refs = "".join(f'<EntityRef entityRef="{actor}"/>' for actor in actors)
    return (
        f'<ManeuverGroup name="{name}" maximumExecutionCount="{count}">'
        f'<Actors selectTriggeringEntities="false">{refs}</Actors>'
        f'<Maneuver name="{name}-maneuver">{"".join(events)}</Maneuver></ManeuverGroup>'
    )


class Stage:
    """A folder in which a test writes a road and a scenario, and plays it."""

    def __init__(self, folder: Path, roads: str | None = STRAIGHT) -> None:
        self.folder = folder
        self.logic_file = ""
        if roads is not None:
            (folder / "roads.xodr").write_text(roads)
            self.logic_file = '<LogicFile filepath="roads.xodr"/>'

    def play(
        self,
        *groups: str,
        start: dict[str, str] | None = None,
        stop: Trigger | None = None,
        last: float = 10.0,
        declared: str = "",
        entities: tuple[str, ...] | None = None,
        global_init: str = "",
        act_trigger: Trigger | None = None,
        act_stop: Trigger | None = None,
        signals: str = "",
        step: float = 0.02,
        time_limit: float | None = 60.0,
        minor: int = 2,
    ) -> Played:
        """Init actions of each entity in `start`, one act; ends after `last` seconds."""
        start = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0)} if start is None else start
        objects = "".join(entities if entities is not None else (car(name) for name in start))
        privates = "".join(f'<Private entityRef="{name}">{actions}</Private>' for name, actions in start.items())
        act = (
            f'<Story name="story"><Act name="act">{"".join(groups)}{(act_trigger or after(0.0)).xml()}'
            f"{'' if act_stop is None else act_stop.xml('StopTrigger')}</Act></Story>"
            if groups
            else ""
        )
        path = self.folder / "scenario.xosc"
        path.write_text(
            f'<?xml version="1.0"?>\n<OpenSCENARIO>{_HEADER.format(minor=minor)}{declared}<CatalogLocations/>'
            f"<RoadNetwork>{self.logic_file}{signals}</RoadNetwork>"
            f"<Entities>{objects}</Entities><Storyboard><Init><Actions>{global_init}{privates}</Actions></Init>{act}"
            f"{(stop or when(time_is(last))).xml('StopTrigger')}</Storyboard></OpenSCENARIO>"
        )
        return play_scenario(path, step=step, time_limit=time_limit)


def entity(played: Played | NominalMotion, name: str = "Ego") -> EntityMotion:
    motion = played if isinstance(played, NominalMotion) else played.motion
    return next(e for e in motion.entities if e.name == name)


def start_of(played: Played, action: str) -> float:
    """When an action of that name started. [s]"""
    return next(a.start for a in played.motion.actions if a.path and a.path[-1] == action)


def lateral_rows(motion: EntityMotion) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Times of the rows in which a lane change or lane offset ran. [s]"""
    return motion.time[motion.activity & np.uint8(Activity.LATERAL) > 0]


def row(motion: EntityMotion, time: float) -> int:
    """The row of a time."""
    return int(np.argmin(np.abs(motion.time - time)))
