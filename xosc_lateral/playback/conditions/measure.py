"""In which way a condition measures its distance."""

from __future__ import annotations

from typing import Protocol

from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario import Place
from xosc_lateral.scenario.enums import CoordinateSystem, RelativeDistanceType, RoutingAlgorithm

_SHORTEST = (None, RoutingAlgorithm.UNDEFINED, RoutingAlgorithm.SHORTEST)


class Measured(Protocol):
    """A condition that measures a distance."""

    @property
    def coordinate_system(self) -> CoordinateSystem | None:
        """In which it is measured; None: not said."""

    @property
    def distance_type(self) -> RelativeDistanceType | None:
        """What of it; None: not said."""

    @property
    def routing_algorithm(self) -> RoutingAlgorithm | None:
        """Which way along the road; None: not said."""

    @property
    def freespace(self) -> bool:
        """Between boxes, not between reference points."""

    @property
    def place(self) -> Place:
        """Where it stands."""


def measure_of(content: Measured, simulation: Simulation) -> tuple[CoordinateSystem, RelativeDistanceType]:
    """Defaults of the standard: entity frame, euclidian. `alongRoute` of version 1.0 names the road, but not which
    component of the distance; a euclidian one is the same in every frame (so the reference player has it, too).

    What is measured otherwise than asked for is noted.
    """
    along_route = getattr(content, "along_route", None)
    system = content.coordinate_system or (CoordinateSystem.ROAD if along_route else CoordinateSystem.ENTITY)
    kind = content.distance_type or RelativeDistanceType.EUCLIDIAN
    if kind is RelativeDistanceType.EUCLIDIAN:
        return system, kind
    if content.routing_algorithm not in _SHORTEST and system in (CoordinateSystem.ROAD, CoordinateSystem.LANE):
        simulation.note(
            f"routingAlgorithm '{content.routing_algorithm}': measured along the shortest way instead", content.place
        )
    if content.freespace and system is CoordinateSystem.TRAJECTORY:
        simulation.note("free space along a trajectory: measured along the entity's own axes instead", content.place)
    return system, kind
