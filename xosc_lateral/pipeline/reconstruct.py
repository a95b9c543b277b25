"""From a recording to a folder: scenario, road, drivers and report."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.write.build import Version
from xosc_lateral.formats.openscenario.write.reconstructed import reconstructed_scenario
from xosc_lateral.formats.recordings import RecordedTraffic
from xosc_lateral.reconstruction.plan import VehiclePlan, plan_vehicles
from xosc_lateral.reconstruction.recorded import Recording, Track, place_tracks
from xosc_lateral.reconstruction.residuals import Residuals, residuals_of

VERSIONS: tuple[Version, ...] = ((1, 0), (1, 1), (1, 2), (1, 3))
"""Of the standard that can be written."""
AROUND = 100.0
"""Who comes as near as this to the vehicle in question, along or across, belongs to its surroundings. [m]"""


@dataclass(frozen=True, slots=True)
class ReconstructSettings:
    """What is reconstructed, and how.

    Parameters
    ----------
    begin, end : float or None
        Of the part of the recording. [s]
    vehicles : collection of str or None
        These alone, by their recorded names.
    around : str or None
        A vehicle, and those within `AROUND`, for `window` seconds in the middle of its passage.
    window : float
        [s]
    host : str or None
        Recorded name of the vehicle under test.
    error : float
        Bound of positions along the road. [m]
    version : (int, int)
    """

    begin: float | None = None
    end: float | None = None
    vehicles: Collection[str] | None = None
    around: str | None = None
    window: float = 60.0
    host: str | None = None
    error: float = 0.5
    version: Version = (1, 2)


@dataclass(frozen=True, eq=False, slots=True)
class Reconstructed:
    """A scenario as text, how it was made, and how far it is from the recording.

    Parameters
    ----------
    name : str
        Of the files, without suffix.
    traffic : RecordedTraffic
    recording : Recording
    plans : tuple of VehiclePlan
    scenario : str
    residuals : tuple of Residuals
        In the order of `plans`.
    settings : ReconstructSettings
    """

    name: str
    traffic: RecordedTraffic
    recording: Recording
    plans: tuple[VehiclePlan, ...]
    scenario: str
    residuals: tuple[Residuals, ...]
    settings: ReconstructSettings


def reconstruct_recording(traffic: RecordedTraffic, settings: ReconstructSettings, name: str) -> Reconstructed:
    """Choose vehicles, plan their maneuvers, write the scenario in memory and play it.

    Raises
    ------
    FormatError
        A vehicle that is not in the recording, a window without time.
    NotEnoughDataError
        If no vehicle is left.
    """
    tracks, begin, end = chosen(traffic, settings)
    recording = place_tracks(tracks, traffic.network, begin, end)
    plans = plan_vehicles(recording, traffic.network, error=settings.error)
    by_name = {plan.vehicle.name: plan.name for plan in plans}
    if settings.host is not None and settings.host not in by_name:
        raise FormatError(f"host {settings.host!r} is not among the reconstructed vehicles", path=traffic.sources[0])
    scenario = reconstructed_scenario(
        plans,
        traffic.network,
        road_file=traffic.road_name,
        duration=end - begin,
        version=settings.version,
        host=None if settings.host is None else by_name[settings.host],
        description=f"{name}: reconstructed from {traffic.sources[0].name}, {begin:g} to {end:g} s",
    )
    residuals = tuple(map(residuals_of, plans))
    return Reconstructed(name, traffic, recording, plans, scenario, residuals, settings)


def chosen(traffic: RecordedTraffic, settings: ReconstructSettings) -> tuple[list[Track], float, float]:
    """Tracks and window of time [s] that the settings ask for.

    Raises
    ------
    FormatError
        A vehicle that is not in the recording, a window without time.
    """
    by_name = {track.name: track for track in traffic.tracks}
    source = traffic.sources[0]
    for word, names in (("vehicles", settings.vehicles or ()), ("around", [settings.around]), ("host", [settings.host])):
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
        tracks = [track for track in tracks if track.name in set(settings.vehicles)]
    begin, end = max(begin, first), min(end, last)
    if end - begin < 1.0:
        raise FormatError(f"from {begin:g} to {end:g} s is no second; it lasts from {first:g} to {last:g} s", path=source)
    return tracks, begin, end


def _comes_near(track: Track, centre: Track, begin: float, end: float) -> bool:
    time = track.time[(track.time >= begin) & (track.time <= end)]
    time = time[(time >= centre.time[0]) & (time <= centre.time[-1])]
    if not len(time):
        return False
    away = [np.interp(time, track.time, getattr(track, axis)) - np.interp(time, centre.time, getattr(centre, axis)) for axis in "xy"]
    return bool((np.hypot(*away) <= AROUND).any())
