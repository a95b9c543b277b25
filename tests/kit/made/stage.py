"""What a scenario is put together from: chance, a road, and who is on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from tests.kit.made.roads import Map
from tests.kit.made.xml import element
from xosc_lateral.world.road.network import RoadNetwork

T = TypeVar("T")


@dataclass
class Stage:
    """Of one scenario.

    Parameters
    ----------
    rng : Generator
    map : Map
    network : RoadNetwork
        The same, to evaluate.
    start : dict
        Entity -> its lane, s [m] and speed [m/s] at the start.
    """

    rng: np.random.Generator
    map: Map
    network: RoadNetwork
    start: dict[str, tuple[int, float, float]] = field(default_factory=dict)
    declared: dict[str, str] = field(default_factory=dict)  # parameters: name -> kind and value
    variables: dict[str, str] = field(default_factory=dict)
    absent: tuple[str, ...] = ()
    trailers: dict[str, str] = field(default_factory=dict)  # trailer -> who may draw it

    def number(self, low: float, high: float) -> float:
        """One, rounded so that it reads well."""
        return round(float(self.rng.uniform(low, high)), 2)

    def pick(self, *options: T) -> T:
        """One of them."""
        return options[int(self.rng.integers(len(options)))]

    def flag(self, share: float = 0.5) -> bool:
        """True in a share of cases."""
        return bool(self.rng.random() < share)

    def other(self, name: str) -> str:
        """Somebody else who is there from the start."""
        return self.pick(*(one for one in self.start if one != name))

    def some_lane(self) -> int:
        """A lane in the direction in which all drive."""
        return self.map.along * int(self.rng.integers(1, self.map.lanes + 1))

    def ahead(self, name: str, low: float, high: float) -> tuple[str, float]:
        """Road and s of a place so far before where somebody starts, on the way that all can go."""
        s = self.start[name][1] + self.number(low, high)
        for road in self.map.ways[0]:
            index = self.network.index_of(road)
            length = self.network.roads[index].length
            if s < length - 5:
                return road, s
            s -= length
        return self.map.ways[0][-1], length - 10.0

    # ---- positions ---------------------------------------------------------------------------------------------------
    def lane_position(self, name: str, low: float, high: float, lane: int | None = None) -> str:
        """Somewhere ahead, on a lane."""
        road, s = self.ahead(name, low, high)
        offset = self.number(-0.6, 0.6) if self.flag(0.3) else None
        return element("LanePosition", roadId=road, laneId=lane or self.some_lane(), s=s, offset=offset)

    def world_position(self, name: str, low: float, high: float) -> str:
        """Somewhere ahead, in world coordinates."""
        road, s = self.ahead(name, low, high)
        pose = self.network.lane_to_world(self.network.index_of(road), self.some_lane(), s)
        return element("WorldPosition", x=float(pose.x), y=float(pose.y), h=float(pose.heading))

    def position(self, name: str, low: float = 40.0, high: float = 150.0) -> str:
        """Somewhere ahead, in one of the standard's ways."""
        kind = self.pick(
            "lane", "lane", "world", "road", "relative lane", "relative road", "object", "relative world", "route"
        )
        if kind == "world":
            return self.world_position(name, low, high)
        if kind == "road":
            road, s = self.ahead(name, low, high)
            return element("RoadPosition", roadId=road, s=s, t=self.map.along * self.number(1, 5))
        if kind == "relative lane":
            how = {self.pick("ds", "dsLane"): self.number(10, 60)}
            return element(
                "RelativeLanePosition", entityRef=self.other(name), dLane=0, offset=self.number(-0.5, 0.5), **how
            )
        if kind == "relative road":
            return element(
                "RelativeRoadPosition", entityRef=self.other(name), ds=self.number(10, 60), dt=self.number(-1, 1)
            )
        if kind == "object":
            return element(
                "RelativeObjectPosition", entityRef=self.other(name), dx=self.number(8, 40), dy=self.number(-2, 2)
            )
        if kind == "relative world":
            return element(
                "RelativeWorldPosition", entityRef=self.other(name), dx=self.number(5, 30), dy=self.number(0, 9)
            )
        if kind == "route":
            return self.route_position(name)
        return self.lane_position(name, low, high)

    def route(self, name: str) -> str:
        """From where somebody starts along one of the ways."""
        lane, s, _ = self.start[name]
        way = self.pick(*self.map.ways)
        points = [self.waypoint("1", lane, s), *(self.waypoint(road, lane, self.number(20, 60)) for road in way[1:])]
        if len(way) == 1:
            points.append(self.waypoint("1", lane, min(s + 100.0, self.map.length - 10.0)))
        return element("Route", *points, name="way", closed=False)

    def waypoint(self, road: str, lane: int, s: float) -> str:
        """One, on a lane."""
        place = element("LanePosition", roadId=road, laneId=lane, s=s)
        return element("Waypoint", element("Position", place), routeStrategy="shortest")

    def route_position(self, name: str) -> str:
        """So far along a route, in lane coordinates."""
        lane, _, _ = self.start[name]
        place = element("FromLaneCoordinates", pathS=self.number(30, 95), laneId=lane)
        return element("RoutePosition", element("RouteRef", self.route(name)), element("InRoutePosition", place))

    def path(self, name: str, points: int, spacing: float) -> list[tuple[float, float, float]]:
        """Poses ahead of where somebody starts, weaving about the lane."""
        lane = self.start[name][0]
        weave = self.number(0, 1.5)
        way, found = self.ahead(name, 20, 21), []
        road = self.network.index_of(way[0])
        for k in range(points):
            at = min(way[1] + k * spacing, self.network.roads[road].length)
            pose = self.network.lane_to_world(road, lane, at, weave * math.sin(k))
            found.append((float(pose.x), float(pose.y), float(pose.heading)))
        return found
