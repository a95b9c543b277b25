"""Nominal motion: what maneuvers alone give, before offsets. Made by the player; read by segments, writer, report."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.base.errors import locate
from xosc_lateral.world.scenario.entity import Entity


def axes(yaw: FloatArray, pitch: FloatArray, roll: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ahead, left and up of a body turned by Rz(yaw) Ry(pitch) Rx(roll), as OpenSCENARIO and OSI turn; (n, 3) each."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    return (
        np.stack([cy * cp, sy * cp, -sp], axis=1),
        np.stack([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr], axis=1),
        np.stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr], axis=1),
    )


class Activity(IntFlag):
    """What an entity does in a row (a bit set, stored as uint8)."""

    ACTIVE = 1
    """The entity exists (not before AddEntity, not after DeleteEntity)."""
    LATERAL = 2
    """A lateral action (lane change, lane offset, lateral distance) runs."""
    TRAJECTORY = 4
    """A FollowTrajectory or AcquirePosition-like action moves it."""
    TELEPORTED = 8
    """It was placed anew in the step that ends with this row: motion is not continuous from the row before. Besides
    teleports: a trajectory that begins elsewhere, a lateral action that takes effect at once (shape `step`)."""
    OFF_ROAD = 16
    """Its reference point is on no road."""
    ROAD_END = 32
    """It stands at the end of its road."""
    STEERED = 64
    """A controller of its player has its lateral domain."""


@dataclass(frozen=True, eq=False, slots=True)
class EntityMotion:
    """One entity's rows, one per step, from time 0 to the end; arrays of shape (n,)."""

    entity: Entity  # name, category, bounding box, performance
    time: FloatArray  # [s] from scenario start, uniform
    x: FloatArray
    y: FloatArray
    z: FloatArray
    heading: FloatArray
    pitch: FloatArray
    roll: FloatArray  # x to roll: pose of the reference point (rear axle) [m], [rad]
    speed: FloatArray  # signed scalar speed [m/s]
    road: Int32Array  # index into `RoadNetwork.road_ids`; -1 where the entity is on no road
    lane: Int32Array  # OpenDRIVE lane id; 0 where on no road
    s: FloatArray  # along the road's reference line [m]
    offset: FloatArray  # from the centre of `lane`, positive to the LEFT of the lane's direction of travel [m]
    heading_relative: FloatArray
    """Turn from the lane's direction of travel, about the normal of the road's surface. [rad]"""
    activity: NDArray[np.uint8]  # `Activity` bits

    @property
    def name(self) -> str:
        """The entity's name in the scenario."""
        return self.entity.name


@dataclass(frozen=True, slots=True)
class PlayedAction:
    """An action that the player started (and perhaps ended)."""

    action: Any  # the action of `xosc_lateral.world.scenario`, with its place in the file
    actor: str | None  # entity acting; None for global and user-defined actions
    path: tuple[str, ...]  # names from story to action; ``("Init",)`` for init actions
    start: float  # time of the frame in which it started [s]
    end: float | None  # time at which it ended; None: still running at the end of the run [s]


@dataclass(frozen=True, slots=True)
class Note:
    """Something that was not played, or not as written: never silent."""

    what: str
    path: str
    line: int | None
    element: str | None = None

    def __str__(self) -> str:
        """One line: file, line, element, what."""
        return " ".join(locate(self.what, path=self.path, line=self.line, element=self.element).split())


CUT_OFF = "still runs at the time limit"
"""How a warning of a run that was cut off begins."""


@dataclass(frozen=True, eq=False, slots=True)
class NominalMotion:
    """A played scenario."""

    step: float  # [s]
    entities: tuple[EntityMotion, ...]  # in the scenario's order
    actions: tuple[PlayedAction, ...]  # every action started, in order of start
    end_time: float  # [s]
    ended_by: str  # ``"stop trigger"`` or ``"time limit"`` or what else ended the run
    notes: tuple[Note, ...]  # what could not be played as written
    cut_off: Note | None = None
    """Says that the time limit came before the scenario's end, or before all its stories were over."""
