"""From a recording to maneuvers, a road and drivers, and what is written of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import composed
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.output_paths import claim, output_folder
from xosc_lateral.files.output_tables import write_frame
from xosc_lateral.files.profiles import find_profile, list_profiles, profile_bytes, read_profile
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.conversion.drivers import AUTO_PROFILE
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
from xosc_lateral.workflows.recordings.settings import ReconstructSettings
from xosc_lateral.workflows.result import PathLike, Result

LONG_DRIVE = 100.0
"""Of road-following, for a profile of one vehicle: ten windows that the evaluation compares drivers by. [s]"""
LONGEST_WINDOW = 3600.0  # a scenario of more can't be looked at, and times in ms or us instead of s give it [s]
AROUND = 100.0  # who comes as near as this to the vehicle in question, along or across, belongs to its surroundings [m]
NO_HOST = "none"  # stands for no vehicle under test


@dataclass(eq=False, repr=False, slots=True)
class Reconstruction(Result):
    """A scenario with its road and drivers, and how near it is to the recording."""

    traffic: RecordedTraffic
    recording: Recording
    plans: tuple[VehiclePlan, ...]
    scenario: str  # the OpenSCENARIO document
    residuals: tuple[Residuals, ...]  # residuals, drivers: in the order of the plans
    encounters: tuple[Encounter, ...]
    relative: Mapping[str, Triggers]  # by entity, triggers that are distances
    drivers: tuple[ChosenDriver, ...]
    fitted: Mapping[str, DriverProfile]  # by name, profiles of single vehicles
    host: str | None  # entity that is the vehicle under test
    outputs: tuple[Path, ...] = ()  # files that were written

    @property
    def name(self) -> str:
        """Of the files, without suffix."""
        return self.traffic.name

    @property
    def left_out(self) -> tuple[str, ...]:
        """Vehicles, and parts of them, that are not in the scenario: a line each, with the reason."""
        return self.recording.left_out

    @property
    def files(self) -> tuple[Path, ...]:
        """Inputs that are files."""
        return tuple(path for path in self.traffic.sources if path.is_file())

    def headline(self) -> str:
        """One line."""
        return str(self).splitlines()[0]

    def __str__(self) -> str:
        from xosc_lateral.workflows.recordings.page import as_text

        return as_text(self.to_dict())

    def to_frame(self) -> pd.DataFrame:
        """One row per vehicle: when it is there, its maneuvers, residuals and driver."""
        return pd.DataFrame(self.to_dict()["vehicles"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them and the report holds them."""
        from xosc_lateral.workflows.recordings.page import facts_of

        return facts_of(self) | {"outputs": [str(path) for path in self.outputs]}

    def write(self, folder: PathLike, *, force: bool = False) -> tuple[Path, ...]:
        """Write NAME.xosc and its road, drivers.csv for `convert`, report.html and report.json, all or none.

        Returns
        -------
        tuple of Path
        """
        from xosc_lateral.files.atomic import write_atomically
        from xosc_lateral.files.json_text import canonical_json
        from xosc_lateral.workflows.recordings.page import facts_of, page_of

        place, facts = output_folder(folder), facts_of(self)
        files: dict[str, bytes | str] = {
            self.traffic.road_name: self.traffic.road,
            f"{self.name}.xosc": self.scenario,
            **{f"drivers/{name}.json": profile_bytes(profile) for name, profile in self.fitted.items()},
            "report.html": page_of(self, facts),
            "report.json": canonical_json(facts),
        }
        table, paths = place / "drivers.csv", {place / name: data for name, data in files.items()}
        kept = {path.resolve() for path in self.traffic.sources if path.exists() and (place / path.name).exists()}
        new = {path: data for path, data in paths.items() if path.resolve() not in kept}  # a road that lies there stays
        claim([*new, table], self.traffic.sources, force=force)
        for path, data in new.items():
            write_atomically(path, data)
        drivers_table(self, table)
        self.outputs = (*paths, table)
        return self.outputs


def drivers_table(made: Reconstruction, path: Path) -> None:
    """Write the table of one row that `convert` takes: the scenario, who is under test, and everybody's profile."""
    drivers = {plan.name: driver.profile for plan, driver in zip(made.plans, made.drivers, strict=True)}
    driven = {name: profile for name, profile in drivers.items() if profile and name != made.host}
    cells = {"scenario": f"{made.name}.xosc"} | ({} if made.host is None else {"ego": made.host})
    cells |= {f"profile:{name}": profile for name, profile in driven.items()} | {"only": ";".join(driven)}
    write_frame(pd.DataFrame([cells]), path, {"inputs": parsed_hashes(made.files)})


def reconstruct_recording(traffic: RecordedTraffic, settings: ReconstructSettings) -> Reconstruction:
    """Choose vehicles, plan their maneuvers, write the scenario in memory, and say who drove."""
    vehicles = None if settings.vehicles is None else frozenset(map(composed, settings.vehicles))
    settings = replace(settings, vehicles=vehicles, host=composed(settings.host), around=composed(settings.around))
    no_host = settings.host == NO_HOST and all(track.name != NO_HOST for track in traffic.tracks)
    host = None if no_host else settings.host or traffic.host
    tracks, begin, end = chosen(traffic, settings, settings.host and host)
    recording, network = place_tracks(tracks, traffic.network, begin, end), traffic.network
    plans = plan_vehicles(recording, network, error=settings.error)
    entity = next((plan.name for plan in plans if plan.vehicle.name == host), None)
    if settings.host is not None and host is not None and entity is None:
        raise FormatError(f"host {settings.host!r} is not among the reconstructed vehicles", path=traffic.sources[0])
    relative = {}
    if settings.relative and not settings.exact:
        relative = {plan.name: relative_triggers(plan, plans, network) for plan in plans}
    major, minor = map(int, settings.version.split("."))
    scenario = reconstructed_scenario(
        plans,
        network,
        road_file=traffic.road_name,
        duration=end - begin,
        version=(major, minor),
        host=entity,
        description=f"{traffic.name}: reconstructed from {traffic.sources[0].name}, {begin:g} to {end:g} s",
        relative=relative,
        exact=settings.exact,
    )
    residuals = tuple(map(residuals_of, plans))
    drivers, fitted = _drivers(plans, residuals, settings)
    met = encounters(plans, network)
    return Reconstruction(traffic, recording, plans, scenario, residuals, met, relative, drivers, fitted, entity)


def _drivers(
    plans: Sequence[VehiclePlan], residuals: Sequence[Residuals], settings: ReconstructSettings
) -> tuple[tuple[ChosenDriver, ...], dict[str, DriverProfile]]:
    """A profile for each vehicle: its own, the likeliest of the library, or the population's."""
    from xosc_lateral.drivers.fitting.fitting import fit_profile

    population = find_profile(AUTO_PROFILE, settings.library)
    paths = {path.stem: path for path in reversed(list_profiles(settings.library))}
    models = {name: _window_model(path, path.stat().st_mtime_ns) for name, path in paths.items()}
    drivers, fitted = list[ChosenDriver](), dict[str, DriverProfile]()
    for plan, residual in zip(plans, residuals, strict=True):
        if plan.lateral.is_played:
            drivers.append(ChosenDriver("", 0.0, 0.0, "stands still in its lane: no person drove it"))
            continue
        stretches = in_lane_offsets(plan, residual)
        driver = choose_driver([offset for _, offset, _ in stretches], models, population.stem)
        if settings.fit and driver.seconds >= LONG_DRIVE:
            drive = drive_of(plan, residual)
            assert drive is not None
            try:
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
) -> tuple[list[Track], float, float]:
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
