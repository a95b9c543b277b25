"""What the player knows of one entity at one moment: its place, its route, its motion."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from math import cos, nan, pi, sin
from typing import NamedTuple, Protocol

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.paths.base import PathProgress
from xosc_lateral.world.road.lanes import DRIVING, WALKED
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.positions import LaneLink, Pose, RouteStep, difference, is_forward, wrap
from xosc_lateral.world.road.road import turn_for_heading, turned_in_surface
from xosc_lateral.world.scenario.controllers import DrivingControllers
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import EntityCategory

NO_ROAD = -1
"""Road of what is on none."""


class Placement(NamedTuple):
    """A place and an orientation, in road coordinates and, where it was not given in them, in world coordinates too."""

    road: int  # index; -1 where there is none
    lane: int
    s: float  # [m]
    offset_t: float  # from the lane's centre along the road's t-axis [m]
    relative_heading: float  # to the road's s-direction (slope of the lane included) [rad]
    pose: Pose | None = None  # in the world; None: by the road coordinates; NaN in z, pitch, roll: as the road


@dataclass(frozen=True, slots=True)
class RouteGuide:
    """A way over roads. It decides at junctions only; between them, the lane is followed."""

    network: RoadNetwork
    steps: tuple[RouteStep, ...]
    stops: tuple[tuple[int, int, float], ...] = ()  # road, lane, s [m]

    def choose(self, road: int, options: Sequence[LaneLink]) -> LaneLink | None:
        """The link that leads along the route, be it by another connecting road; None: the route does not say."""
        for link in (link for step in self.steps for link in step.links):
            if link in options:
                return link
        roads = [step.road for step in self.steps]
        for index in (index for index, other in enumerate(roads) if other == road):
            way = self._towards(roads[index + 1 :], options)
            if way is not None:
                return way
        return None

    def _towards(self, ahead: Sequence[int], options: Sequence[LaneLink]) -> LaneLink | None:
        for link in options:
            if ahead and link.road == ahead[0]:
                return link
        for link in reversed(options):
            onward = self.network.next_lanes(link.road, link.lane, link.direction)
            if len(ahead) > 1 and any(following.road == ahead[1] for following in onward):
                return link
        return None

    @property
    def length(self) -> float:
        """[m]"""
        return sum(abs(step.s_end - step.s_start) for step in self.steps)

    def way_to(self, here: tuple[int, float], there: tuple[int, float]) -> float | None:
        """Way along the route from a road and s to a later one; None: they don't lie on it so. [m]"""
        ways = [end - start for start in self._passes(*here) for end in self._passes(*there) if end >= start]
        return min(ways, default=None)

    def _passes(self, road: int, s: float) -> Iterator[float]:
        """How far along the route a place lies; for every time that it is passed. [m]"""
        before = 0.0
        for step in self.steps:
            into, length = (s - step.s_start) * step.direction, abs(step.s_end - step.s_start)
            if road == step.road and 0.0 <= into <= length:
                yield before + into
            before += length

    def at(self, path_s: float) -> tuple[int, float, int]:
        """Road, s and direction after `path_s` metres of the route; its end beyond it. [m]"""
        left = max(path_s, 0.0)
        for step in self.steps:
            length = abs(step.s_end - step.s_start)
            if left <= length or step is self.steps[-1]:
                return step.road, step.s_start + step.direction * min(left, length), step.direction
            left -= length
        raise AssertionError("a route has steps")


def guide(network: RoadNetwork, stops: Sequence[Placement]) -> RouteGuide | None:
    """The shortest way over the stops; None: there is none."""
    if len(stops) < 2 or any(stop.road == NO_ROAD for stop in stops):
        return None
    places = [(stop.road, stop.lane, stop.s) for stop in stops]
    ways = [1 if is_forward(stop.relative_heading) else -1 for stop in stops]
    steps = network.route(places[0], places[-1], via=places[1:-1], ways=ways)
    return None if steps is None else RouteGuide(network, steps, tuple(places))


ACTIVE = int(Activity.ACTIVE)  # plain: arithmetic of flags takes ten times as long


_ORIGIN = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Running(Protocol):
    """An action of the storyboard."""

    @property
    def is_running(self) -> bool:
        """Whether it runs now."""

    @property
    def domains(self) -> int:
        """What it needs to have for itself, as a bit set."""

    def end(self) -> None:
        """Come to a regular end."""


@dataclass(slots=True, eq=False)
class EntityState:
    """Where an entity is, how fast, and what happened to it in the present frame.

    An entity lives in road coordinates, and its world pose is worked out when somebody asks. Actions that put it
    somewhere in the world (`free_pose`) work the other way round. `offset_t` counts along the road's t-axis and
    `relative_heading` from the road's s-direction, so that both stay continuous where lanes of opposite direction meet;
    the rows of a `NominalMotion` are converted at the end.
    """

    entity: Entity
    network: RoadNetwork
    active: bool = True
    speed: float = 0.0
    road: int = NO_ROAD
    lane: int = 0
    s: float = 0.0
    offset_t: float = 0.0
    relative_heading: float = 0.0
    section: tuple[float, float] = (0.0, -1.0)
    """Range of s in which the lane id holds; empty: unknown. [m]"""
    at_road_end: bool = False
    last_place: tuple[int, float, float] | None = None
    """Road, s and offset in the frame before; None in the world's coordinates. [m]"""
    stuck: bool = False
    """It has not moved in the frame before: the road had ended."""
    free_pose: Pose | None = _ORIGIN
    """World pose as given; None while the entity follows its lane. z, pitch, roll may be NaN (the road's)."""
    _located: bool = True
    _pose: Pose | None = None
    activity: int = 0
    controllers: DrivingControllers = field(default_factory=lambda: DrivingControllers((), for_carla=False))
    steered: int = 0
    """`Activity.STEERED` while a controller has its lateral domain."""
    longitudinal_taken: bool = False
    """An action has moved the entity along in this frame: the default driver does not."""
    speed_taken: bool = False
    """Somebody has set the speed in this frame: it is not derived from the movement."""
    teleported: bool = False
    previous: Pose | None = None
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0)
    odometer: float = 0.0
    standing_since: float | None = None
    road_end_since: float | None = None
    off_road_since: float | None = None
    route: RouteGuide | None = None
    path: PathProgress | None = None
    tow: EntityState | None = None
    trailer: EntityState | None = None
    actions: list[Running] = field(default_factory=list)
    """All that it may do: those of the init first."""
    running: set[Running] = field(default_factory=set)
    """What of it runs."""
    is_watched: bool = False
    """Somebody else looks at it, perhaps in every frame."""

    # ---- where it is -------------------------------------------------------------------------------------------------
    @property
    def name(self) -> str:
        """The entity's name in the scenario."""
        return self.entity.name

    @property
    def lane_types(self) -> frozenset[str]:
        """Types of the lanes that it is placed in where nobody says which lane is its own."""
        return WALKED if self.entity.category is EntityCategory.PEDESTRIAN else DRIVING

    def kept_types(self, *lanes: int) -> frozenset[str]:
        """`lane_types`, and the types of its own lane and of others beside it: what it was put in, it stays in."""
        section = self.network.roads[self.road].section_at(self.s).by_id
        return self.lane_types.union(section[lane].type for lane in (self.lane, *lanes) if lane and lane in section)

    @property
    def place(self) -> Placement:
        """All of it at once; the road coordinates of a free pose as they were last looked up."""
        return Placement(self.road, self.lane, self.s, self.offset_t, self.relative_heading, self.free_pose)

    @property
    def pose(self) -> Pose:
        """World pose. [m], [rad]"""
        if self._pose is None:
            if self.free_pose is None:
                self._pose = _pose_on_road(
                    self.network, self.road, self.lane, self.s, self.offset_t, self.relative_heading
                )
            else:
                if not _is_whole(self.free_pose):
                    self.locate()
                self._pose = world_pose(self.network, self.place)
        return self._pose

    @property
    def plane(self) -> Pose:
        """World pose whose z, pitch and roll may be NaN (the road's): cheap where nobody needs them. [m], [rad]"""
        free = self.free_pose
        return self.pose if free is None else free

    @property
    def is_forward(self) -> bool:
        """Whether it points along the road's s-direction."""
        return is_forward(self.relative_heading)

    @property
    def t(self) -> float:
        """From the road's reference line. [m]"""
        return self.network.lane_state_at(self.road, self.lane, self.s).centre_t + self.offset_t

    def put(self, place: Placement) -> None:
        """Put the entity there."""
        self.road, self.lane, self.s, self.offset_t = place.road, place.lane, place.s, place.offset_t
        self.relative_heading = wrap(place.relative_heading)
        self.free_pose = place.pose
        self._located = True
        self._pose = None
        self.section = (0.0, -1.0)

    def put_in_world(self, pose: Pose) -> None:
        """Put the entity there; its road coordinates are looked up when somebody asks for them."""
        self.free_pose = pose
        self._located = False
        self._pose = None

    def follow_lane(self) -> None:
        """From now on, the road coordinates say where the entity is."""
        self.locate()
        if self.road != NO_ROAD:
            self.free_pose = None
            self._pose = None

    def move_to(self, road: int, lane: int, s: float, offset_t: float) -> None:
        """New road coordinates, same relative heading."""
        self.road, self.lane, self.s, self.offset_t = road, lane, s, offset_t
        self.free_pose = None
        self._located = True
        self._pose = None

    def turn(self, relative_heading: float) -> None:
        """New heading relative to the road's s-direction. [rad]"""
        self.relative_heading = wrap(relative_heading)
        self._pose = None

    def locate(self) -> None:
        """Look up the road coordinates of a free pose."""
        if self._located or self.free_pose is None:
            return
        near = (self.road, self.s) if self.road != NO_ROAD else None
        self.put(locate(self.network, self.free_pose, near=near, lane_types=self.lane_types))

    def road_heading(self) -> float:
        """Heading of the road's s-direction where the entity is; its own without a road. [rad]"""
        self.locate()
        return wrap(self.pose.heading - self.relative_heading)

    # ---- what happened to it -----------------------------------------------------------------------------------------
    def begin_frame(self) -> None:
        """Forget what happened in the frame before."""
        self.activity = ACTIVE | self.steered if self.active else 0
        self.longitudinal_taken = False
        self.speed_taken = False
        self.teleported = False

    def set_speed(self, speed: float) -> None:
        """Set the scalar speed. [m/s]"""
        self.speed = speed
        self.speed_taken = True

    def take_control(self, activity: Activity) -> None:
        """An action moves the entity in this frame, both ways; the default driver must not."""
        self.longitudinal_taken = True
        self.activity |= int(activity)

    def body_frame(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        """A world vector along the entity's own axes (in the plane)."""
        heading = self.plane.heading
        c, s = cos(heading), sin(heading)
        return vector[0] * c + vector[1] * s, vector[1] * c - vector[0] * s, vector[2]


def world_pose(network: RoadNetwork, place: Placement) -> Pose:
    """World pose of a place; what is left to the road in z, pitch and roll is looked up there. [m], [rad]"""
    free = place.pose
    if free is not None and _is_whole(free):
        return free
    road = _ORIGIN if place.road == NO_ROAD else _pose_on_road(network, *place[:4], wrap(place.relative_heading))
    if free is None:
        return road
    z, pitch, roll = (
        given if given == given else own
        for given, own in ((free.z, road.z), (free.pitch, road.pitch), (free.roll, road.roll))
    )
    return Pose(free.x, free.y, z, free.heading, pitch, roll)


def _pose_on_road(
    network: RoadNetwork, road: int, lane: int, s: float, offset_t: float, relative_heading: float
) -> Pose:
    pose = network.pose_at(road, lane, s, network.offset_from_offset_t(road, lane, offset_t))
    turn = relative_heading if network.travel_direction(road, lane) > 0 else relative_heading - pi
    if not turn:
        return pose
    pitch, roll = pose.pitch, pose.roll
    if pitch or roll:  # about the normal of the surface
        turn, pitch, roll = turned_in_surface(turn, pitch, roll)
    return Pose(pose.x, pose.y, pose.z, wrap(pose.heading + turn), pitch, roll)


def _is_whole(free: Pose) -> bool:
    return free.z == free.z and free.pitch == free.pitch and free.roll == free.roll


def locate(
    network: RoadNetwork,
    pose: Pose,
    *,
    near: tuple[int, float] | None = None,
    lane_types: Collection[str] = DRIVING,
) -> Placement:
    """Road coordinates under a world pose, which is kept; road -1 where the network has no roads."""
    if not network.road_ids:
        return Placement(NO_ROAD, 0, 0.0, 0.0, pose.heading, pose)
    located = network.world_to_lane_at(
        pose.x, pose.y, pose.z if pose.z == pose.z else None, near=near, lane_types=lane_types
    )
    lane_pose = network.pose_at(located.road, located.lane, located.s, located.offset)
    heading = difference(pose.heading, lane_pose.heading)
    if lane_pose.pitch or lane_pose.roll:
        heading = turn_for_heading(heading, lane_pose.pitch, lane_pose.roll)
    if network.travel_direction(located.road, located.lane) < 0:
        heading += pi
    offset_t = network.offset_from_offset_t(located.road, located.lane, located.offset)
    return Placement(located.road, located.lane, located.s, offset_t, wrap(heading), pose)


def free(x: float, y: float, heading: float, z: float = nan, pitch: float = nan, roll: float = nan) -> Pose:
    """A world pose of which z, pitch and roll may be left to the road."""
    return Pose(x, y, z, wrap(heading), pitch, roll)
