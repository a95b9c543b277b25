"""Write a scenario that keeps its maneuvers and gets the offsets as paths by the distance driven, beside them.

For scenarios that have to stay reactive: triggers look at what happens, an ego under test may drive itself. A path is a
trajectory without times: it leaves speed, distance and triggers alone. Its vertices are relative to the entity, in road
coordinates, and the player finds them where the path begins: so it may begin anywhere, at any time. Each phase is an
act of its own, which any lateral action of the entity stops.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from lxml import etree
from msgspec import Struct

from xosc_lateral.base.limits import REPEATED_RUNS
from xosc_lateral.base.note import warnings
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft, source_of
from xosc_lateral.files.openscenario.write.literal import inline_maneuvers, name_literally
from xosc_lateral.files.openscenario.write.moving import moving_entities
from xosc_lateral.files.openscenario.write.replaced_maneuvers import ReplacedManeuvers
from xosc_lateral.world.motion.offset_path import Bridge, OffsetPath, PathPiece
from xosc_lateral.world.motion.way import RoadPlace
from xosc_lateral.world.scenario.controllers import Domains, controlled_entities, driven_from_the_start, gives
from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.global_actions import AddEntityAction
from xosc_lateral.world.scenario.private_actions import LATERAL, TeleportAction
from xosc_lateral.world.scenario.scenario import Scenario

PATH_NAME = "xosc-lateral offsets"
LOOK_DELAY = 0.06
"""So long after an act has begun its conditions look at what is, not at what has been: a frame of up to 0.05 s. [s]"""
FIRST_WAIT = 0.2
"""A path waits so long, at least two such frames: what is to stop it may begin with the act. Its vertices are then
where those of a replay are, every 0.1 s. [s]"""
END_MARGIN = 15.0
"""A path ends so far before a place that none leads over. [m]"""
REACHED = 3.0
"""So near to a place, an entity is there: a frame of 0.1 s at 45 m/s is 4.5 m long. [m]"""
SPARE_ACTS = 3
"""Acts more than runs in the nominal run, after an action that may run again. [-]"""


def add_paths(
    draft: Draft,
    paths: Sequence[OffsetPath],
    lateral: LateralActions,
    trajectories: Mapping[str, Track],
) -> tuple[str, ...]:
    """Add paths to maneuvers that stay as they are; who has them or follows a trajectory instead."""
    moving = moving_entities(draft, trajectories)
    maneuvers = ReplacedManeuvers(draft, moving)
    story = build.story("xosc-lateral")
    across = [(path, _element_of(path, draft)) for path in paths if path.instead]
    for number, (path, change) in enumerate(across, start=1):
        _lead_across(change, f"{PATH_NAME} across {number}", path, draft)
    for path in paths:
        if not path.instead:
            _add_acts(story, path, draft, lateral)
    _place_aside(draft, paths)
    if len(story):
        # Last: a lane change that starts in the same frame has started before ours are looked at.
        draft.put_last(story)
    # Names of the elements that our conditions look at, with those above them where they are needed.
    references = (item.get("storyboardElementRef") or "" for item in story.iter("StoryboardElementStateCondition"))
    referred = {name for reference in references for name in reference.split("::")}
    name_literally(draft.root, draft.scenario.path, draft.scope, referred)
    inline_maneuvers(draft, referred)
    maneuvers.replace()
    return tuple(dict.fromkeys([*moving, *(path.entity for path in paths)]))


def _element_of(path: OffsetPath, draft: Draft) -> etree._Element:
    """The lane change that a path leads across in place of, in the tree before anything in it is changed."""
    actions = ((at.path, action) for at in draft.scenario.storyboard.events() for action in at.event.actions)
    action = next(action for names, action in actions if (*names, action.name) == path.after)
    return next(source_of(action, draft.scenario, draft.root).iter("{*}LaneChangeAction"))


def _lead_across(change: etree._Element, name: str, path: OffsetPath, draft: Draft) -> None:
    """Event, action and trigger stay; the player moves it along the path, or as written to beside the middle."""
    if path.settles is not None:
        aside, rate = path.settles
        change.set("targetLaneOffset", build.decimal(aside, 4))
        if rate > 0.0:
            next(change.iter("{*}LaneChangeActionDynamics")).set("value", build.decimal(rate, 4))
        return
    lateral = change.getparent()
    assert lateral is not None
    private = lateral.getparent()
    assert private is not None
    routing = etree.Element("RoutingAction")
    _follow(build.sub(routing, "FollowTrajectoryAction"), name, draft, _vertices(path, path.pieces[0]))
    place = private.index(lateral)
    private.remove(lateral)
    build.insert_indented(private, place, routing)


def _place_aside(draft: Draft, paths: Sequence[OffsetPath]) -> None:
    """Put those whose offsets begin with the scenario down there, after all else that places them."""
    placed = {path.entity: path.placed_t for path in paths if path.placed_t is not None}
    owners = draft.init_actions.findall("{*}Private")
    # The reader's order is the file's: names need no parameters filled in again.
    last = {
        private.entity_ref: owner
        for owner, private in zip(owners, draft.scenario.storyboard.init.privates, strict=True)
        if private.entity_ref in placed
    }
    for entity, owner in last.items():
        action = etree.Element("PrivateAction")
        aside = build.sub(action, "LateralAction/LaneOffsetAction", continuous="false")
        build.sub(aside, "LaneOffsetActionDynamics", dynamicsShape="step")
        build.sub(aside, "LaneOffsetTarget/AbsoluteTargetLaneOffset", value=build.decimal(placed[entity], 4))
        build.insert_indented(owner, len(owner), action)


def _add_acts(story: etree._Element, path: OffsetPath, draft: Draft, lateral: LateralActions) -> None:
    """The acts of one path: one, or several after an action that may run again."""
    actions = lateral.by_entity.get(path.entity, ())
    begun_by = next((one for one in actions if one.path == path.after), None)
    count, before = 1, None
    if begun_by is not None and begun_by.repeats:
        runs = sum(one.path == path.after and one.actor == path.entity for one in draft.motion.actions)
        if runs > REPEATED_RUNS.value:
            what = f"{' / '.join(begun_by.path)}: {REPEATED_RUNS.refusal(runs)}"
            draft.notes += warnings([f"'{path.entity}' has no offsets after more of them; {what}"], entity=path.entity)
        count = min(runs, int(REPEATED_RUNS.value)) + SPARE_ACTS
    for _ in range(count):
        act = build.sub(story, "Act", name=f"{PATH_NAME} {len(story) + 1}")
        name = str(act.get("name"))
        over = next((one for one in actions if one.path == path.over), None)
        _add_pieces(act, name, path, draft, over)
        _add_start(act, path, begun_by, before, draft.version)
        kept = [one for one in actions if one is not begun_by or one.repeats]
        _add_stop(act, name, path, kept if over is None else [one for one in kept if one.path in path.unless])
        before = name


def _add_pieces(act: etree._Element, name: str, path: OffsetPath, draft: Draft, over: LateralAction | None) -> None:
    """A trajectory each: the reference player finds the places of vertices when it starts, so it may run once."""
    maneuver = build.maneuver(act, f"{name} path", path.entity)
    begins = ("act", name, "runningState") if over is None else (over.kind, over.reference, "runningState")

    def event(number: int, wait: float) -> etree._Element:
        nonlocal begins
        added = build.event(maneuver, f"{name}.{number}", Priority.OVERRIDE, draft.version)
        action = build.private_action(added, f"{name}.{number} action")
        build.state_condition(build.sub(added, "StartTrigger/ConditionGroup"), *begins, wait)
        begins = "event", f"{name}.{number}", "completeState"
        return action

    if path.settles is not None:
        _settle(event(0, FIRST_WAIT), path, *path.settles)
    for number, piece in enumerate(path.pieces, start=1):
        wait = 0.0 if over is not None or isinstance(piece, Bridge) else FIRST_WAIT  # its first place is just ahead
        follow = build.sub(event(number, wait), "RoutingAction/FollowTrajectoryAction")
        _follow(follow, f"{name}.{number}", draft, _vertices(path, piece))


def _settle(action: etree._Element, path: OffsetPath, aside: float, within: float) -> None:
    """From wherever it is to a place in its lane, by the distance driven."""
    change = build.sub(action, "LateralAction/LaneChangeAction", targetLaneOffset=build.decimal(aside, 4))
    dynamics = {"dynamicsShape": "sinusoidal", "dynamicsDimension": "distance", "value": build.decimal(within, 1)}
    build.sub(change, "LaneChangeActionDynamics", **dynamics)
    build.sub(change, "LaneChangeTarget/RelativeTargetLane", entityRef=path.entity, value="0")


def _follow(follow: etree._Element, name: str, draft: Draft, vertices: build.FreeVertices) -> None:
    """Along a path, without times."""
    holder = follow if draft.version < (1, 1) else build.sub(follow, "TrajectoryRef")
    polyline = build.sub(build.sub(holder, "Trajectory", name=name, closed="false"), "Shape/Polyline")
    draft.vertices.add(polyline, vertices)
    build.sub(follow, "TimeReference/None")
    build.sub(follow, "TrajectoryFollowingMode", followingMode="position")


def _vertices(path: OffsetPath, piece: PathPiece | Bridge) -> build.FreeVertices:
    if isinstance(piece, Bridge):
        beside = path.side * np.stack(piece.beside)
        return build.FreeVertices(path.entity, beside, piece.nominal + piece.aside)
    return build.FreeVertices(path.entity, path.side * np.stack(piece), np.empty((2, 0)))


def _add_start(
    act: etree._Element, path: OffsetPath, begun_by: LateralAction | None, before: str | None, version: build.Version
) -> None:
    """With the scenario, at a place, or with the end of an action, once the act `before` is over."""
    if begun_by is None and not path.places:
        build.time_trigger(act, "StartTrigger", path.time, version)
        return
    trigger = build.sub(act, "StartTrigger")
    for place in path.places:
        _add_reached(build.sub(trigger, "ConditionGroup"), path.entity, place, REACHED)
    if begun_by is None:
        return
    for transition in ("endTransition", "stopTransition"):
        group = build.sub(trigger, "ConditionGroup")
        build.state_condition(group, begun_by.kind, begun_by.reference, transition, 0.0)
        if before is not None:
            build.state_condition(group, "act", before, "completeState", 0.0)
        if path.span[0] > 0.0:
            _add_driven(group, path.entity, path.span[0])


def _add_stop(act: etree._Element, name: str, path: OffsetPath, actions: Iterable[LateralAction]) -> None:
    """By any lateral action that runs, before what no path leads over, and before the entity drives backwards."""
    trigger = build.sub(act, "StopTrigger")
    for item in actions:
        if not item.adds:
            group = build.sub(trigger, "ConditionGroup")
            # A controller is given its domain at once, and some players' assignments run for ever.
            state = "runningState" if item.steers is None else "startTransition"
            build.state_condition(group, item.kind, item.reference, state, 0.0)
            # true later than what was before its first look
            build.state_condition(group, "act", name, "runningState", LOOK_DELAY)
    for place in path.ends:
        _add_reached(build.sub(trigger, "ConditionGroup"), path.entity, place, END_MARGIN)
    if np.isfinite(path.span[1]):
        _add_driven(build.sub(trigger, "ConditionGroup"), path.entity, path.span[1])
    backwards = build.entity_condition(build.sub(trigger, "ConditionGroup"), "drives backwards", path.entity)
    build.sub(backwards, "SpeedCondition", value="0", rule="lessThan")


def _add_reached(group: etree._Element, entity: str, place: RoadPlace, tolerance: float) -> None:
    reached = build.sub(
        build.entity_condition(group, "there", entity), "ReachPositionCondition", tolerance=build.decimal(tolerance, 1)
    )
    s, t = build.decimal(place.s, 3), build.decimal(place.t, 3)
    build.sub(reached, "Position/RoadPosition", roadId=place.road, s=s, t=t)


def _add_driven(group: etree._Element, entity: str, distance: float) -> None:
    asked = build.entity_condition(group, "so far", entity)
    build.sub(asked, "TraveledDistanceCondition", value=build.decimal(distance, 1))


# ---- What moves entities sideways in a storyboard or puts them th ----
class LateralAction(Struct, frozen=True):
    """A lateral action, a teleport or the adding of an entity."""

    path: tuple[str, ...]  # its names from the story down
    kind: str  # type and name that a condition refers to it by
    reference: str
    repeats: bool = False  # it may run more than once
    adds: bool = False  # it adds the entity
    steers: bool | None = None  # it gives the entity to a controller; False: it takes it back


class LateralActions(Struct, frozen=True):
    """Of a scenario's events, by entity, in file order; and domains that controllers have, ever and from the start."""

    by_entity: Mapping[str, tuple[LateralAction, ...]]
    controlled: Mapping[str, Domains]
    from_the_start: Mapping[str, Domains]

    @classmethod
    def of(cls, scenario: Scenario) -> LateralActions:
        """Those of a scenario."""
        names = Counter(_names(scenario))
        controls = {name: control.domains for name, control in controlled_entities(scenario).items()}
        by_entity: dict[str, dict[LateralAction, None]] = {}
        for at in scenario.storyboard.events():
            repeats = at.group.maximum_execution_count > 1 or at.event.maximum_execution_count > 1
            for action in at.event.actions:
                content, path = action.content, (*at.path, action.name)
                reference = _reference(path, len(at.event.actions) == 1, names)
                adds = isinstance(content, AddEntityAction)
                for actor in (content.entity_ref,) if isinstance(content, AddEntityAction) else at.actors:
                    steers = gives(content, controls[actor]) if actor in controls else None
                    if adds or steers is not None or isinstance(content, (*LATERAL, TeleportAction)):
                        lateral = LateralAction(path, *reference, repeats, adds, steers)
                        by_entity.setdefault(actor, {})[lateral] = None
        actions = {entity: tuple(found) for entity, found in by_entity.items()}
        return cls(actions, controls, driven_from_the_start(scenario))

    def is_free(self, entity: str) -> bool:
        """Whether an entity is ever moved along the road by no controller: a path would double its movement."""
        moved = Domains.LONGITUDINAL in self.from_the_start.get(entity, Domains.NONE)
        return not moved or any(action.steers is False for action in self.by_entity.get(entity, ()))


def _reference(path: tuple[str, ...], is_alone: bool, names: Mapping[str, int]) -> tuple[str, str]:
    """By its own name where no other element has it, else by its event's, else by the whole path.

    An action without a name, which the standard doesn't allow and some tools write, has only its event's.
    """
    if path[-1] and names[path[-1]] == 1:
        return "action", path[-1]
    if (is_alone or not path[-1]) and names[path[-2]] == 1:
        return "event", path[-2]
    return "action", "::".join(path)


def _names(scenario: Scenario) -> Iterator[str]:
    """Name of every element of the storyboard."""
    for story in scenario.storyboard.stories:
        yield from (story.name, *(act.name for act in story.acts))
    for _, _, group in scenario.storyboard.groups():
        yield from (group.name, *(maneuver.name for maneuver in group.maneuvers))
        for _, event in group.events():
            yield from (event.name, *(action.name for action in event.actions))
