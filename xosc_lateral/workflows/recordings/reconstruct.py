"""From a recording to a folder: scenario, road, drivers and report."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TypedDict

import numpy as np

from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import composed
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.openscenario.write.build import Version, named
from xosc_lateral.files.output_tables import write_frame
from xosc_lateral.files.profiles import find_profile, list_profiles, profile_bytes, read_profile
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.conversion import options as say
from xosc_lateral.workflows.conversion.drivers import AUTO_PROFILE
from xosc_lateral.workflows.conversion.options import Paths, option
from xosc_lateral.workflows.recordings.drivers import (
    ChosenDriver,
    WindowModel,
    choose_driver,
    drive_of,
    in_lane_offsets,
)
from xosc_lateral.workflows.recordings.encounters import Encounter, encounters, relative_triggers
from xosc_lateral.workflows.recordings.plan import Residuals, VehiclePlan, plan_vehicles, residuals_of
from xosc_lateral.workflows.recordings.recorded import Recording, Track, place_tracks
from xosc_lateral.workflows.recordings.recordings import RecordedTraffic
from xosc_lateral.workflows.recordings.scenario import Triggers, reconstructed_scenario

VERSIONS: dict[str, Version] = {named(version): version for version in ((1, 0), (1, 1), (1, 2), (1, 3))}
"""Of the standard that can be written."""
LONG_DRIVE = 100.0
"""Of road-following, for a profile of one vehicle: ten windows that the evaluation compares drivers by. [s]"""
LONGEST_WINDOW = 3600.0  # a scenario of more can't be looked at, and times in ms or us instead of s give it [s]
AROUND = 100.0  # who comes as near as this to the vehicle in question, along or across, belongs to its surroundings [m]
NO_HOST = "none"  # stands for no vehicle under test


def _version(text: str) -> str:
    if text not in VERSIONS:
        raise ValueError(f"version {text!r}, expected {', '.join(VERSIONS)}")
    return text


@dataclass(frozen=True, slots=True)
class ReconstructSettings:
    """What is reconstructed, and how: keywords of `reconstruct`, and options of the command line.

    Parameters
    ----------
    begin, end : float, optional
        Part of the recording. [s]
    vehicles : collection of str, optional
        These alone.
    around, window : str, float
        A vehicle and those who come near it, for so long in the middle of its passage. [s]
    host : str, optional
        The vehicle under test, which `convert` leaves to the system that drives it; by default the recording's own
        host; "none": there is none.
    error : float
        Positions along the road are within this; smaller: more corners in the speeds. [m]
    version : str
        Of OpenSCENARIO, "1.0" to "1.3".
    relative : bool
        Lane changes and braking begin at a distance to another vehicle, where the recording bears it out.
    exact : bool
        Recorded paths as trajectories, instead of maneuvers.
    fit : bool
        A driver profile of its own for every vehicle that drove long enough.
    library : path or paths
        Folders with further profiles to choose from.
    """

    # What is said of one option stays together.
    # fmt: off
    begin: float | None = option(
        None, float, "--from", kind=float | None, show_default=False, help="Begin there [s].",
    )
    end: float | None = option(None, float, "--to", kind=float | None, show_default=False, help="End there [s].")
    vehicles: frozenset[str] | None = option(
        None, say.names, kind=list[str] | None, metavar="ID", help="This vehicle alone; may be repeated.",
    )
    around: str | None = option(
        None, str, kind=str | None, metavar="ID", show_default=False,
        help="This vehicle and those who come near it.",
    )
    window: float = option(
        60.0, float, kind=float, min=1, max=3600, help="Length of the part that --around takes [s].",
    )
    host: str | None = option(
        None, str, kind=str | None, metavar="ID", show_default=False,
        help="The vehicle under test; default: the host of an OSI trace; none: no vehicle.",
    )
    error: float = option(
        0.5, float, kind=float, min=0.01,
        help="Positions along the road are within this [m]: the smaller, the more corners.",
    )
    version: str = option("1.2", _version, kind=str, metavar="1.0..1.3", help="Version of OpenSCENARIO to write.")
    relative: bool = option(
        False, bool, "--relative", kind=bool, help="Cut-ins and braking begin at a distance to another vehicle.",
    )
    exact: bool = option(
        False, bool, "--exact", kind=bool, help="Recorded paths as trajectories, no maneuvers.",
    )
    fit: bool = option(
        False, bool, "--fit", kind=bool, help="Fit a profile to everybody who drove long enough.",
    )
    library: tuple[Path, ...] = option((), say.paths)
    # fmt: on


class ReconstructKeywords(TypedDict, total=False):
    """The same names for type checkers, with what a call may be given."""

    begin: float | None
    end: float | None
    vehicles: Collection[str] | None
    around: str | None
    window: float
    host: str | None
    error: float
    version: str
    relative: bool
    exact: bool
    fit: bool
    library: Paths


@dataclass(frozen=True, eq=False, slots=True)
class Reconstructed:
    """A scenario, how it was made, and how far it is from the recording; residuals and drivers as the plans."""

    traffic: RecordedTraffic
    recording: Recording
    plans: tuple[VehiclePlan, ...]
    scenario: str
    residuals: tuple[Residuals, ...]
    encounters: tuple[Encounter, ...]
    relative: Mapping[str, Triggers]
    drivers: tuple[ChosenDriver, ...]
    fitted: Mapping[str, DriverProfile]
    settings: ReconstructSettings

    @property
    def host(self) -> str | None:
        """Entity that is the vehicle under test."""
        wanted = _host_name(self.traffic, self.settings)
        return next((plan.name for plan in self.plans if plan.vehicle.name == wanted), None)

    @property
    def files(self) -> tuple[Path, ...]:
        """Inputs that are files."""
        return tuple(path for path in self.traffic.sources if path.is_file())


def reconstruct_recording(traffic: RecordedTraffic, settings: ReconstructSettings) -> Reconstructed:
    """Choose vehicles, plan their maneuvers, write the scenario in memory, and say who drove."""
    vehicles = None if settings.vehicles is None else frozenset(map(composed, settings.vehicles))
    settings = replace(settings, vehicles=vehicles, host=composed(settings.host), around=composed(settings.around))
    tracks, begin, end = chosen(traffic, settings)
    recording = place_tracks(tracks, traffic.network, begin, end)
    plans = plan_vehicles(recording, traffic.network, error=settings.error)
    by_name = {plan.vehicle.name: plan.name for plan in plans}
    host = _host_name(traffic, settings)
    if settings.host is not None and host is not None and host not in by_name:
        raise FormatError(f"host {settings.host!r} is not among the reconstructed vehicles", path=traffic.sources[0])
    relative = {}
    if settings.relative and not settings.exact:
        relative = {plan.name: relative_triggers(plan, plans, traffic.network) for plan in plans}
    scenario = reconstructed_scenario(
        plans,
        traffic.network,
        road_file=traffic.road_name,
        duration=end - begin,
        version=VERSIONS[settings.version],
        host=None if host is None else by_name.get(host),
        description=f"{traffic.name}: reconstructed from {traffic.sources[0].name}, {begin:g} to {end:g} s",
        relative=relative,
        exact=settings.exact,
    )
    residuals = tuple(map(residuals_of, plans))
    met = encounters(plans, traffic.network)
    drivers, fitted = _drivers(plans, residuals, settings)
    return Reconstructed(
        traffic, recording, plans, scenario, residuals, met, relative, tuple(drivers), fitted, settings
    )


def _host_name(traffic: RecordedTraffic, settings: ReconstructSettings) -> str | None:
    """Recorded name of the vehicle under test."""
    if settings.host == NO_HOST and all(track.name != NO_HOST for track in traffic.tracks):
        return None
    return settings.host or traffic.host


def _drivers(
    plans: Sequence[VehiclePlan], residuals: Sequence[Residuals], settings: ReconstructSettings
) -> tuple[list[ChosenDriver], dict[str, DriverProfile]]:
    """A profile for each vehicle: its own, the likeliest of the library, or the population's."""
    from xosc_lateral.drivers.fitting.fitting import fit_profile

    population = find_profile(AUTO_PROFILE, settings.library)
    paths = {path.stem: path for path in reversed(list_profiles(settings.library))}
    models = {name: _window_model(path, path.stat().st_mtime_ns) for name, path in paths.items()}
    chosen, fitted = list[ChosenDriver](), dict[str, DriverProfile]()
    for plan, residual in zip(plans, residuals, strict=True):
        if plan.lateral.is_played:
            chosen.append(ChosenDriver("", 0.0, 0.0, "stands still in its lane: no person drove it"))
            continue
        stretches = in_lane_offsets(plan, residual)
        one = choose_driver([offset for _, offset, _ in stretches], models, population.stem)
        if settings.fit and one.seconds >= LONG_DRIVE:
            drive = drive_of(plan, residual)
            assert drive is not None
            try:
                fitted[plan.name] = fit_profile([drive], name=plan.name)
                one = replace(one, profile=f"drivers/{plan.name}.json", why="fitted to its own drive")
            except XoscLateralError as error:
                one = replace(one, why=f"{one.why}; can't be fitted: {error}")
        chosen.append(one)
    return chosen, fitted


@lru_cache(maxsize=64)
def _window_model(path: Path, _changed: int) -> WindowModel:
    return WindowModel.of(read_profile(path))


def drivers_table(made: Reconstructed, path: Path) -> None:
    """Write the table of one row that `convert` takes: the scenario, who is under test, and everybody's profile."""
    drivers = {plan.name: driver.profile for plan, driver in zip(made.plans, made.drivers, strict=True)}
    driven = {name: profile for name, profile in drivers.items() if profile and name != made.host}
    cells = {"scenario": f"{made.traffic.name}.xosc"} | ({} if made.host is None else {"ego": made.host})
    cells |= {f"profile:{name}": profile for name, profile in driven.items()} | {"only": ";".join(driven)}
    write_frame(pd.DataFrame([cells]), path, {"inputs": parsed_hashes(made.files)})


def fitted_profiles(made: Reconstructed) -> dict[str, bytes]:
    """Files of the profiles that were fitted, by their paths below the folder."""
    return {f"drivers/{name}.json": profile_bytes(profile) for name, profile in made.fitted.items()}


def chosen(traffic: RecordedTraffic, settings: ReconstructSettings) -> tuple[list[Track], float, float]:
    """Tracks and window of time [s] that the settings ask for."""
    by_name = {track.name: track for track in traffic.tracks}
    source = traffic.sources[0]
    host = settings.host and _host_name(traffic, settings)
    asked = {"vehicles": settings.vehicles or (), "around": [settings.around], "host": [host]}
    for word, names in asked.items():
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
        tracks = [track for track in tracks if _comes_near(track, centre, begin, end)]
    if settings.vehicles is not None:
        tracks = [track for track in tracks if track.name in settings.vehicles]
    begin, end = max(begin, first), min(end, last)
    wrong = ""
    if end - begin < 1.0:
        wrong = f"from {begin:g} to {end:g} s is no second; it lasts from {first:g} to {last:g} s"
    elif end - begin > LONGEST_WINDOW:
        wrong = f"{end - begin:g} s are more than {LONGEST_WINDOW:g} s: take a part with --from and --to"
    if wrong:
        raise FormatError(wrong, path=source)
    return tracks, begin, end


def _comes_near(track: Track, centre: Track, begin: float, end: float) -> bool:
    first, last = max(begin, centre.time[0]), min(end, centre.time[-1])
    time = track.time[(track.time >= first) & (track.time <= last)]
    away = [
        np.interp(time, track.time, getattr(track, axis)) - np.interp(time, centre.time, getattr(centre, axis))
        for axis in "xy"
    ]
    return bool((np.hypot(*away) <= AROUND).any())  # nobody where they are not there at once
