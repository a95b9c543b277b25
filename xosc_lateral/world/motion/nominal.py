"""Nominal motion: what maneuvers alone give, before offsets. Made by the player; read by segments, writer, report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntFlag
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IndexArray, rows_where
from xosc_lateral.base.note import Note
from xosc_lateral.base.track import Track
from xosc_lateral.world.road.positions import RouteStep
from xosc_lateral.world.scenario.entity import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory
from xosc_lateral.world.scenario.place import Place


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
class EntityMotion(Track):
    """An entity over time; a played one has all columns of `MOTION`, one row per step, from time 0 to the end."""

    entity: Entity  # name, category, bounding box, performance

    @classmethod
    def of(cls, entity: Entity, time: FloatArray, **columns: NDArray[Any]) -> Self:
        """Its breaks are the rows in which it is placed anew."""
        return cls(entity.name, time, columns, placed_anew(columns.get("activity")), entity)

    def way(self, rows: slice | IndexArray = slice(None)) -> NDArray[np.int64]:
        """1: it drives as its lane is driven; -1: against it, as who overtakes on a road with one lane each way."""
        return np.where(np.cos(self.heading_relative[rows]) >= 0.0, 1, -1)

    @property
    def box(self) -> BoundingBox:
        """The entity's."""
        return self.entity.bounding_box

    def having(self, **columns: NDArray[Any]) -> Self:
        """With these columns, in place of its own of those names; the breaks are those of its activity."""
        breaks = placed_anew(columns["activity"]) if "activity" in columns else self.breaks
        return replace(self, columns={**self.columns, **columns}, breaks=breaks)


def placed_anew(activity: NDArray[np.uint8] | None) -> IndexArray:
    """Rows, from 1 on, into which nobody moves from the one before."""
    if activity is None:
        return np.empty(0, dtype=np.intp)
    return rows_where(len(activity), lambda rows: (activity[rows] & np.uint8(Activity.TELEPORTED)) != 0, 1)


USUAL_HEIGHT = 1.5
"""Of a vehicle that is seen from above. [m]"""


def made_vehicle(
    name: str, length: float, width: float, ahead: float, height: float = USUAL_HEIGHT, kind: str = ""
) -> Entity:
    """One from no file; `ahead`: its middle before the reference point, the rear axle. [m]"""
    box = BoundingBox(ahead, 0.0, 0.5 * height, length, width, height)
    return Entity(name, EntityCategory.VEHICLE, Place("", 0, ""), box, kind=kind)


POSE = ("x", "y", "z", "heading", "pitch", "roll", "speed")
"""Columns of a path."""
MOTION = (*POSE, "road", "lane", "s", "offset", "heading_relative", "activity")
"""Columns of what is played, in the recorder's order."""


@dataclass(frozen=True, slots=True)
class PlayedAction:
    """An action that the player started (and perhaps ended)."""

    action: Any  # the action of `xosc_lateral.world.scenario`, with its place in the file
    actor: str | None  # entity acting; None for global and user-defined actions
    path: tuple[str, ...]  # names from story to action; ``("Init",)`` for init actions
    start: float  # time of the frame in which it started [s]
    end: float | None  # time at which it ended; None: still running at the end of the run [s]


class FollowedRoute(NamedTuple):
    """A route that an entity got."""

    entity: str
    time: float  # [s]
    steps: tuple[RouteStep, ...]
    stops: tuple[tuple[int, int, float], ...]  # road, lane and s of the waypoints [m]
    place: Place  # of the action


CUT_OFF = "still runs at the time limit"
"""How a warning of a run that was cut off begins."""


@dataclass(frozen=True, eq=False, slots=True)
class MovingTraffic:
    """Whatever moves, on one clock: played, recorded, or run by somebody else."""

    step: float  # [s]
    entities: tuple[EntityMotion, ...]  # in the scenario's order
    actions: tuple[PlayedAction, ...] = ()  # every action started, in order of start


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class NominalMotion(MovingTraffic):
    """A played scenario."""

    end_time: float  # [s]
    ended_by: str  # ``"stop trigger"`` or ``"time limit"`` or what else ended the run
    notes: tuple[Note, ...]  # what could not be played as written, and, as warnings, what can hardly be meant
    routes: tuple[FollowedRoute, ...] = ()  # in order of time
    cut_off: Note | None = None
    """Says that the time limit came before the scenario's end, or before all its stories were over."""

    @property
    def messages(self) -> tuple[Note, ...]:
        """All that is to be said of the run."""
        return self.notes if self.cut_off is None else (self.cut_off, *self.notes)
