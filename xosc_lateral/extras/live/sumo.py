"""Drivers in SUMO, through libsumo or TraCI, with the sublane model: SUMO chooses lanes, drivers their places in them.

``changeSublane`` moves a vehicle sideways within what SUMO finds safe. It keeps SUMO from changing lanes while it is
asked for, and also afterwards by what is left of the way. So it is taken back, and the vehicle left alone, as soon as
SUMO wants another lane for it and nobody is in the way there, until SUMO has moved it and it lies still in one lane.
(``setLateralAlignment`` with a number leaves lane changes alone, too, but vehicles reach their places by decimetres
only.)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.plugins import service
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.loop import CATEGORY_OF_CLASS, Row, UnderTest, sumo_entity
from xosc_lateral.extras.live.moment import Moves, Places
from xosc_lateral.extras.live.traffic import Moment, Traffic
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.surroundings.around import SIGHT_DISTANCE, LaneStretch
from xosc_lateral.world.surroundings.context import TRUCKS

HOLD_TIME = 0.5
"""A lane change is over when SUMO has wanted none for so long, and moves the vehicle no more. [s]"""

MOVED_DISTANCE = 0.3
"""A vehicle this far from where its driver wants it was moved by SUMO: its driver goes on from there. [m]"""

_STILL_SPEED, _STILL_OVERHANG = 0.05, 0.05
"""Lateral speed of a vehicle that SUMO does not move [m/s], and how far it may stick out of its lane then. [m]"""

_REASONS, _SIDES, _BLOCKED = 8 | 16 | 32 | 64, 2 | 4, 512 | 1024 | 2048 | 4096
"""Bits of a lane change state (`LaneChangeAction`): strategic, cooperative, for speed, keeping right; left or right;
blocked by a leader or follower there."""

UNDRIVEN_CLASSES = frozenset(
    {"bicycle", "moped", "motorcycle", "scooter", "pedestrian", "wheelchair", "tram", "rail", "rail_urban", "rail_fast",
     "rail_electric", "ship", "container", "cable_car", "subway", "aircraft", "drone"}
)  # fmt: skip
"""Vehicle classes that have no driver of ours."""

_BEND_LENGTH = 20.0
"""Length over which a lane's direction gives its curvature: arcs have a point every few metres. [m]"""


def start(words: Iterable[str]) -> Any:
    """Libsumo with a simulation loaded by the words of SUMO's command line. Raises `SimulationError`: it can't."""
    try:
        import libsumo
    except ImportError as error:
        raise SimulationError("libsumo is not installed: pip install 'xosc-lateral[sumo]'") from error
    try:
        libsumo.start(["sumo", "--no-step-log", *words])
    except Exception as error:  # libsumo's own have no common base
        raise SimulationError(f"SUMO can't start: {' '.join(str(error).split())}") from error
    return libsumo


class SumoRoads:
    """SUMO's lanes as `Roads`: a road is an edge, a lane is its index from the right plus 1, so that ids grow to the
    left. In left-hand networks SUMO counts lanes, and places in them, from the left kerb: `side` is -1 then.
    """

    def __init__(self, connection: Any) -> None:
        self._lane = connection.lane
        net = Path(str(connection.simulation.getOption("net-file")))
        self.left_hand = net.is_file() and service("is_left_handed")(net)
        self.side = -1.0 if self.left_hand else 1.0
        self.names: list[str] = list(connection.lane.getIDList())
        edges = [name.rpartition("_")[0] for name in self.names]
        numbers = {edge: k for k, edge in enumerate(dict.fromkeys(edges))}
        index = [int(name.rpartition("_")[2]) for name in self.names]
        self._count = Counter(map(numbers.__getitem__, edges))
        self.place = {name: (numbers[edge], self._count[numbers[edge]] - k if self.left_hand else k + 1)
                      for name, edge, k in zip(self.names, edges, index, strict=True)}  # fmt: skip
        self._name = {place: name for name, place in self.place.items()}
        self.width = {place: float(connection.lane.getWidth(name)) for name, place in self.place.items()}
        self._length = {place: float(connection.lane.getLength(name)) for name, place in self.place.items()}
        self._middle = {
            (edge, lane): sum(self.width[edge, k] for k in range(1, lane)) + 0.5 * self.width[edge, lane]
            for edge, lane in self._name
        }
        self._courses: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}

    @cached_property
    def _next(self) -> dict[str, str]:
        """The lane that each leads to: by the inner lane of a junction, the straightest way where there are several."""
        following = {}
        for name in self.names:
            links = sorted(self._lane.getLinks(name), key=lambda link: (link[6] != "s", link[0]))
            if links:
                following[name] = links[0][4] or links[0][0]
        return following

    @cached_property
    def _before(self) -> dict[str, str]:
        return {there: here for here, there in reversed(self._next.items())}

    def course(self, place: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Distances along a lane [m] and its direction there [rad], unwrapped."""
        if place not in self._courses:
            shape = np.array(self._lane.getShape(self._name[place]), dtype=np.float64)[:, :2]
            step = np.diff(shape, axis=0)
            length = np.hypot(*step.T)
            step, length = step[length > 0.0], length[length > 0.0]
            along = np.concatenate([[0.0], np.cumsum(length)])
            scale = self._length[place] / max(along[-1], 1e-9)  # a lane's length may be given by hand
            middle = 0.5 * (along[1:] + along[:-1]) * scale
            self._courses[place] = middle, np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        return self._courses[place]

    def heading(self, place: tuple[int, int], s: float) -> float:
        """Direction of travel, counter-clockwise from x. [rad]"""
        return float(np.interp(s, *self.course(place)))

    def columns(self, road: IntArray, lane: IntArray, s: FloatArray) -> dict[str, FloatArray]:
        """See `Roads`; cross slope and grade are not known."""
        places = list(zip(road.tolist(), lane.tolist(), strict=True))
        bend = [
            np.diff(np.interp([at - 0.5 * _BEND_LENGTH, at + 0.5 * _BEND_LENGTH], *self.course(place)))[0]
            / _BEND_LENGTH
            for place, at in zip(places, s.tolist(), strict=True)
        ]
        return {
            "curvature": np.array(bend, dtype=np.float64),
            "lane_width": np.array([self.width[place] for place in places], dtype=np.float64),
            "lane_index": lane.astype(np.float64) - 1.0,
            "lane_count": np.array([self._count[edge] for edge in road.tolist()], dtype=np.float64),
        }

    def section(self, road: int, lane: int, s: float) -> float:
        """See `Roads`: an edge is one."""
        return 0.0

    def path(self, road: int, lane: int, s: float) -> list[LaneStretch]:
        """See `Roads`."""
        edge = self._length[road, lane]
        path = [LaneStretch(road, 0.0, edge, lane, 0.0, s, 1)]
        for neighbour, way in ((self._next, edge - s), (self._before, s)):
            name = self._name[road, lane]
            while way < SIGHT_DISTANCE + edge and (name := neighbour.get(name, "")):
                place = self.place[name]
                length = self._length[place]
                begin = way if neighbour is self._next else -way - length
                path.append(LaneStretch(place[0], 0.0, length, place[1], begin, 0.0, 1))
                way += length
        return path

    def across(self, road: IntArray, lane: IntArray, s: FloatArray, offset: FloatArray) -> tuple[FloatArray, IntArray]:
        """See `Roads`: from the edge's right border; every lane is driven along its own direction."""
        places = zip(road.tolist(), lane.tolist(), strict=True)
        middle = np.array([self._middle[place] for place in places], dtype=np.float64)
        return middle + offset, np.ones(len(road), dtype=np.int64)

    def centre(self, road: int, lane: int, s: FloatArray) -> FloatArray:
        """See `Roads`."""
        return np.full(len(s), self._middle[road, lane])


@dataclass(slots=True)
class _Vehicle:
    """What is known of a vehicle that SUMO drives: class, size [m], lane, until when at least it is SUMO's [s]."""

    kind: str
    length: float
    width: float
    lane: str
    busy_until: float | None = None


class SumoTraffic:
    """Drivers of the vehicles of a SUMO simulation that runs; call `steer` before (or after) every ``simulationStep``.

    The `connection` is libsumo, or one of traci, with a loaded simulation. Nobody of ours drives the `ego`,
    see `UnderTest`. For `seed`, `profiles`, `neighbours` see `Traffic`. Raises `SimulationError` if the sublane
    model is off.
    """

    def __init__(
        self,
        connection: Any,
        profile: DriverProfile,
        *,
        ego: str | Iterable[str] | None = None,
        seed: int = 0,
        profiles: Mapping[str, DriverProfile] | None = None,
        neighbours: Neighbours = Neighbours.BORROW,
    ) -> None:
        self.connection = connection
        sublane = float(connection.simulation.getOption("lateral-resolution"))
        if sublane <= 0.0:
            raise SimulationError("SUMO's sublane model is off: start it with --lateral-resolution 4, say")
        self.roads = SumoRoads(connection)
        self.ego = UnderTest(ego, profiles or ())
        self.traffic = Traffic(
            profile, profiles=profiles, seed=seed, roads=self.roads, left_hand=self.roads.left_hand,
            neighbours=neighbours,
        )  # fmt: skip
        self._known: dict[str, _Vehicle] = {}
        self.moves: dict[str, tuple[float, bool]] = {}
        self.entities: dict[str, Entity] = {}
        """All that `rows` has seen."""
        self.counts = Counter({"collisions": 0, "teleports": 0})
        self.warnings: list[str] = []
        if sublane < (widest := max(self.roads.width.values(), default=0.0)):
            self.warnings.append(
                f"sublanes of {sublane:g} m in lanes of {widest:g} m: SUMO changes lanes more often when vehicles "
                f"leave the middle; with --lateral-resolution {np.ceil(widest):g} it does as without drivers"
            )

    def steer(self) -> Moves:
        """Say where everybody is sideways after the next step.

        Raises `SimulationError` if what the simulation says can't be used; nothing was asked for then, and the
        simulation can go on.
        """
        vehicles, now = self.connection.vehicle, float(self.connection.simulation.getTime())
        step = float(self.connection.simulation.getDeltaT())
        moment = self._moment(now)
        moves = self.traffic.step(now + step, moment)
        for row, name in enumerate(moment.names):
            if moves.steered[row]:
                vehicles.changeSublane(name, self.roads.side * float(moves.offset[row] - moment.offset[row]))
            elif self.moves.get(name, (0.0, False))[1]:  # what is left of the last way would hold SUMO's own back
                vehicles.changeSublane(name, 0.0)
        self.moves = moves.by_name(moment.names)
        return moves

    # ---- a simulation that runs by itself (`loop`) -------------------------------------------------------------------
    def time(self) -> float:
        """Now. [s]"""
        return float(self.connection.simulation.getTime())

    def is_over(self) -> bool:
        """Whether nobody is there, or will be."""
        return bool(self.connection.simulation.getMinExpectedNumber() <= 0)

    def rows(self) -> Iterator[Row]:
        """Where everybody is now."""
        now, vehicles = self.time(), self.connection.vehicle
        for name, x, y, h, speed, lane, s, offset in self.states():
            if name not in self.entities:
                self.entities[name] = sumo_entity(vehicles, name)
            edge, _, index = lane.rpartition("_")
            move = self.moves.get(name, (float("nan"), False))
            z = float(vehicles.getPosition3D(name)[2])
            yield now, name, x, y, h, speed, edge, int(index), s, offset, *move, z, 0.0, 0.0

    def drive(self, step: float) -> None:
        """On by SUMO's step, which is `step` [s]."""
        self.steer()
        self.connection.simulationStep()
        self.counts["collisions"] += len(self.connection.simulation.getCollisions())
        self.counts["teleports"] += self.connection.simulation.getStartingTeleportNumber()

    def states(self) -> Iterable[tuple[str, float, float, float, float, str, float, float]]:
        """Of everybody on a lane: name, x, y [m], heading [rad], speed [m/s], lane, s and offset [m]."""
        vehicles = self.connection.vehicle
        for name in vehicles.getIDList():
            lane, offset = vehicles.getLaneID(name), self.roads.side * float(vehicles.getLateralLanePosition(name))
            x, y = vehicles.getPosition(name)
            if lane not in self.roads.place:  # it is being teleported
                continue
            values = (float(x), float(y), float(vehicles.getSpeed(name)), float(vehicles.getLanePosition(name)), offset)
            if not np.isfinite(values).all() or abs(offset) > _INVALID_NUMBER:
                line = f"vehicle {name!r}: a number that is none; it is left alone"
                if line not in self.warnings:
                    self.warnings.append(line)
                continue
            turned = np.radians(90.0 - float(vehicles.getAngle(name)))
            yield name, values[0], values[1], float(turned), values[2], lane, values[3], offset

    def _moment(self, now: float) -> Moment:
        seen = list(self.states())
        names = tuple(row[0] for row in seen)
        api = self.connection.vehicle
        self._known = {
            row[0]: self._known.get(row[0])
            or _Vehicle(api.getVehicleClass(row[0]), float(api.getLength(row[0])), float(api.getWidth(row[0])), row[5])
            for row in seen
        }
        vehicles = list(self._known.values())
        following = np.array([self._follows(row[0], row[5], row[7], now) for row in seen], dtype=np.bool_)
        x, y, speed, s, offset = (np.array([row[k] for row in seen], dtype=np.float64) for k in (1, 2, 4, 6, 7))
        where = [self.roads.place[row[5]] for row in seen]
        heading = np.array([self.roads.heading(place, at) for place, at in zip(where, s.tolist(), strict=True)])
        road, lane = (np.array([place[k] for place in where], dtype=np.int64) for k in (0, 1))
        length, width = np.array([(one.length, one.width) for one in vehicles]).reshape(-1, 2).T.copy()
        return Moment(
            names, speed, np.array([self.roads.width[place] for place in where]), offset, following,
            np.array(
                [name not in self.ego and one.kind not in UNDRIVEN_CLASSES for name, one in self._known.items()],
                np.bool_,
            ),
            np.array([CATEGORY_OF_CLASS.get(one.kind) in TRUCKS for one in vehicles], dtype=np.bool_),
            places=Places(x, y, heading, road, lane, s, length, width, -0.5 * length),
        )  # fmt: skip

    def _follows(self, name: str, lane: str, offset: float, now: float) -> bool:
        """Whether a vehicle keeps its lane, as far as SUMO is concerned: it wants no other, and lies still in this."""
        vehicles, vehicle = self.connection.vehicle, self._known[name]
        before, vehicle.lane = vehicle.lane, lane
        wishes = [int(vehicles.getLaneChangeState(name, side)[0]) for side in (1, -1)]
        wants = any(wish & _REASONS and wish & _SIDES and not wish & _BLOCKED for wish in wishes)
        changed = before != lane and before.rpartition("_")[0] == lane.rpartition("_")[0]
        wanted, steered = self.moves.get(name, (offset, False))
        if wants or changed or (steered and abs(wanted - offset) > MOVED_DISTANCE):
            vehicle.busy_until = now + HOLD_TIME
        if vehicle.busy_until is None:
            return True
        sticks_out = (
            abs(offset) + 0.5 * vehicle.width > 0.5 * self.roads.width[self.roads.place[lane]] + _STILL_OVERHANG
        )
        if now < vehicle.busy_until or sticks_out or abs(float(vehicles.getLateralSpeed(name))) > _STILL_SPEED:
            return False
        vehicle.busy_until = None
        return True


_INVALID_NUMBER = 1e6
"""SUMO's ``INVALID_DOUBLE`` is far beyond. [m]"""
