"""Lane changes of a recording, as `reconstruct` finds them, for a maneuver profile."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET
from xosc_lateral.drivers.model.maneuvers import BEFORE_STEP, COLUMNS, Maneuvers, fit_maneuvers
from xosc_lateral.drivers.model.profile import SIDES
from xosc_lateral.extras.recordings.lateral import Transition, lateral_plan
from xosc_lateral.extras.recordings.recorded import own_lateral, place_tracks
from xosc_lateral.extras.recordings.recordings import read_recording
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings.lane_order import RoadLanes, vehicle_ahead

BEFORE = np.arange(-8.0, 0.5 * BEFORE_STEP, BEFORE_STEP)
"""Moments of the way before a lane change. [s]"""


def read_maneuvers(recording: Path, road: Path | None = None) -> Maneuvers:
    """Maneuver profile of a recording; raises `FormatError`, `NotEnoughDataError`."""
    traffic = read_recording(recording, road=road)
    vehicles = place_tracks(traffic.tracks, traffic.network, *traffic.span).vehicles
    return maneuvers_of(vehicles, vehicles, traffic.network, recording.name)


def maneuvers_of(
    drivers: Iterable[EntityMotion], vehicles: Sequence[EntityMotion], network: RoadNetwork, recording: str
) -> Maneuvers:
    """Maneuver profile of some drivers among vehicles in the lanes of a road; raises `NotEnoughDataError`."""
    measured, sides, aborted, keeping = defaultdict[str, list[float]](list), list[bool](), 0, 0.0
    lanes = RoadLanes(network)
    ways: dict[str, list[FloatArray]] = {side: [] for side in SIDES}
    for vehicle in drivers:
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
        recording=recording,
    )  # fmt: skip


def _facts(
    vehicle: EntityMotion, transition: Transition, vehicles: Sequence[EntityMotion], lanes: RoadLanes
) -> tuple[float, ...]:
    """`COLUMNS` of a lane change."""
    ends = np.searchsorted(vehicle.time, (transition.start, transition.end))
    first, last = np.minimum(ends, len(vehicle.time) - 1).tolist()
    speed, width = float(vehicle.speed[first]), float(vehicle.lane_width[first])
    ahead = vehicle_ahead(vehicle, first, vehicles, lanes)
    return transition.duration, speed, float(vehicle.speed[last]) - speed, width, vehicle.box.length, *ahead


def _way_before(vehicle: EntityMotion, transition: Transition, free: float) -> FloatArray | None:
    """Where a vehicle drives at `BEFORE`, from the first of these moments; None: it is in another maneuver then. [m]"""
    moments = transition.start + BEFORE
    if moments[0] < free:
        return None
    aside, base, _ = own_lateral(vehicle)
    way = np.interp(moments, vehicle.time, aside - np.interp(moments[-1], vehicle.time, base))
    return None if np.abs(way).max() > SETTLED_OFFSET + 0.5 else np.asarray(way - way[0])
