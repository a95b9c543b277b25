"""Small scenarios of two vehicles beside each other, on roads of either hand whose lanes run along s or against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from laboratory.storyboard import Vehicle

LANE_WIDTH = 3.86
"""Median of the recording that the shipped profiles are fitted on. [m]"""

LENGTH = 3000.0
"""Of every road: further than anybody drives. [m]"""

SLOW, FAST = 0, 1
"""Lanes: beside the hard shoulder, and the overtaking one."""


@dataclass(frozen=True, slots=True)
class Road:
    """Two lanes, straight.

    Parameters
    ----------
    left_hand : bool
        Left-hand traffic: the overtaking lane is on the right.
    along : bool
        Driven along the reference line, or against it.
    """

    left_hand: bool
    along: bool

    def __str__(self) -> str:
        return f"{'left' if self.left_hand else 'right'}-hand, {'along' if self.along else 'against'} s"

    @property
    def outwards(self) -> float:
        """Which way is away from the overtaking lane: +1 left of travel, -1 right."""
        return 1.0 if self.left_hand else -1.0

    def lane(self, which: int) -> int:
        """OpenDRIVE id of `SLOW` or `FAST`."""
        return (1 if self.along == self.left_hand else -1) * (2 - which)

    def to_xml(self) -> str:
        """As OpenDRIVE."""
        sides = {
            sign: "".join(
                f'<lane id="{sign * number}" type="driving" level="false">'
                f'<width sOffset="0" a="{LANE_WIDTH}" b="0" c="0" d="0"/></lane>'
                for number in numbers
            )
            for sign, numbers in ((1, (2, 1)), (-1, (1, 2)))
        }
        return (
            '<?xml version="1.0"?>\n<OpenDRIVE><header revMajor="1" revMinor="6"/>'
            f'<road id="1" length="{LENGTH}" junction="-1" rule="{"LHT" if self.left_hand else "RHT"}">'
            f'<planView><geometry s="0" x="0" y="0" hdg="0" length="{LENGTH}"><line/></geometry></planView>'
            f'<lanes><laneSection s="0"><left>{sides[1]}</left><center><lane id="0" type="none"/></center>'
            f"<right>{sides[-1]}</right></laneSection></lanes></road></OpenDRIVE>\n"
        )


ROADS = tuple(Road(left_hand, along) for left_hand, along in product((False, True), (True, False)))


@dataclass(frozen=True, slots=True)
class Driven:
    """A vehicle at constant speed.

    Parameters
    ----------
    name : str
    vehicle : Vehicle
    lane : int
        `SLOW` or `FAST`.
    start : float
        Of its rear bumper, along travel. [m]
    speed : float
        [m/s]
    """

    name: str
    vehicle: Vehicle
    lane: int
    start: float
    speed: float

    @property
    def length(self) -> float:
        """[m]"""
        return self.vehicle.front + self.vehicle.rear

    @property
    def front(self) -> float:
        """Of its front bumper at time 0. [m]"""
        return self.start + self.length


def write_scenario(folder: Path, name: str, road: Road, vehicles: Sequence[Driven], duration: float) -> Path:
    """Write `name`.xosc and its road; returns the scenario's path. `duration` in [s]."""
    (folder / f"{name}.xodr").write_text(road.to_xml())
    path = folder / f"{name}.xosc"
    path.write_text(
        '<?xml version="1.0"?>\n<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" '
        f'description="{name}" author="xosc-lateral"/><CatalogLocations/><RoadNetwork><LogicFile '
        f'filepath="{name}.xodr"/></RoadNetwork><Entities>{"".join(map(_entity, vehicles))}</Entities>'
        f"<Storyboard><Init><Actions>{''.join(_init(one, road) for one in vehicles)}</Actions></Init>"
        f"{_stop(duration)}</Storyboard></OpenSCENARIO>\n"
    )
    return path


def _entity(one: Driven) -> str:
    _, category, length, width, height, centre, wheelbase, speed, acceleration, mass = one.vehicle.value
    axle = f'maxSteering="0.5" wheelDiameter="0.7" trackWidth="{0.85 * width}"'
    return (
        f'<ScenarioObject name="{one.name}"><Vehicle name="{category}" vehicleCategory="{category}" mass="{mass}">'
        f'<BoundingBox><Center x="{centre}" y="0" z="{0.5 * height}"/>'
        f'<Dimensions width="{width}" length="{length}" height="{height}"/></BoundingBox>'
        f'<Performance maxSpeed="{speed}" maxAcceleration="{acceleration}" maxDeceleration="9"/>'
        f'<Axles><FrontAxle {axle} positionX="{wheelbase}" positionZ="0.35"/>'
        f'<RearAxle {axle} positionX="0" positionZ="0.35"/></Axles><Properties/></Vehicle></ScenarioObject>'
    )


def _init(one: Driven, road: Road) -> str:
    along = one.start + one.vehicle.rear
    s = along if road.along else LENGTH - along
    return (
        f'<Private entityRef="{one.name}"><PrivateAction><TeleportAction><Position><LanePosition roadId="1" '
        f'laneId="{road.lane(one.lane)}" s="{s}"/></Position></TeleportAction></PrivateAction><PrivateAction>'
        '<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" '
        f'value="0"/><SpeedActionTarget><AbsoluteTargetSpeed value="{one.speed}"/></SpeedActionTarget></SpeedAction>'
        "</LongitudinalAction></PrivateAction></Private>"
    )


def _stop(duration: float) -> str:
    return (
        '<StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>'
        f'<SimulationTimeCondition value="{duration}" rule="greaterOrEqual"/></ByValueCondition></Condition>'
        "</ConditionGroup></StopTrigger>"
    )
