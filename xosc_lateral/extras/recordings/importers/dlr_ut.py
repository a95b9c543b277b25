"""DLR Urban Traffic (a signalled junction in Braunschweig, Germany) into the standard drive table.

The data set (DLR Institute of Transportation Systems, "DLR Urban Traffic dataset", Zenodo, concept record 11396371)
holds 20 Hz tracks in UTM coordinates, states of traffic lights, weather and road condition, and no lanes. The first
quarter of an hour of version 1.2.0 lies as a zip inside the PyPI wheel of `tasi`.

- Lanes are those of the traffic (`streams`): a lane's centre is the mean path of those who drive along it, so that
  their mean offset is about zero by construction. Its width is assumed.
- Which light is a lane's, nobody says: it is the one that had turned green when the first vehicles at its end drove
  off, where one explains that (`signal_go`: 1 where it lets go, 0 where it stops). The others have none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.extras.recordings.cuts import DEFAULT_CUTS, CutSettings
from xosc_lateral.extras.recordings.importers import ImportedDrives, importer
from xosc_lateral.extras.recordings.importers.dlr_ht import files_of, vehicle_classes
from xosc_lateral.extras.recordings.importers.track_table import Tracks, tracks_of_rows
from xosc_lateral.extras.recordings.importers.tracks import (
    LaneShape,
    graph_of_shapes,
    import_placed,
    place_in_shapes,
    require_lanes,
)
from xosc_lateral.extras.recordings.lane_order import LaneGraph
from xosc_lateral.extras.recordings.streams import lanes_of_streams, streams, strip_about
from xosc_lateral.workflows.options import flag

DATA_SET, VERSION = "DLR-Urban-Traffic", "1.2.0"
LICENCE = (
    "DLR Urban Traffic dataset (Deutsches Zentrum für Luft- und Raumfahrt, doi:10.5281/zenodo.11396371), under the "
    "licence stated there; its first quarter of an hour lies in the wheel of tasi, licensed Apache-2.0. No tracks are "
    "passed on with a profile, only fitted parameters."
)
LANE_WIDTH = 3.25  # assumed: usual of town roads in Germany (RASt 06); nobody measured markings [m]
CLASSES = ("pedestrian", "bicycle", "motorbike", "car", "van", "truck")
COLUMNS = (
    *("timestamp", "id", "center_easting", "center_northing", "velocity_magnitude", "yaw"),
    *("dimension_length", "dimension_width", "dimension_height"),
    *(f"classifications_{name}" for name in CLASSES),
)
CONTEXT = {
    "weather": {"wind_speed": "wind_speed", "visibility": "visibility", "rain_intensity": "rain", "air_temperature":
                "air_temperature"},
    "road_condition": {"surface_grip": "friction", "surface_temperature": "surface_temperature"},
}  # fmt: skip
"""Kind of file -> its columns under the names that they have as context."""

GO = (5, 6, 7, 8)  # movement states of SPaT messages (ETSI TS 103 301) in which one may drive: green, and its clearance
ROLLING = 2.0  # who was slower and is faster drives off [m/s]
FIRST = 0.9  # quantile of where vehicles of a lane drive off that is at its stop line: single ones stop past it [-]
CAR_SPACE = 8.0  # those within it are the first of their queue: a car and the gap behind it [m]
LEAST_STARTS = 4  # of first ones tell which light is theirs [-]
SURE_SHARE = 0.9  # of them it had turned green for [-]
LONGEST_REACTION = 6.0  # from green till the first one rolls, and till the tracker says so [s]


@importer
def import_dlr_ut(
    source: Path,
    settings: CutSettings = DEFAULT_CUTS,
    *,
    lane_width: Annotated[float, flag(help="Of the lanes, which nobody measured. [m]", min=2, max=6)] = LANE_WIDTH,
) -> ImportedDrives:
    """DLR Urban Traffic: the wheel of tasi 0.15.4, or the data set's zip: lanes of its traffic, signals, weather."""
    tracks, shapes, graph, start = read_streams(source, lane_width)
    placed = place_in_shapes(tracks, shapes, graph.left)
    require_lanes(placed, "its traffic", source)
    lights = _states(source, start)
    which = lights_of_lanes(tracks, placed.piece, placed.along, lights)
    go = np.full(len(tracks.x), np.nan)
    for lane, (light, stop) in which.items():
        mine = (placed.piece == lane) & (placed.along < stop + CAR_SPACE)
        go[mine] = _state_at(lights[light], tracks.time[mine])
    placed = replace(placed, road={**placed.road, "signal_go": go, **_context(source, start, tracks.time)})
    notes = [
        "lanes: the mean path of those who drive along; lane width assumed",
        f"lights of {len(which)} of {len(shapes)} lanes known, by when the first in a queue drove off",
    ]
    return import_placed(
        placed, graph, settings, notes=notes, format="dlr-ut", version=VERSION, licence=LICENCE, sources=[source]
    )


def read_streams(
    source: Path, lane_width: float = LANE_WIDTH
) -> tuple[Tracks, list[LaneShape], LaneGraph, pd.Timestamp]:
    """Tracks of motor vehicles, in metres from about their middle, the lanes of their traffic, and when time is 0."""
    frame = pd.concat([pd.read_csv(file) for file in files_of(source, DATA_SET)], ignore_index=True)
    if missing := [name for name in COLUMNS if name not in frame]:
        raise FormatError(f"no column {', '.join(missing)}; is this DLR Urban Traffic?", path=source, line=1)
    if frame.empty:
        raise NotEnoughDataError(f"{source}: no rows")
    stamps = pd.to_datetime(frame["timestamp"], utc=True, format="ISO8601")
    mean = frame.groupby("id")[[f"classifications_{name}" for name in CLASSES]].transform("mean")
    kind = vehicle_classes(mean, CLASSES)
    is_motor = ~np.isin(kind, CLASSES[:2])
    dropped = {name: int((kind == name).sum()) for name in CLASSES[:2]}
    frame, kind = frame[is_motor].reset_index(drop=True), np.where(kind == "motorbike", "motorcycle", kind)[is_motor]
    codes, labels = frame["id"].factorize(sort=True)
    x, y = (frame[f"center_{axis}"].to_numpy(dtype=np.float64) for axis in ("easting", "northing"))
    time = _seconds(frame, stamps.min())
    rows: dict[str, Any] = {name: frame[f"dimension_{name}"].to_numpy() for name in ("length", "width", "height")}
    rows |= {"time": time, "x": x - round(x.mean()), "y": y - round(y.mean()), "kind": kind}
    rows["heading"] = np.radians(frame["yaw"].to_numpy(dtype=np.float64))
    rows["speed"] = frame["velocity_magnitude"].to_numpy()
    tracks, _ = tracks_of_rows([str(label) for label in labels], codes, rows, source, dropped=dropped)
    lines, following = lanes_of_streams(streams(tracks.x, tracks.y, tracks.speed, tracks.vehicle))
    if not lines:
        raise NotEnoughDataError(f"{source}: too few vehicles drive along one another's paths to show a lane")
    shapes: list[LaneShape] = [strip_about(line, lane_width) for line in lines]
    return tracks, shapes, graph_of_shapes(shapes, np.full(len(lines), -1), following), stamps.min()


def _read(source: Path, kind: str) -> pd.DataFrame:
    return pd.concat([pd.read_csv(file) for file in files_of(source, DATA_SET, kind)], ignore_index=True)


def _seconds(table: pd.DataFrame, start: pd.Timestamp) -> FloatArray:
    stamps = pd.to_datetime(table["timestamp"], utc=True, format="ISO8601")
    return np.asarray((stamps - start).dt.total_seconds(), dtype=np.float64)


def _context(source: Path, start: pd.Timestamp, time: FloatArray) -> dict[str, FloatArray]:
    """Weather and road condition at these times, between the messages that state them. [s]"""
    columns = dict[str, FloatArray]()
    for kind, names in CONTEXT.items():
        table = _read(source, kind)
        at = _seconds(table, start)
        for theirs, ours in names.items():
            values = table[theirs].to_numpy(dtype=np.float64) if theirs in table else np.zeros(0)
            if (known := np.isfinite(values)).any():
                columns[ours] = np.interp(time, at[known], values[known])
    return columns


Light = tuple[FloatArray, BoolArray]
"""When a light said anything [s], and whether it let go then."""


def _states(source: Path, start: pd.Timestamp) -> dict[int, Light]:
    table = _read(source, "traffic_lights")
    table = table.assign(time=_seconds(table, start)).sort_values(["id", "time"])
    return {
        int(str(name)): (rows["time"].to_numpy(), rows["state"].isin(GO).to_numpy())
        for name, rows in table.groupby("id")
    }


def _state_at(light: Light, time: FloatArray) -> FloatArray:
    """1 where it lets go, 0 where it stops, NaN before it says anything; shape as the times. [s]"""
    row = np.searchsorted(light[0], time, side="right") - 1
    return np.where(row >= 0, light[1][np.maximum(row, 0)], np.nan)


def lights_of_lanes(
    tracks: Tracks, lane: IntArray, along: FloatArray, lights: Mapping[int, Light]
) -> dict[int, tuple[int, float]]:
    """Lane -> its light, and where the first ones wait [m]: it had turned green in `LONGEST_REACTION` before each of
    them drove off."""
    same = np.r_[tracks.vehicle[1:] == tracks.vehicle[:-1], False]
    off = np.flatnonzero(same & (tracks.speed < ROLLING) & (np.r_[tracks.speed[1:], 0.0] >= ROLLING) & (lane >= 0))
    lights_of = dict[int, tuple[int, float]]()
    for number in np.unique(lane[off]).tolist():
        mine = off[lane[off] == number]
        stop = float(np.quantile(along[mine], FIRST))
        starts = tracks.time[mine[along[mine] > stop - CAR_SPACE]]
        if len(starts) < LEAST_STARTS:
            continue
        turned = {
            name: float(np.mean((_state_at(light, starts) == 1.0) & (_state_at(light, starts - LONGEST_REACTION) == 0)))
            for name, light in lights.items()
        }
        best = max(turned, key=lambda name: turned[name], default=-1)
        if best >= 0 and turned[best] >= SURE_SHARE:
            lights_of[number] = best, stop
    return lights_of
