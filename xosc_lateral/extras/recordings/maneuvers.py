"""Lane changes of a recording, as `reconstruct` finds them, for the maneuver law of a profile."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET
from xosc_lateral.drivers.fitting.maneuvers import SIDES, MeasuredChanges, fit_maneuvers
from xosc_lateral.drivers.model.profile import BEFORE_STEP, Maneuvers
from xosc_lateral.extras.recordings.lane_order import RoadLanes, vehicle_next
from xosc_lateral.extras.recordings.lateral import Transition, lateral_plan
from xosc_lateral.extras.recordings.recorded import own_lateral, place_tracks
from xosc_lateral.extras.recordings.recordings import read_recording
from xosc_lateral.workflows.result import PathLike
from xosc_lateral.world.motion.nominal import EntityMotion

BEFORE = np.arange(-8.0, 0.5 * BEFORE_STEP, BEFORE_STEP)
"""Moments of the way before a lane change. [s]"""


def read_maneuvers(recording: PathLike, road: PathLike | None = None) -> Maneuvers:
    """Law of a recording's lane changes; raises `FormatError`, `NotEnoughDataError`."""
    traffic = read_recording(Path(recording), road=None if road is None else Path(road))
    vehicles = place_tracks(traffic.tracks, traffic.network, *traffic.span).vehicles
    return law_of(changes_of(vehicles, vehicles, RoadLanes(traffic.network)), traffic.name)


class VehicleChanges(NamedTuple):
    """Lane changes of one vehicle, and what it did beside them."""

    motion: EntityMotion
    changes: list[tuple[float, ...]]  # `MeasuredChanges` of each
    crossing: list[int]  # row in which each is over the marking
    ways: list[tuple[str, FloatArray]]  # side, and way before [m]
    keeping: float  # time in its lane [s]
    aborted: float  # lane changes that it gave up


def changes_of(
    drivers: Iterable[EntityMotion], vehicles: Sequence[EntityMotion], lanes: RoadLanes
) -> list[VehicleChanges]:
    """Lane changes of some drivers among vehicles in the lanes of a road."""
    measured_changes = list[VehicleChanges]()
    for vehicle in drivers:
        plan = lateral_plan(vehicle, float(vehicle.time[0]))
        if plan.is_played:
            continue
        keeping = float(np.ptp(vehicle.time)) - sum(transition.duration for transition in plan.transitions)
        aborted = 0.5 * sum(transition.aborted and not transition.cut for transition in plan.transitions)
        changes = VehicleChanges(vehicle, [], [], [], keeping, aborted)
        free = float(vehicle.time[0])
        for transition in plan.transitions:
            if transition.lanes and not transition.cut:
                measured, crossing = _measured(vehicle, transition, vehicles, lanes)
                changes.changes.append(measured)
                changes.crossing.append(crossing)
                way = _way_before(vehicle, transition, free)
                if way is not None:
                    changes.ways.append((SIDES[transition.lanes < 0], way))
            free = transition.end
        measured_changes.append(changes)
    return measured_changes


def law_of(vehicles: Sequence[VehicleChanges], recording: str) -> Maneuvers:
    """Their law; raises `NotEnoughDataError`."""
    rows = [one for vehicle in vehicles for one in vehicle.changes]
    duration, gap, speed_change, end, left = np.array(rows).reshape(-1, len(MeasuredChanges._fields)).T
    ways = [one for vehicle in vehicles for one in vehicle.ways]
    return fit_maneuvers(
        MeasuredChanges(duration, gap, speed_change, end, left > 0.0),
        before={side: np.array([way for other, way in ways if other == side]) for side in SIDES},
        hours=max(sum(vehicle.keeping for vehicle in vehicles), 1.0) / 3600.0,
        aborted=sum(vehicle.aborted for vehicle in vehicles), recording=recording,
    )  # fmt: skip


def _measured(
    vehicle: EntityMotion, transition: Transition, vehicles: Sequence[EntityMotion], lanes: RoadLanes
) -> tuple[tuple[float, ...], int]:
    """`MeasuredChanges` of one, and the row in which it is in the other lane."""
    ends = np.searchsorted(vehicle.time, (transition.start, transition.end))
    first, last = np.minimum(ends, len(vehicle.time) - 1).tolist()
    aside, base, number = own_lateral(vehicle)
    speed_change = float(vehicle.speed[last] - vehicle.speed[first])
    gap = vehicle_next(vehicle, first, vehicles, lanes).gap
    measured = transition.duration, gap, speed_change, float(aside[last] - base[last]), float(transition.lanes > 0)
    return measured, first + int(np.argmax(number[first : last + 1] == number[last]))


def _way_before(vehicle: EntityMotion, transition: Transition, free: float) -> FloatArray | None:
    """Where a vehicle drives at `BEFORE`, from the first of these moments; None: it is in another maneuver then. [m]"""
    moments = transition.start + BEFORE
    if moments[0] < free:
        return None
    aside, base, _ = own_lateral(vehicle)
    way = np.interp(moments, vehicle.time, aside - np.interp(moments[-1], vehicle.time, base))
    return None if np.abs(way).max() > SETTLED_OFFSET + 0.5 else np.asarray(way - way[0])
