"""What the ego sees of the vehicles of a played scenario, nominal and with lifelike movement, many seeds at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.cut_in import Encounter
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.workflows.conversion.enrich import enrich
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.motion.segments import cut_segments

FloatArray = NDArray[np.float64]

EGO = "Ego"
EVERY = 5
"""Of the player's steps of 0.02 s: 0.1 s, the step of the published models."""


@dataclass(frozen=True, eq=False)
class Target:
    """One vehicle of a scenario beside the ego; arrays of shape (1 + seeds, m), the nominal one first.

    Parameters
    ----------
    scenario, name : str
    step : float
        [s]
    position, speed : array, shape (m,)
        Along the road, of the vehicle's centre. [m], [m/s]
    ego_position, ego_speed : array, shape (m,)
        As the scenario drives it. [m], [m/s]
    towards : array
        From the centre of the lane that it begins in, positive towards the ego lane. [m]
    distance : array
        From the ego lane's centre, positive on the vehicle's own side. [m]
    keeps_lane : array of bool, shape (m,)
        Road-following beside the ego lane: whoever alarms here is wrong.
    begins : float
        Start of its first lateral action; NaN: none. [s]
    lane_width, width, length, ego_length, ego_width : float
        [m]
    """

    scenario: str
    name: str
    step: float
    position: FloatArray
    speed: FloatArray
    ego_position: FloatArray
    ego_speed: FloatArray
    towards: FloatArray
    distance: FloatArray
    keeps_lane: NDArray[np.bool_]
    begins: float
    lane_width: float
    width: float
    length: float
    ego_length: float
    ego_width: float

    def seen(self) -> Encounter:
        """Its whole course as the scenario's own ego sees it."""
        gap = self.position - self.ego_position - 0.5 * (self.length + self.ego_length)
        shape = self.towards.shape
        return Encounter(
            towards=self.towards,
            lateral_speed=np.gradient(self.towards, self.step, axis=1),
            clearance=np.abs(self.distance) - 0.5 * (self.width + self.ego_width),
            gap=np.broadcast_to(gap, shape),
            closing=np.broadcast_to(self.ego_speed - self.speed, shape),
            lane_width=self.lane_width,
            width=self.width,
            length=self.length,
            ego_length=self.ego_length,
        )


def targets_of(path: Path, profile: DriverProfile, seeds: int) -> tuple[list[Target], int]:
    """Vehicles beside the ego, and how many runs of the scenario brought a contact or departure that it had not before.

    Parameters
    ----------
    path : Path
        Scenario with an entity `Ego`.
    profile : DriverProfile
        Drives everybody else.
    seeds : int
        Runs, seeds 0, 1, ...
    """
    played = play_scenario(path, time_limit=60.0)
    others = [e for e in played.motion.entities if e.name != EGO and e.entity.is_vehicle]
    drivers = {entity.name: profile for entity in others}
    offsets: dict[str, list[FloatArray]] = {e.name: [np.zeros(len(e.time))[::EVERY]] for e in others}
    troubled = 0
    for seed in range(seeds):
        enriched = enrich(played.motion, played.network, drivers, seed=seed)
        troubled += bool(enriched.new_contacts)
        for entity in others:
            offsets[entity.name].append(enriched.entity(entity.name).deviation[::EVERY])
    found = [_target(path.stem, played, entity, np.array(offsets[entity.name])) for entity in others]
    return [target for target in found if target is not None], troubled


def _target(scenario: str, played: Played, entity: EntityMotion, deviation: FloatArray) -> Target | None:
    """None for a vehicle that begins in the ego's own lane, or more than a lane away."""
    ego = next(one for one in played.motion.entities if one.name == EGO)
    network, rows = played.network, slice(None, None, EVERY)
    road, lane, s = entity.road[rows], entity.lane[rows], entity.s[rows]
    travel = network.travel_direction(int(ego.road[0]), int(ego.lane[0]))
    if abs(int(lane[0]) - int(ego.lane[0])) != 1 or (road != ego.road[0]).any():
        return None
    # Left of travel is positive everywhere: t of the lane's centre, in the ego's direction, plus the offset in it.
    ego_lane = np.full_like(lane, ego.lane[0])
    centre = travel * (network.lane_centre_t(road, lane, s) - network.lane_centre_t(road, ego_lane, s))
    side = float(np.sign(centre[0]))
    lateral = centre + entity.offset[rows] + deviation
    width = float(network.lane_width(road[:1], lane[:1], s[:1])[0])
    spans = cut_segments(entity, network)
    keeps = np.zeros(len(entity.time), dtype=bool)
    for span in spans:
        if span.is_road_following:
            keeps[span.first : span.last + 1] = True
    beside = np.abs(lane - ego.lane[0]) == 1
    acts = [entity.time[one.first] for one in spans if "lateral" in one.kind.value]
    box, own = entity.entity.bounding_box, ego.entity.bounding_box
    return Target(
        scenario=scenario,
        name=entity.name,
        step=EVERY * played.motion.step,
        position=travel * s + box.center_x,
        speed=entity.speed[rows],
        ego_position=travel * ego.s[rows] + own.center_x,
        ego_speed=ego.speed[rows],
        towards=side * centre[0] - side * lateral,
        distance=side * lateral,
        keeps_lane=keeps[rows] & beside,
        begins=float(acts[0]) if acts else float("nan"),
        lane_width=width,
        width=box.width,
        length=box.length,
        ego_length=own.length,
        ego_width=own.width,
    )
