"""From a recording to maneuvers, a road and drivers.

Which of several profiles drove a vehicle, the likelihood of how it moved in its lane says. A profile has none in closed
form, but its free runs say how a summary of windows scatters between drivers and within one: a normal model of the
summary's mean (synthetic likelihood [1]_, with a random effect per driver).

References
----------
.. [1] S. N. Wood, "Statistical inference for noisy nonlinear ecological dynamic systems", Nature 466, 2010.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, Unpack

import numpy as np

from xosc_lateral.base.arrays import FloatArray, rate, true_slices
from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.base.texts import composed
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.drivers.evaluation.scores import SNIPPET
from xosc_lateral.drivers.fitting.maneuvers import SIDES, MeasuredChanges, fit_maneuvers
from xosc_lateral.drivers.model.profile import BEFORE_STEP, DriverProfile, Maneuvers
from xosc_lateral.extras.recordings.encounters import encounters, relative_triggers
from xosc_lateral.extras.recordings.lane_order import RoadLanes, vehicle_next
from xosc_lateral.extras.recordings.plan import VehiclePlan, plan_vehicles
from xosc_lateral.extras.recordings.reconstruction import ChosenDriver, Reconstruction
from xosc_lateral.extras.recordings.recorded import RecordedTrack, Transition, lateral_plan, own_lateral, place_tracks
from xosc_lateral.extras.recordings.recordings import RecordedTraffic, read_recording
from xosc_lateral.extras.recordings.scenario import reconstructed_scenario
from xosc_lateral.extras.recordings.settings import ReconstructKeywords, ReconstructSettings
from xosc_lateral.files.mapping import MappingLike
from xosc_lateral.files.profiles import find_profile, list_profiles, read_profile
from xosc_lateral.workflows.conversion.settings import AUTO_PROFILE
from xosc_lateral.workflows.opened import opened_as_one
from xosc_lateral.workflows.options import spelled_out, values_of
from xosc_lateral.workflows.result import PathLike
from xosc_lateral.world.motion.nominal import EntityMotion

LONG_DRIVE = 100.0  # of road-following, for a profile of one vehicle: ten windows that the evaluation compares [s]
LONGEST_WINDOW = 3600.0  # a scenario of more can't be looked at, and times in ms or us instead of s give it [s]
SURROUNDING_DISTANCE = 100.0  # who comes as near to a vehicle, along or across, belongs to its surroundings [m]
NO_HOST = "none"  # stands for no vehicle under test


@spelled_out(ReconstructSettings)
def reconstruct(
    recording: PathLike,
    output: PathLike | None = None,
    *,
    columns: MappingLike | None = None,
    force: bool = False,
    **options: Unpack[ReconstructKeywords],
) -> Reconstruction:
    """Turn a recording into maneuvers, a road and drivers.

    Parameters
    ----------
    recording : str or Path
        Tracks of several vehicles: DLR Highway Traffic, levelX, OSI traces, CommonRoad, SUMO's FCD output, or a table.
    output : str or Path, optional
        Folder to write to, see `Reconstruction.write`; without it nothing is written.
    columns : dict, path or TableMapping, optional
        Name -> ``COLUMN[:UNIT]`` for tables of tracks, or a saved mapping's file.
    force : bool
        Replace files that this package did not write.
    options
        `ReconstructSettings`.

    Raises
    ------
    FormatError, NotEnoughDataError
    """
    settings = ReconstructSettings(**values_of(ReconstructSettings, options))
    kind, road, case = settings.format, settings.road, settings.case
    traffic = read_recording(
        opened_as_one(recording, columns),
        kind=kind,
        road=None if road is None else opened_as_one(road, name="road"),
        columns=columns,
        recording=case,
    )
    result = reconstruct_recording(traffic, settings)
    if output is not None:
        result.write(output, force=force)
    return result


def reconstruct_recording(traffic: RecordedTraffic, settings: ReconstructSettings) -> Reconstruction:
    """Choose vehicles, plan their maneuvers, write the scenario in memory, and say who drove."""
    vehicles = None if settings.vehicles is None else frozenset(map(composed, settings.vehicles))
    settings = replace(settings, vehicles=vehicles, host=composed(settings.host), around=composed(settings.around))
    no_host = settings.host == NO_HOST and all(track.name != NO_HOST for track in traffic.tracks)
    host = None if no_host else settings.host or traffic.host
    tracks, begin, end = chosen(traffic, settings, settings.host and host)
    network = traffic.network
    recording = place_tracks(tracks, network, begin, end)
    plans = plan_vehicles(recording, network, error=settings.error)
    entity = next((plan.name for plan in plans if plan.vehicle.name == host), None)
    if settings.host is not None and host is not None and entity is None:
        raise FormatError(f"host {settings.host!r} is not among the reconstructed vehicles", path=traffic.sources[0])
    lanes = RoadLanes(network)
    met = encounters(plans, lanes)
    is_relative = settings.relative and not settings.exact
    relative = {plan.name: relative_triggers(plan, plans, lanes) for plan in plans if is_relative}
    scenario = reconstructed_scenario(traffic, recording, plans, relative, settings, entity)
    return Reconstruction(traffic, recording, plans, scenario, met, relative, *_drivers(plans, settings), entity)


def _drivers(
    plans: Sequence[VehiclePlan], settings: ReconstructSettings
) -> tuple[tuple[ChosenDriver, ...], dict[str, DriverProfile]]:
    from xosc_lateral.drivers.fitting.fitting import fit_profile

    population = find_profile(AUTO_PROFILE, settings.library)
    paths = {path.stem: path for path in reversed(list_profiles(settings.library))}
    models = {name: _window_model(path, path.stat().st_mtime_ns) for name, path in paths.items()}
    drivers, fitted = list[ChosenDriver](), dict[str, DriverProfile]()
    for plan in plans:
        if plan.lateral.is_played:
            drivers.append(ChosenDriver("", 0.0, 0.0, "stands still in its lane: no person drove it"))
            continue
        stretches = in_lane_offsets(plan)
        driver = choose_driver([offset for _, offset, _ in stretches], models, population.stem)
        if settings.fit and driver.seconds >= LONG_DRIVE:
            time, offset, width = (np.concatenate(columns) for columns in zip(*stretches, strict=True))
            context = {"speed": plan.speed.at(time), "lane_width": width}
            run = np.repeat(np.arange(len(stretches)), [len(stretch[0]) for stretch in stretches])
            try:
                drive = Drive(plan.name, time, offset, width, context, run=run)
                fitted[plan.name] = fit_profile([drive], name=plan.name)
                driver = replace(driver, profile=f"drivers/{plan.name}.json", why="fitted to its own drive")
            except XoscLateralError as error:
                driver = replace(driver, why=f"{driver.why}; can't be fitted: {error}")
        drivers.append(driver)
    return tuple(drivers), fitted


@lru_cache(maxsize=64)
def _window_model(path: Path, _changed: int) -> WindowModel:
    return WindowModel.of(read_profile(path))


def chosen(
    traffic: RecordedTraffic, settings: ReconstructSettings, host: str | None
) -> tuple[list[RecordedTrack], float, float]:
    """Tracks and window of time [s] that the settings ask for."""
    by_name = {track.name: track for track in traffic.tracks}
    source = traffic.sources[0]
    for word, names in {"vehicles": settings.vehicles or (), "around": [settings.around], "host": [host]}.items():
        for name in names:
            if name is not None and name not in by_name:
                some = ", ".join(list(by_name)[:8])
                raise FormatError(f"--{word} {name}: no such vehicle; there are {some}, ...", path=source)
    first, last = traffic.span
    begin = first if settings.begin is None else settings.begin
    end = last if settings.end is None else settings.end
    tracks = list(traffic.tracks)
    if settings.around is not None:
        centre = by_name[settings.around]
        middle = 0.5 * (max(centre.time[0], begin) + min(centre.time[-1], end))
        begin, end = max(begin, middle - 0.5 * settings.window), min(end, middle + 0.5 * settings.window)
        tracks = [track for track in tracks if centre.distance(track, begin, end) <= SURROUNDING_DISTANCE]
    if settings.vehicles is not None:
        tracks = [track for track in tracks if track.name in settings.vehicles]
    begin, end = max(begin, first), min(end, last)
    if end - begin < 1.0:
        what = f"from {begin:g} to {end:g} s is no second; it lasts from {first:g} to {last:g} s"
        raise FormatError(what, path=source)
    if end - begin > LONGEST_WINDOW:
        what = f"{end - begin:g} s are more than {LONGEST_WINDOW:g} s: take a part with --from and --to"
        raise FormatError(what, path=source)
    return tracks, begin, end


STEP = 0.2  # of rows, as in profiles [s]
MINIMUM_LOG_ODDS = 2.0  # another profile than the population's has to be likelier by this: weights of 7 to 1 [nat]
FREE_RUNS = 40  # of each profile, five minutes each: 30 windows of 40 drivers
LEAST_SPREAD = 1e-4  # of a path in a window, below which its logarithm would say something about digits [m]


def in_lane_offsets(plan: VehiclePlan) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Stretches of road-following of `SNIPPET` and more: time [s], offset and lane width [m] every `STEP`."""
    residuals = plan.residuals
    time, width = residuals.time, plan.vehicle.lane_width[-len(residuals.time) :]
    following = plan.in_lane & (plan.speed.at(time) >= MINIMUM_SPEED)
    parts = []
    for part in true_slices(following):
        even = np.arange(time[part.start], time[part.stop - 1] + 1e-9, STEP)
        if len(even) * STEP > SNIPPET:
            across, wide = (np.interp(even, time[part], each[part]) for each in (residuals.columns["across"], width))
            parts.append((even, across, wide))
    return parts


def choose_driver(stretches: Sequence[FloatArray], models: Mapping[str, WindowModel], population: str) -> ChosenDriver:
    """The likeliest profile of offsets in lane [m], every `STEP`."""
    seen = [_summaries(offset) for offset in stretches]
    seconds = STEP * sum(map(len, stretches))
    if not seen:
        return ChosenDriver("", seconds, 0.0, f"no {SNIPPET:g} s of road-following in one piece")
    windows = np.concatenate(seen)
    gains = {
        name: model.log_likelihood(windows) - models[population].log_likelihood(windows)
        for name, model in models.items()
    }
    best = max(gains, key=lambda name: gains[name])
    if best != population and gains[best] > MINIMUM_LOG_ODDS:
        return ChosenDriver(best, seconds, gains[best], "likeliest of the library")
    return ChosenDriver(population, seconds, 0.0, "the population's: no other is clearly likelier")


@dataclass(frozen=True, eq=False, slots=True)
class WindowModel:
    """How window summaries of a profile scatter."""

    mean: FloatArray  # mean offset [m], log spread [log m], log lateral speed [log m/s], shape (3,)
    # between, within: covariance of drivers' means, and of windows about their driver's mean, shape (3, 3)
    between: FloatArray
    within: FloatArray

    @classmethod
    def of(cls, profile: DriverProfile, seed: int = 0) -> WindowModel:
        """From free runs."""
        every = max(1, round(STEP / profile.model.step))
        runs = free_runs(profile, seed, drivers=FREE_RUNS)[:, ::every]
        each = [_summaries(run) for run in runs]
        means = np.array([windows.mean(axis=0) for windows in each])
        within = np.mean([np.cov(windows.T) for windows in each], axis=0)
        between = np.cov(means.T) - within / len(each[0])
        values, vectors = np.linalg.eigh(between)
        between = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return cls(means.mean(axis=0), between, within)

    def log_likelihood(self, windows: FloatArray) -> float:
        """Of the mean of one driver's windows, shape (k, 3). [nat]"""
        covariance = self.between + self.within / len(windows)
        away = windows.mean(axis=0) - self.mean
        return float(-0.5 * (away @ np.linalg.solve(covariance, away) + np.linalg.slogdet(covariance)[1]))


def _summaries(offset: FloatArray) -> FloatArray:
    """Mean, log spread, log lateral speed of each window of offsets [m], every `STEP`, shape (n,); shape (k, 3)."""
    length = round(SNIPPET / STEP)
    windows = offset[: len(offset) // length * length].reshape(-1, length)
    spread = np.maximum(windows.std(axis=1), LEAST_SPREAD)
    speed = np.sqrt((rate(windows, STEP, past=True)[:, 1:] ** 2).mean(axis=1))
    return np.column_stack([windows.mean(axis=1), np.log(spread), np.log(np.maximum(speed, LEAST_SPREAD))])


# ---- lane changes of a recording, as `reconstruct` finds them, for the maneuver law of a profile ----
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
