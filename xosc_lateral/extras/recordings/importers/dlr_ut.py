"""DLR Urban Traffic (a signalled junction in Braunschweig, Germany) into the standard drive table.

The data set (DLR Institute of Transportation Systems, "DLR Urban Traffic dataset", Zenodo, concept record 11396371)
holds 20 Hz tracks in UTM coordinates, states of traffic lights, weather and road condition, and no lanes. The first
quarter of an hour of version 1.2.0 lies as a zip inside the PyPI wheel of `tasi`.

- Lanes are those of the traffic (below): a lane's centre is the mean path of those who drive along it, so that
  their mean offset is about zero by construction. Its width is assumed.
- Which light is a lane's, nobody says: it is the one that had turned green when the first vehicles at its end drove
  off, where one explains that (`signal_go`: 1 where it lets go, 0 where it stops). The others have none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, true_slices
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd, spatial
from xosc_lateral.extras.recordings.cuts import DEFAULT_CUTS, CutSettings
from xosc_lateral.extras.recordings.importers import ImportedDrives, importer
from xosc_lateral.extras.recordings.importers.dlr_ht import files_of, vehicle_classes
from xosc_lateral.extras.recordings.importers.track_table import Tracks, tracks_of_rows
from xosc_lateral.extras.recordings.importers.tracks import (
    LaneShape,
    Strip,
    graph_of_shapes,
    import_placed,
    place_in_shapes,
    require_lanes,
)
from xosc_lateral.extras.recordings.lane_order import LaneGraph
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


# ---- lanes where traffic drives: mean paths of vehicles that follow one another, split where they part and meet ----
SPACING = 1.0  # of points on a path [m]
DRIVING = 0.5  # who is slower stands, and only seems to go on a way [m/s]
LEAST_LENGTH = 20.0  # of a path, or a lane where streams part: less says nothing about who drives where [m]
LANE_DISTANCE = 1.5  # farther from a path's line is another lane's: half a narrow one [m]
ALONG = np.cos(np.radians(20.0))  # who goes another way by more is of another stream [-]
WITHIN = 0.9  # of a path's points that have to lie so along a stream [-]
LEAST_OTHERS = 6  # so many vehicles make a lane [-]
ROUNDS, SMOOTHING = 3, 6.0  # of moving a line to the mean of its vehicles, and the window by which it follows that [m]


@dataclass(eq=False)
class _Stream:
    points: FloatArray  # shape (n, 2) [m]
    paths: list[FloatArray] = field(default_factory=list)

    def beside(self, path: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Distance of a path's points from the line [m], and whether they lie along it."""
        away, k = spatial.cKDTree(self.points).query(path)
        agreement = (_tangents(path) * _tangents(self.points)[k]).sum(axis=1)
        return np.asarray(away), np.asarray((away < LANE_DISTANCE) & (agreement > ALONG))


def _tangents(points: FloatArray) -> FloatArray:
    step = np.gradient(points, axis=0)
    return np.asarray(step / np.maximum(np.hypot(*step.T), 1e-9)[:, None])


def streams(x: FloatArray, y: FloatArray, speed: FloatArray, vehicle: IntArray) -> list[FloatArray]:
    """Mean paths, shape (n, 2) each, of `LEAST_OTHERS` vehicles and more, the busiest first; rows by vehicle, time."""
    paths = list[FloatArray]()
    for rows in np.split(np.arange(len(x)), np.flatnonzero(np.diff(vehicle)) + 1):
        moving = rows[speed[rows] > DRIVING]
        if len(moving) > 1:
            way = np.r_[0.0, np.cumsum(np.hypot(np.diff(x[moving]), np.diff(y[moving])))]
            at = np.arange(0.0, way[-1], SPACING)
            if len(at) * SPACING >= LEAST_LENGTH:
                paths.append(np.stack([np.interp(at, way, x[moving]), np.interp(at, way, y[moving])], axis=1))
    bundles = list[_Stream]()
    for path in sorted(paths, key=len, reverse=True):
        best, nearest = None, np.inf
        for stream in bundles:
            away, along = stream.beside(path)
            if along.mean() >= WITHIN and away[along].mean() < nearest:
                best, nearest = stream, float(away[along].mean())
        if best is None:
            best = _Stream(path)
            bundles.append(best)
        best.paths.append(path)
    busy = sorted(
        (stream for stream in bundles if len(stream.paths) >= LEAST_OTHERS), key=lambda stream: -len(stream.paths)
    )
    return [line for stream in busy if len(line := _mean_path(stream)) * SPACING >= LEAST_LENGTH]


def _mean_path(stream: _Stream) -> FloatArray:
    """The longest part of a stream's line on which enough vehicles drive, moved to where they do on average."""
    from scipy.ndimage import gaussian_filter1d

    points = stream.points
    for _ in range(ROUNDS):
        strip = strip_about(points, 2.0 * LANE_DISTANCE)
        count, total = np.zeros(len(points)), np.zeros(len(points))
        for path in stream.paths:
            way, aside, *_ = strip.place(*path.T)
            near = np.isfinite(way) & (np.abs(aside) < LANE_DISTANCE)
            at = np.clip(np.round(way[near] / strip.length * (len(points) - 1)).astype(np.int64), 0, len(points) - 1)
            at, first = np.unique(at, return_index=True)
            count[at] += 1.0
            total[at] += aside[near][first]
        width = SMOOTHING / SPACING
        shift = gaussian_filter1d(total, width) / np.maximum(gaussian_filter1d(count, width), 1e-9)
        tangent = _tangents(points)
        points = points + shift[:, None] * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
        points = np.stack([gaussian_filter1d(column, 2.0, mode="nearest") for column in points.T], axis=1)
    parts = true_slices(gaussian_filter1d(count, width) >= LEAST_OTHERS)
    longest = max(parts, key=lambda part: part.stop - part.start, default=slice(0, 0))
    return points[longest]


def strip_about(points: FloatArray, width: float) -> Strip:
    """A lane of even width about its centre, shape (n, 2). [m]"""
    tangent = _tangents(points)
    normal = 0.5 * width * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    flat = np.zeros((len(points), 1))
    return Strip(*(np.hstack([line, flat]) for line in (points, points + normal, points - normal)))


def lanes_of_streams(lines: list[FloatArray]) -> tuple[list[FloatArray], list[list[int]]]:
    """Lanes, shape (n, 2) each, and those that each leads to; streams that go along one another are one lane there."""
    parts = list[FloatArray]()  # of each stream what no earlier one has
    cuts: list[set[int]] = []
    links = list[tuple[tuple[int, int], tuple[int, int]]]()  # from a lane's point to another's
    for line in lines:
        owner, place = np.full(len(line), -1), np.zeros(len(line), dtype=np.int64)
        nearest = np.full(len(line), np.inf)
        for number, other in enumerate(parts):
            away, along = _Stream(other).beside(line)
            better = along & (away < nearest)
            owner[better], nearest[better] = number, away[better]
            place[better] = spatial.cKDTree(other).query(line[better])[1]
        before: tuple[int, int] | None = None
        for number, part in _runs(owner):
            if number < 0:
                parts.append(line[part])
                cuts.append({0, part.stop - part.start - 1})
                begin, end = (len(parts) - 1, 0), (len(parts) - 1, part.stop - part.start - 1)
            else:
                begin, end = (number, int(place[part.start])), (number, int(place[part.stop - 1]))
            if before is not None and before[0] != begin[0]:
                links.append((before, begin))
                cuts[before[0]].add(before[1])
                cuts[begin[0]].add(begin[1])
            before = end
    lanes, following = list[FloatArray](), list[list[int]]()
    ends, starts = dict[tuple[int, int], int](), dict[tuple[int, int], int]()
    for number, line in enumerate(parts):
        ordered = _without_close_cuts(sorted(cuts[number]), len(line) - 1)
        for first, last in pairwise(ordered):
            starts[number, first] = ends[number, last] = len(lanes)
            lanes.append(line[first : last + 1])
            following.append([])
    for (number, last), lane in ends.items():
        if (after := starts.get((number, last))) is not None:
            following[lane].append(after)
    for (number, end_of), (target, first) in links:
        lane = min((abs(at - end_of), k) for (n, at), k in ends.items() if n == number)[1]
        onward = min((abs(at - first), k) for (n, at), k in starts.items() if n == target)[1]
        if onward not in following[lane]:
            following[lane].append(onward)
    return lanes, following


def _without_close_cuts(places: list[int], last: int) -> list[int]:
    """Cuts of a line that are far enough from each other and from its ends."""
    kept = [0]
    for place in places:
        if place - kept[-1] >= 0.5 * LEAST_LENGTH and last - place >= 0.5 * LEAST_LENGTH:
            kept.append(place)
    return [*kept, last]


def _runs(owner: IntArray) -> list[tuple[int, slice]]:
    """Stretches of one owner (-1: none), those under `LEAST_LENGTH` taken as part of what is before them."""
    edges = np.r_[0, np.flatnonzero(np.diff(owner)) + 1, len(owner)]
    runs = list[tuple[int, slice]]()
    for first, last in pairwise(edges.tolist()):
        if last - first < LEAST_LENGTH / SPACING and (runs or last < len(owner)):
            if runs:
                runs[-1] = runs[-1][0], slice(runs[-1][1].start, last)
            continue
        number = int(owner[first])
        if runs and runs[-1][0] == number:
            runs[-1] = number, slice(runs[-1][1].start, last)
        else:
            runs.append((number, slice(first, last)))
    return runs
