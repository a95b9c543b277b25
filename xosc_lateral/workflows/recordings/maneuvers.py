"""Lane changes of a recording, as `reconstruct` finds them, for a maneuver profile."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET
from xosc_lateral.drivers.model.maneuvers import BEFORE_STEP, COLUMNS, Maneuvers, fit_maneuvers
from xosc_lateral.drivers.model.profile import SIDES
from xosc_lateral.workflows.recordings.encounters import ENCOUNTER_DISTANCE
from xosc_lateral.workflows.recordings.lane_graph import At, RoadLanes
from xosc_lateral.workflows.recordings.lateral import Transition, lateral_plan
from xosc_lateral.workflows.recordings.recorded import own_lateral, place_tracks
from xosc_lateral.workflows.recordings.recordings import read_recording
from xosc_lateral.world.motion.nominal import EntityMotion

BEFORE = np.arange(-8.0, 0.5 * BEFORE_STEP, BEFORE_STEP)
"""Moments of the way before a lane change. [s]"""


def read_maneuvers(recording: Path, road: Path | None = None) -> Maneuvers:
    """Maneuver profile of a recording; raises `FormatError`, `NotEnoughDataError`."""
    traffic = read_recording(recording, road=road)
    vehicles = place_tracks(traffic.tracks, traffic.network, *traffic.span).vehicles
    measured, sides, aborted, keeping = defaultdict[str, list[float]](list), list[bool](), 0, 0.0
    lanes = RoadLanes(traffic.network)
    ways: dict[str, list[FloatArray]] = {side: [] for side in SIDES}
    for vehicle in vehicles:
        plan = lateral_plan(vehicle, float(vehicle.time[0]))
        if plan.is_played:
            continue
        keeping += float(np.ptp(vehicle.time)) - sum(transition.duration for transition in plan.transitions)
        aborted += sum(transition.aborted and not transition.cut for transition in plan.transitions)
        free = float(vehicle.time[0])
        for transition in plan.transitions:
            if transition.lanes and not transition.cut:
                for name, value in zip(COLUMNS, _facts(vehicle, transition, vehicles, lanes), strict=True):
                    measured[name].append(value)
                sides.append(transition.lanes > 0)
                way = _way_before(vehicle, transition, free)
                if way is not None:
                    ways[SIDES[transition.lanes < 0]].append(way)
            free = transition.end
    columns = {name: np.array(measured[name]) for name in COLUMNS}
    before = {side: np.array(rows) for side, rows in ways.items()}
    return fit_maneuvers(
        columns, np.array(sides), before=before, hours=max(keeping, 1.0) / 3600.0, aborted=aborted // 2,
        recording=recording.name,
    )  # fmt: skip


def _facts(
    vehicle: EntityMotion, transition: Transition, vehicles: Sequence[EntityMotion], lanes: RoadLanes
) -> tuple[float, ...]:
    """`COLUMNS` of a lane change."""
    time = vehicle.time
    first, last = (min(int(np.searchsorted(time, at)), len(time) - 1) for at in (transition.start, transition.end))
    speed = float(vehicle.speed[first])
    gap, closing = np.nan, np.nan
    rows = [(other, int(np.searchsorted(other.time, time[first]))) for other in vehicles]
    there = [(other, k) for other, k in rows if k < len(other.time) and other.time[k] - time[first] <= BEFORE_STEP]
    places = [
        At(
            int(one.road[k]),
            int(one.lane[k]),
            int(one.way(slice(k, k + 1))[0]),
            float(one.s[k]),
            one.box.center_x,
            one.box.length,
        )
        for one, k in there
    ]
    ahead, _ = lanes.nearest(places, next(k for k, (one, _) in enumerate(there) if one is vehicle))
    if ahead is not None and ahead[1] < ENCOUNTER_DISTANCE:
        other, row = there[ahead[0]]
        gap, closing = ahead[1], speed - float(other.speed[row])
    change, width = float(vehicle.speed[last]) - speed, float(vehicle.lane_width[first])
    return transition.duration, speed, change, width, vehicle.box.length, gap, closing


def _way_before(vehicle: EntityMotion, transition: Transition, free: float) -> FloatArray | None:
    """Where a vehicle drives at `BEFORE`, from the first of these moments; None: it is in another maneuver then. [m]"""
    moments = transition.start + BEFORE
    if moments[0] < free:
        return None
    aside, base, _ = own_lateral(vehicle)
    way = np.interp(moments, vehicle.time, aside - np.interp(moments[-1], vehicle.time, base))
    return None if np.abs(way).max() > SETTLED_OFFSET + 0.5 else np.asarray(way - way[0])
