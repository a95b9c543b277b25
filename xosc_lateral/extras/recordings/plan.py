"""What a scenario says of each recorded vehicle: where it starts, its speed, its lateral maneuvers.

A speed of straight pieces is a way of parabolas with a continuous slope: a quadratic spline whose knots are the
corners. With knots given, it is a linear problem.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import interpolate
from xosc_lateral.base.track import Track
from xosc_lateral.extras.recordings.recorded import LateralPlan, Recording, Transition, lateral_plan, own_lateral
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.network import RoadNetwork

FRAME = 0.1  # vehicles appear and leave at multiples of this: between two frames they would be placed off by a way [s]
ENTRY_DELAY = 0.2  # after a recorded vehicle comes onto a road, its planned one has, too: `--error` is between [s]
PLAYED_SHARE = 0.2  # of the error's bound and of the corners' spacing for a played track: no driver, no sensor [-]
ROW_SPACING = 0.4  # rows are thinned to this: in that time, a change of acceleration of 1 m/s2 shows as 1 cm [s]
CORNER_SPACING = 1.0  # at least: a driver's foot needs about so long from one pedal to the other [s]
ROUNDS = 12  # of Gauss-Newton; corners move by less than 10 ms after eight


@dataclass(frozen=True, eq=False, slots=True)
class SpeedProfile:
    """Speed of straight pieces."""

    time: FloatArray  # time, speed: both ends and the corners between, shape (k,) [s], [m/s]
    speed: FloatArray
    start: float  # way at the first time [m]

    def at(self, time: FloatArray) -> FloatArray:
        """Speed at some times, shape as the argument. [m/s]"""
        return np.interp(time, self.time, self.speed)

    def way(self, time: FloatArray) -> FloatArray:
        """Way at times within the profile, shape as the argument. [m]"""
        step, change = np.diff(self.time), np.diff(self.speed)
        ways = self.start + np.r_[0.0, np.cumsum(step * (self.speed[:-1] + 0.5 * change))]
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(step) - 1)
        u = time - self.time[k]
        return np.asarray(ways[k] + u * (self.speed[k] + 0.5 * u * change[k] / step[k]))


@dataclass(frozen=True, eq=False, slots=True)
class VehiclePlan:
    """One vehicle's part in the scenario."""

    name: str  # of the entity
    vehicle: EntityMotion
    lateral: LateralPlan
    way: FloatArray  # along the lateral maneuvers' path, at the recorded rows, shape (n,) [m]
    speed: SpeedProfile  # from where it appears to where it leaves
    appears: float | None  # appears, leaves: None: it is there from the beginning, to the end [s]
    leaves: float | None
    # road, lane, s, direction, offset: where it starts: index of the road, OpenDRIVE lane, [m], +1 along s or -1
    # against it, and [m] from the lane's centre, positive to the left of its travel
    road: int
    lane: int
    s: float
    direction: int
    offset: float
    targets: tuple[int, ...]  # OpenDRIVE lane that each transition leads to
    residuals: Track  # recorded less planned, from where it is there: `along`, ahead, and `across`, to the left [m]

    @property
    def present(self) -> tuple[float, float]:
        """From when to when it is there; as recorded at the end, where it does not leave. [s]"""
        return 0.0 if self.appears is None else self.appears, float(self.vehicle.time[-1])

    def time_at(self, way: FloatArray) -> FloatArray:
        """When the recorded vehicle was as far, shape as the argument. [s]"""
        return np.interp(way, np.maximum.accumulate(self.way), self.vehicle.time)

    @property
    def in_lane(self) -> NDArray[np.bool_]:
        """Rows of the residuals outside of all transitions: what is across is the driver's."""
        time = self.residuals.time
        within = np.zeros(len(time), dtype=np.bool_)
        for transition in self.lateral.transitions:
            within |= (time >= transition.start) & (time <= transition.end)
        return ~within

    @property
    def changes(self) -> tuple[Transition, ...]:
        """Lane changes alone."""
        return tuple(transition for transition in self.lateral.transitions if transition.lanes)


def plan_vehicles(recording: Recording, network: RoadNetwork, *, error: float) -> tuple[VehiclePlan, ...]:
    """Plan every vehicle, positions along the road within `error` [m]."""
    length = recording.end - recording.start
    names = entity_names(vehicle.name for vehicle in recording.vehicles)
    return tuple(
        _plan(name, vehicle, network, length, error) for name, vehicle in zip(names, recording.vehicles, strict=True)
    )


def entity_names(names: Iterable[str]) -> list[str]:
    """Names that are also those of parameters: letters, digits and underscores, no digit first, each once."""
    taken = list[str]()
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "V"
        plain = f"V{plain}" if plain[0].isdigit() else plain
        number, unique = 2, plain
        while unique in taken:
            unique, number = f"{plain}_{number}", number + 1
        taken.append(unique)
    return taken


def _plan(name: str, vehicle: EntityMotion, network: RoadNetwork, length: float, error: float) -> VehiclePlan:
    time, (y, base, _) = vehicle.time, own_lateral(vehicle)
    appears = None if time[0] < FRAME + 1e-9 else float(np.ceil(time[0] / FRAME - 1e-6) * FRAME)
    leaves = None if time[-1] > length - 1.5 * FRAME else float(np.floor(time[-1] / FRAME + 1e-6) * FRAME)
    begin = 0.0 if appears is None else appears
    lateral = _beside_lanes(lateral_plan(vehicle, begin if appears is None else begin + FRAME), vehicle, network)
    turned = vehicle.way()
    poses = network.lane_to_world(vehicle.road, vehicle.lane, vehicle.s, turned * (lateral.at(time) - base))
    poses = poses._replace(heading=poses.heading + np.where(turned < 0, np.pi, 0.0))
    dx, dy = np.diff(poses.x), np.diff(poses.y)
    ahead_of_row = dx * np.cos(poses.heading[1:]) + dy * np.sin(poses.heading[1:])
    way = np.r_[0.0, np.cumsum(np.copysign(np.hypot(dx, dy), ahead_of_row))]  # noise takes back what it moves ahead
    share = PLAYED_SHARE if lateral.is_played else 1.0
    speed = fit_speed(time, way, error=share * error, apart=share * CORNER_SPACING)
    ahead = float(speed.way(np.array([begin]))[0])
    road, lane, s = int(vehicle.road[0]), int(vehicle.lane[0]), float(vehicle.s[0])
    moved = network.advance(
        road, lane, s, ahead, direction=int(vehicle.way()[0]) * network.travel_direction(road, lane)
    )
    offset = float(lateral.at(np.array([begin]))[0] - base[0])
    start = moved.road, moved.lane, moved.s, moved.direction if ahead >= 0.0 else -moved.direction, offset
    targets = tuple(_target(vehicle, network, transition) for transition in lateral.transitions)
    # the profile from where the vehicle appears on, which may be a little before its first corner
    later = speed.time > begin + 1e-6
    speeds = np.r_[speed.at(np.array([begin])), speed.speed[later]]
    speed = SpeedProfile(np.r_[begin, speed.time[later]], speeds, ahead)
    present = time >= begin - 1e-9
    moments = time[present]
    away = {"along": way[present] - speed.way(moments), "across": y[present] - lateral.at(moments)}
    residuals = Track(name, moments, away, np.empty(0, dtype=np.intp))
    return VehiclePlan(name, vehicle, lateral, way, speed, appears, leaves, *start, targets, residuals)


def _beside_lanes(lateral: LateralPlan, vehicle: EntityMotion, network: RoadNetwork) -> LateralPlan:
    """With lane changes that begin where the lane that they lead to is there: it may come with the next road."""
    transitions = list[Transition]()
    for transition in lateral.transitions:
        rows = np.flatnonzero((vehicle.time >= transition.start) & (vehicle.time < transition.end - FRAME))
        for row in rows if transition.lanes else ():
            start = float(vehicle.time[row])
            moved = replace(transition, start=start, duration=transition.end - start)
            if network.has_lane_at(int(vehicle.road[row]), _target(vehicle, network, moved), float(vehicle.s[row])):
                if row > rows[0]:
                    late = min(ENTRY_DELAY, 0.5 * moved.duration)
                    transition = replace(moved, start=start + late, duration=moved.duration - late)
                break
        transitions.append(transition)
    return replace(lateral, transitions=tuple(transitions))


def _target(vehicle: EntityMotion, network: RoadNetwork, transition: Transition) -> int:
    """Lane that a transition leads to, counted from where it begins: the recorded lane there may be a neighbour."""
    _, base, _ = own_lateral(vehicle)
    row = min(int(np.searchsorted(vehicle.time, transition.start)), len(base) - 1)
    road, lane = int(vehicle.road[row]), int(vehicle.lane[row])
    steps = round(float((transition.level - transition.offset - base[row]) / vehicle.lane_width[row]))
    side = (1 if steps > 0 else -1) * network.travel_direction(road, lane) * int(vehicle.way()[row])
    for _ in range(abs(steps)):
        lane = lane + side or lane + 2 * side
    return lane


# ---- a speed with few corners ----------------------------------------------------------------------------------------
def fit_speed(time: FloatArray, way: FloatArray, *, error: float, apart: float = CORNER_SPACING) -> SpeedProfile:
    """Speed with the fewest corners, `apart` [s] at least, for ways [m] at increasing times [s] within `error` [m].

    Greedy: corners are added where the error is largest, taken out while the bound still holds, moved to where the
    squared error is least, and taken out once more. Where corners would have to be closer than `apart` the bound is
    given up.
    """
    grid = np.arange(time[0], time[-1], min(ROW_SPACING, 0.5 * apart))
    kept = np.unique(np.r_[np.minimum(np.searchsorted(time, grid), len(time) - 1), len(time) - 1])
    t, w = time[kept], way[kept]
    if len(t) < 4:
        speed = max((w[-1] - w[0]) / (t[-1] - t[0]), 0.0)
        return SpeedProfile(t[[0, -1]], np.array([speed, speed]), float(w[0]))
    knots = _with_enough_corners(t, w, error, apart)
    for _ in range(2):
        knots = _moved(t, w, _thinned(t, w, knots, error), apart)
    spline = _spline(t, w, knots)
    corners = np.r_[t[0], knots, t[-1]]
    speed = spline(corners, 1)
    if (speed < 0.0).any():
        return _without_reversing(t, w, corners, max(error, float(np.abs(w - spline(t)).max())), apart)
    return SpeedProfile(corners, speed, float(spline(t[0])))


def _without_reversing(t: FloatArray, w: FloatArray, corners: FloatArray, error: float, apart: float) -> SpeedProfile:
    """The least squared error of speeds that are not negative, with more corners where it is beyond the bound."""
    from scipy.optimize import lsq_linear

    while True:
        ways = [SpeedProfile(corners, one, 0.0).way(t) for one in np.eye(len(corners))]
        lowest = np.r_[-np.inf, np.zeros(len(corners))]
        start, *speed = lsq_linear(np.column_stack([np.ones(len(t)), *ways]), w, (lowest, np.inf)).x
        profile = SpeedProfile(corners, np.asarray(speed), float(start))
        residual, wide = np.abs(w - profile.way(t)), np.diff(corners) >= 2.0 * apart
        piece = np.clip(np.searchsorted(corners, t, side="right") - 1, 0, len(wide) - 1)
        worst = int(np.where(wide[piece], residual, 0.0).argmax())
        if residual[worst] <= error or not wide[piece[worst]]:
            return profile
        k = piece[worst] + 1
        corners = np.insert(corners, k, 0.5 * (corners[k - 1] + corners[k]))


def _spline(t: FloatArray, w: FloatArray, knots: FloatArray) -> interpolate.BSpline[np.float64]:
    return interpolate.make_lsq_spline(t, w, np.r_[[t[0]] * 3, knots, [t[-1]] * 3], 2)


def _with_enough_corners(t: FloatArray, w: FloatArray, error: float, apart: float) -> FloatArray:
    """Corners added in the middle of the worst piece until the bound holds."""
    knots = np.empty(0)
    while True:
        residual = np.abs(w - _spline(t, w, knots)(t))
        edges = np.r_[t[0], knots, t[-1]]
        piece = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(edges) - 2)
        residual[np.diff(edges)[piece] < 2.0 * apart] = 0.0  # can't be parted
        worst = int(residual.argmax())
        if residual[worst] <= error:
            return knots
        k = piece[worst]
        knots = np.insert(knots, k, 0.5 * (edges[k] + edges[k + 1]))


def _thinned(t: FloatArray, w: FloatArray, knots: FloatArray, error: float) -> FloatArray:
    """Without the corners that the bound does not need, the slightest first."""
    bound = max(error, float(np.abs(w - _spline(t, w, knots)(t)).max()))
    while len(knots):
        slope = np.diff(_spline(t, w, knots)(np.r_[t[0], knots, t[-1]], 1)) / np.diff(np.r_[t[0], knots, t[-1]])
        for k in np.argsort(np.abs(np.diff(slope)), kind="stable"):
            fewer = np.delete(knots, k)
            if np.abs(w - _spline(t, w, fewer)(t)).max() <= bound:
                knots = fewer
                break
        else:
            return knots
    return knots


def _moved(t: FloatArray, w: FloatArray, knots: FloatArray, apart: float) -> FloatArray:
    """Corners where the squared error is least (Gauss-Newton with halved steps), in order and apart."""
    if not len(knots):
        return knots
    spline = _spline(t, w, knots)
    residual = w - spline(t)
    for _ in range(ROUNDS):
        edges = np.r_[t[0], knots, t[-1]]
        bend = np.diff(np.diff(spline(edges, 1)) / np.diff(edges))
        basis = interpolate.BSpline.design_matrix(t, np.r_[[t[0]] * 3, knots, [t[-1]] * 3], 2).toarray()
        moved = -bend * np.maximum(t[:, None] - knots, 0.0)  # what a later corner changes of the way
        step = np.linalg.lstsq(np.hstack([basis, moved]), residual, rcond=1e-10)[0][basis.shape[1] :]
        for _ in range(6):
            tried = np.clip(knots + step, knots - 2.0, knots + 2.0)
            if (np.diff(np.r_[t[0], tried, t[-1]]) >= 0.5 * apart).all():
                again = _spline(t, w, tried)
                left = w - again(t)
                if left @ left < residual @ residual:
                    break
            step = 0.5 * step
        else:
            return knots
        done = residual @ residual - left @ left < 1e-6 * (residual @ residual)
        knots, spline, residual = tried, again, left
        if done:
            break
    return knots
