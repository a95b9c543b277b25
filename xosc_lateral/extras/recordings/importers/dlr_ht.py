"""DLR Highway Traffic (A39, Germany) into the standard drive table.

The data set (DLR Institute of Transportation Systems, "DLR Highway Traffic dataset", Zenodo, concept record 14012005)
holds 20 Hz tracks in UTM coordinates and no lane geometry. The first file of version 1.1.0, five minutes with 445
vehicles on 6.4 km, lies as a zip inside the PyPI wheel of `tasi`.

What a reader of the table has to know:

- `offset` is counted from the middle of the *traffic* of that lane at that place, not from the middle between painted
  markings, which nobody measured. The mean offset of a lane is therefore about zero by construction.
- The lane width is the distance between the traffic's centres of the two lanes of that direction.
- The provider smoothed the tracks by cubics of one second, whose slopes jump where two of them meet. Above 0.5 Hz, half
  a jump a period, tracks show hardly anything else: what is faster is taken out here, once, before lanes are found.
- The smoothing takes more than that: beside tracks of differential GNSS the power is 0.90 of what it should be at
  0.08 Hz, 0.56 at 0.10, 0.17 at 0.16 Hz, for trucks, slow and fast cars alike. What is faster than 0.1 Hz is not how
  people drive, and the table says so.
- Between two cameras the provider interpolated. Bridges up to `max_gap` are kept (0.3 Hz content hardly changes in
  that time), longer ones are cut.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.drivers.drives.cleaning import RESOLUTION, RUN, VALID_BELOW
from xosc_lateral.drivers.drives.filters import filtered, low_pass_between
from xosc_lateral.drivers.drives.identity import identify
from xosc_lateral.extras.recordings.cuts import (
    DEFAULT_CUTS,
    CutSettings,
    lane_changes,
    long_gaps,
    name_states,
    number_runs,
)
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer
from xosc_lateral.extras.recordings.lines_from_tracks import (
    LaneCentreLine,
    ReferenceLine,
    fit_lane_centre,
    fit_reference_line,
)
from xosc_lateral.extras.recordings.neighbours import find_neighbours
from xosc_lateral.files.source import open_source
from xosc_lateral.workflows.options import flag

LANE_COUNT = 2  # through lanes per direction of the A39 there; ramps and their merging lanes are left out
STEP = 0.05  # [s]
CLASSES = ("car", "van", "truck", "motorbike")
COLUMNS = (
    *("timestamp", "id", "center_easting", "center_northing", "velocity_northing", "velocity_magnitude"),
    *("acceleration_signed", "dimension_length", "dimension_height", "interpolated"),
    *(f"classifications_{name}" for name in CLASSES),
)
CUTOFF_FREQUENCIES = (0.5, 0.6)
"""Movement across is kept below, and none of it above: half a jump of the cubics a period. [Hz]"""
ATTENUATION = 40.0  # of what is faster; a third of a millimetre of its 3 cm is left [dB]
HIGHEST_FREQUENCY = 0.1  # of what these tracks show of driving [Hz]
POSITION_RESOLUTION = 0.01  # that positions are given in [m]
WIDTH_COLUMN = "dimension_width"  # read where it is there: nothing of an import needs it
LICENCE = (
    "DLR Highway Traffic dataset (Deutsches Zentrum für Luft- und Raumfahrt, doi:10.5281/zenodo.14012005), said by "
    "others to be under CC BY-NC-SA 4.0; its first file lies in the wheel of tasi, licensed Apache-2.0. No tracks are "
    "passed on with a profile, only fitted parameters."
)


@importer
def import_dlr_ht(
    source: Path,
    settings: CutSettings = DEFAULT_CUTS,
    *,
    max_gap: Annotated[
        float, flag(help="Longest gap between two cameras that is kept [s].", min=0, max=60)
    ] = DEFAULT_CUTS.max_gap,
) -> ImportedDrives:
    """DLR Highway Traffic: the wheel of tasi 0.15.4, the data set's zip, or its trajectory CSV."""
    settings = replace(settings, max_gap=max_gap) if settings is DEFAULT_CUTS else settings
    tracks = read_tracks(source)
    road, kind = find_lanes(tracks, settings), vehicle_classes(tracks)
    vehicle, time, length = (tracks[name].to_numpy() for name in ("vehicle", "time", "dimension_length"))
    s = np.where(road.forward, road.s, road.reference.length - road.s)
    is_truck, where = kind == "truck", np.round(time / STEP).astype(np.int64) * 2 + road.forward
    on_left, on_right = road.lane < LANE_COUNT - 1, road.lane > 0
    near = find_neighbours(where, road.lane, s, length, is_truck, lane_on_left=on_left, lane_on_right=on_right)
    columns = {
        "drive": "ht-" + tracks["id"].astype(str),
        "time": np.round(time, 3),
        "offset": road.offset,
        "lane_width": road.width,
        "speed": tracks["velocity_magnitude"].to_numpy(),
        "acceleration": tracks["acceleration_signed"].to_numpy(),
        "lane_index": road.lane,
        "lane_count": LANE_COUNT,
        **near,
        "vehicle_class": kind,
        "is_truck": is_truck.astype(np.float64),
        "curvature": road.reference.curvature(road.s) * np.where(road.forward, 1.0, -1.0),
    }
    table = pd.DataFrame(columns)
    # 0.1 mm, 0.1 per km: below any measurement, above what linear algebra does differently from machine to machine.
    table = table.round({"curvature": 7, **dict.fromkeys(table.columns.drop(["curvature", "drive", "time"]), 4)})
    table[VALID_BELOW], table[RESOLUTION] = HIGHEST_FREQUENCY, POSITION_RESOLUTION
    reasons = {"no lane": road.lane < 0, "lane change": road.changing, "gap": road.gap}
    table["state"] = name_states(reasons, road.lane, vehicle, time, STEP, settings)
    table[RUN] = number_runs(table["state"].array, road.lane, vehicle, time)
    lanes = []
    for carriageway, both in road.lanes.items():
        for index, lane in enumerate(both):
            error = lane.standard_error(np.arange(lane.start, lane.end, 10.0))
            known = {"median": round(float(np.median(error)), 4), "max": round(float(error.max()), 4)}
            size = {"length_m": round(lane.end - lane.start, 1), "stretches": lane.passages}
            lanes.append({"carriageway": carriageway, "lane_index": index, **size, "centre_standard_error_m": known})
    about = {"format": "dlr-ht", "version": _version(source), "licence": LICENCE, "lanes": lanes}
    about |= {"dropped": tracks.attrs["dropped"]}
    return imported(table, sources=[source], settings=asdict(settings), step=STEP, **about)


def read_tracks(source: Path) -> pd.DataFrame:
    """All rows, sorted by vehicle and time, with `time` [s] from the first instant and `vehicle` counted from 0.

    `attrs["dropped"]`: rows of the files that are not in it, by reason.
    """
    frame = pd.concat(
        [_read_csv(stream, source) for stream in files_of(source, "DLR-Highway-Traffic")], ignore_index=True
    )
    try:
        stamps = pd.to_datetime(frame["timestamp"], utc=True)
    except ValueError as error:
        raise FormatError(f"no time: {error}", path=source, element="timestamp") from error
    if frame.empty:
        raise NotEnoughDataError(f"{source}: no rows")
    frame["time"] = (stamps - stamps.min()).dt.total_seconds()
    labels, vehicle = np.unique(frame["id"].to_numpy(), return_inverse=True)
    time, x, y = (frame[name].to_numpy() for name in ("time", "center_easting", "center_northing"))
    known = identify([str(label) for label in labels], vehicle, time, x, y, path=source)
    frame = frame.iloc[known.rows].reset_index(drop=True).assign(vehicle=known.vehicle)
    if len(known.names) > len(labels):  # an identifier that is another vehicle's from some row on
        frame["id"] = np.array(known.names, dtype=object)[known.vehicle]
    frame.attrs["dropped"] = dict(known.dropped)
    return frame


def files_of(source: Path, data_set: str, kind: str = "trajectories") -> list[io.BytesIO]:
    """CSV files of a kind, out of a data set of the DLR: in a wheel of tasi, in its zip, or one by itself."""
    with open_source(source) as opened:
        if not zipfile.is_zipfile(opened.file):
            opened.file.seek(0)
            return [io.BytesIO(opened.file.read())]
        try:
            archive = zipfile.ZipFile(opened.file)
            opened.unpacked(sum(item.file_size for item in archive.infolist()))
            inner = [name for name in archive.namelist() if data_set in name and name.endswith(".zip")]
            if inner:
                archive = zipfile.ZipFile(io.BytesIO(archive.read(sorted(inner)[-1])))
                opened.unpacked(sum(item.file_size for item in archive.infolist()))
            names = sorted(name for name in archive.namelist() if f"/{kind}/" in name and name.endswith(".csv"))
            files = [io.BytesIO(archive.read(name)) for name in names]
        except zipfile.BadZipFile as error:
            raise FormatError(f"damaged zip: {error}", path=source) from error
    if not files:
        raise FormatError(f"holds no {kind} of {data_set.replace('-', ' ')} ({kind}/*.csv)", path=source)
    return files


def _read_csv(stream: io.BytesIO, source: Path) -> pd.DataFrame:
    with stream:
        head = stream.readline().decode("utf-8", "replace").strip().split(",")
        missing = [name for name in COLUMNS if name not in head]
        if missing:
            raise FormatError(f"no column {', '.join(missing)}; is this a DLR HT trajectory file?", path=source, line=1)
        stream.seek(0)
        try:
            columns = [name for name in (*COLUMNS, WIDTH_COLUMN) if name in head]
            frame = pd.read_csv(stream, usecols=columns, engine="pyarrow")
        except ValueError as error:  # pandas' and pyarrow's parser errors are both of this kind
            raise FormatError(f"can't be read as CSV: {error}", path=source) from error
    for name in frame.columns.drop("timestamp"):
        numbers = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
        if not np.isfinite(numbers).all():
            row = int(np.argmin(np.isfinite(numbers)))
            raise FormatError(f"no number: {frame[name].iloc[row]}", path=source, line=row + 2, element=name)
    return frame


def travels_north(tracks: pd.DataFrame) -> BoolArray:
    """Carriageway of each row, by its vehicle's mean velocity, shape (n,)."""
    mean = tracks.groupby("vehicle")["velocity_northing"].transform("mean")
    return np.asarray(mean.to_numpy() > 0.0)


@dataclass(frozen=True, eq=False)
class Carriageways:
    """The road's reference line, lane centres of both directions (right to left), and every row's place in them."""

    reference: ReferenceLine
    forward: BoolArray  # forward ... changing: of the rows, shape (n,)
    s: FloatArray  # along the reference line [m]
    gap: BoolArray
    lane: IntArray  # from the right; -1: none
    offset: FloatArray  # [m]
    width: FloatArray  # of the lane [m]
    changing: BoolArray
    lanes: dict[str, list[LaneCentreLine]]


def find_lanes(tracks: pd.DataFrame, settings: CutSettings = DEFAULT_CUTS) -> Carriageways:
    """Lanes out of nothing but the tracks; "northbound" ones along the reference line, "southbound" ones against it."""
    forward = travels_north(tracks)
    reference, s_road, d_road = fit_reference_line(tracks[["center_easting", "center_northing"]].to_numpy(), forward)
    d_road = _slow(d_road, tracks)
    # From here on every carriageway has its own s and d: s grows with travel, d is positive to the left of it.
    s = np.where(forward, s_road, reference.length - s_road)
    d = np.where(forward, d_road, -d_road)
    vehicle, height = tracks["vehicle"].to_numpy(), tracks["dimension_height"].to_numpy()
    gap, n = long_gaps(tracks["interpolated"].to_numpy(), vehicle, STEP, settings.max_gap), len(tracks)
    places = np.full(n, -1), np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, dtype=np.bool_)
    lanes: dict[str, list[LaneCentreLine]] = {}
    for name, part in (("northbound", forward), ("southbound", ~forward)):
        rows = np.flatnonzero(part)
        lanes[name], *placed = _place_in_lanes(s[rows], d[rows], height[rows], vehicle[rows], gap[rows], settings)
        for column, values in zip(places, placed, strict=True):
            column[rows] = values
    return Carriageways(reference, forward, s_road, gap, *places, lanes)


def _slow(d: FloatArray, tracks: pd.DataFrame) -> FloatArray:
    """Lateral positions, shape (n,) [m], low-passed at `CUTOFF_FREQUENCIES`; nothing is filtered across a gap."""
    kernel = low_pass_between(*CUTOFF_FREQUENCIES, STEP, ATTENUATION)
    vehicle, time = tracks["vehicle"].to_numpy(), tracks["time"].to_numpy()
    ends = np.flatnonzero((np.diff(vehicle) != 0) | (np.diff(time) > 1.5 * STEP)) + 1
    return np.concatenate([filtered(part, kernel) for part in np.split(d, ends)])


def _place_in_lanes(
    s: FloatArray, d: FloatArray, height: FloatArray, vehicle: IntArray, gap: BoolArray, settings: CutSettings
) -> tuple[list[LaneCentreLine], IntArray, FloatArray, float, BoolArray]:
    """Lane centres of one carriageway, and every row's lane, offset, width and lane change: each needs the others."""
    levels = _levels(d)
    centre, lanes = np.repeat(levels[:, None], len(s), axis=1), list[LaneCentreLine]()
    bend, width = np.full(len(d), levels.mean()), float(np.diff(levels).mean())
    for remaining in (3, 2, 1, 0):
        away = np.abs(d - centre)
        away = np.where(np.isfinite(away), away, np.inf)
        # Between two lanes the midpoint decides; towards the outside half a width does.
        lane = np.where(away.min(axis=0) <= width * 0.55, away.argmin(axis=0), -1)
        offset = np.where(lane >= 0, d - centre[np.clip(lane, 0, None), np.arange(len(d))], np.nan)
        changing = lane_changes(d - bend, offset, lane, vehicle, STEP, settings)
        if not remaining:
            break
        lanes = []
        for index in range(LANE_COUNT):
            rows = np.flatnonzero((lane == index) & ~changing & ~gap)
            passage = np.cumsum(np.r_[True, (np.diff(rows) != 1) | (np.diff(vehicle[rows]) != 0)])
            second = _each(passage, round(1.0 / STEP))
            lanes.append(fit_lane_centre(s[rows][second], d[rows][second], height[rows][second], passage[second]))
        centre = np.array([line.at(s, height) for line in lanes])
        # Past a lane's known part its last value stands in, so that no lane change is lost sight of there.
        bend = np.mean([line.at(np.clip(s, line.start, line.end), height) for line in lanes], axis=0)
        # median distance of neighbouring centres, where both are known
        known = np.arange(max(line.start for line in lanes), min(line.end for line in lanes), 10.0)
        width = float(np.median(np.diff([line.at(known, np.full(len(known), line.height)) for line in lanes], axis=0)))
    return lanes, lane, offset, width, changing


def _levels(d: FloatArray) -> FloatArray:
    """Mean lateral position of the lanes, right to left: the innermost `LANE_COUNT` clusters (two-means)."""
    low, high = np.quantile(d, [0.2, 0.95])
    levels = np.linspace(low, high, LANE_COUNT)
    for _ in range(50):
        nearest = np.abs(d[:, None] - levels).argmin(axis=1)
        close = np.abs(d - levels[nearest]) < 2.0
        levels = np.array([d[close & (nearest == k)].mean() for k in range(LANE_COUNT)])
    return levels


def _each(passage: IntArray, every: int) -> BoolArray:
    """True for every n-th row of each passage, from its first."""
    start = np.flatnonzero(np.r_[True, passage[1:] != passage[:-1]])
    position = np.arange(len(passage)) - np.repeat(start, np.diff(np.r_[start, len(passage)]))
    return np.asarray(position % every == 0)


def vehicle_classes(tracks: pd.DataFrame, classes: Sequence[str] = CLASSES) -> NDArray[np.str_]:
    """The provider's likeliest class of each vehicle."""
    scores = tracks[[f"classifications_{name}" for name in classes]].to_numpy()
    return np.asarray(np.array(classes)[scores.argmax(axis=1)])


def _version(source: Path) -> str:
    names = [str(source), *(zipfile.ZipFile(source).namelist() if zipfile.is_zipfile(source) else ())]
    matches = (re.search(r"Highway-Traffic-dataset_v(\d+)-(\d+)-(\d+)", name) for name in names)
    return next((".".join(match.groups()) for match in matches if match), "unknown")
