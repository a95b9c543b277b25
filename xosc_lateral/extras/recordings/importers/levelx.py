"""HighD, exiD, inD, rounD and uniD (leveLXData, RWTH Aachen) into the standard drive table, from published layouts.

A recording is three files, ``XX_tracks.csv``, ``XX_tracksMeta.csv`` and ``XX_recordingMeta.csv``.

highD [1]_ : image coordinates in metres, y pointing DOWN; `x`, `y` are the upper left corner of the bounding box,
`width` its extent along the road and `height` across; the straight lane markings stand in the recording's meta file;
the upper lanes (drivingDirection 1) drive towards -x.

exiD [2]_ : lateral offset and lane width come along with every row (`latLaneCenterOffset`, `laneWidth`; several values
parted by ``;`` where lanelets overlap: the first one counts). Which side is positive there is found from the data, by
comparing the offset's rate with the heading, so that `offset` is positive to the left whatever the release says.

inD, rounD, uniD: places alone; lanes are those of the road that comes beside them.

References
----------
.. [1] R. Krajewski et al., ITSC 2018, doi:10.1109/ITSC.2018.8569552
.. [2] T. Moers et al., IV 2022, doi:10.1109/IV51971.2022.9827305
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray, rate
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.vehicle_classes import TRUCKS
from xosc_lateral.drivers.drives.evidence import FASTEST_ASIDE
from xosc_lateral.drivers.drives.identity import identify
from xosc_lateral.extras.recordings.cuts import DEFAULT_CUTS, CutSettings, require_lane_direction
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer
from xosc_lateral.extras.recordings.importers.track_table import Tracks, tracks_of
from xosc_lateral.extras.recordings.importers.tracks import (
    PlacedTracks,
    drive_table,
    mostly_beside,
    place_on_road,
    require_lanes,
)
from xosc_lateral.extras.recordings.lane_order import NEIGHBOUR_DISTANCE, LaneGraph
from xosc_lateral.extras.recordings.road_file import WrittenLane, WrittenRoad
from xosc_lateral.files.mapping import TableMapping, classes_of
from xosc_lateral.files.opendrive.reader import parse_opendrive, read_opendrive
from xosc_lateral.files.tables import read_table
from xosc_lateral.workflows.options import flag
from xosc_lateral.world.road.network import RoadNetwork

LICENCE = (
    "highD/exiD: leveLXData, under the licence that you signed (free for non-commercial research); whether fitted "
    "parameters may be passed on is for that licence to say"
)
ROAD_MARGIN = 50.0  # highD's road goes on so far beyond its traffic [m]
HIGHD_COLUMNS = ("frame", "id", "x", "y", "width", "height", "xVelocity", "xAcceleration")
EXID_COLUMNS = (
    *("trackId", "frame", "xCenter", "yCenter", "heading", "length", "lonVelocity", "lonAcceleration"),
    *("latLaneCenterOffset", "laneWidth", "laneletId", "laneChange", "leadId", "leadDHW"),
    *("leftLeadId", "leftRearId", "leftAlongsideId", "rightLeadId", "rightRearId", "rightAlongsideId"),
)


@importer
def import_levelx(
    source: Path,
    settings: CutSettings = DEFAULT_CUTS,
    *,
    road: Annotated[Path | None, flag("--road", kind=Path | None, metavar="FILE.xodr",
        help="Road of inD, rounD or uniD; exiD's rows lie in its lanes instead of in those that they name.")] = None,
) -> ImportedDrives:  # fmt: skip
    """Recordings of highD, exiD, inD, rounD, uniD: a folder, or one XX_tracks.csv with its two meta files beside it."""
    files = sorted(source.glob("*_tracks.csv")) if source.is_dir() else [source]
    if not files:
        raise FormatError("no XX_tracks.csv in this folder", path=source)
    network = None if road is None else read_opendrive(road)
    parts, layouts, dropped, notes = [], set[tuple[str, float]](), Counter[str](), list[str]()
    for path in files:
        recording = Recording.read(path)
        placed, beside, more = _placed(recording, network)
        notes += [*placed.notes(), *(mostly_beside(placed) if network is not None else [])]
        table = drive_table(placed, beside, settings).assign(**more)
        parts.append(table.assign(drive=f"{recording.layout.lower()}-{recording.number}-" + table["drive"]))
        dropped += Counter(placed.tracks.dropped)
        layouts.add((recording.layout, 1.0 / recording.frame_rate))
    if len(layouts) > 1:
        raise FormatError("recordings of different layouts or frame rates: import them one by one", path=source)
    layout, step = layouts.pop()
    return imported(
        pd.concat(parts, ignore_index=True), sources=files if road is None else [*files, Path(road)], step=step,
        notes=tuple(notes), format=f"levelx {layout}", licence=LICENCE, settings=asdict(settings), dropped=dropped,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording's tracks, a row of `meta` for each of them, and one of `about` for all."""

    path: Path  # of the tracks
    tracks: pd.DataFrame
    meta: pd.DataFrame
    about: pd.DataFrame
    dropped: Counter[str] = field(default_factory=Counter)  # rows by the reason why they are in no drive

    @classmethod
    def read(cls, path: Path) -> Recording:
        """By the path of its tracks. Raises `FormatError`, `NotEnoughDataError`."""
        tables = []
        for ending in ("_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv"):
            file = path.with_name(path.name.replace("_tracks.csv", ending))
            if not file.exists():
                what = "missing; a recording is XX_tracks.csv, XX_tracksMeta.csv and XX_recordingMeta.csv"
                raise FormatError(what, path=file)
            tables.append(read_table(file))
            if tables[-1].empty:
                raise NotEnoughDataError(f"{file}: has no rows")
        return cls(path, tables[0], tables[1], tables[2])

    @property
    def number(self) -> str:
        """As it is counted in the data set."""
        return self.path.name.split("_")[0]

    @property
    def layout(self) -> str:
        """Of highD; of exiD, whose rows say where in their lane they are; or of inD, rounD and uniD ("inD")."""
        named = self.tracks.columns
        return "highD" if "xCenter" not in named else "exiD" if "latLaneCenterOffset" in named else "inD"

    @property
    def frame_rate(self) -> float:
        """[1/s]"""
        rate = self._stated("frameRate")
        if not (rate.replace(".", "", 1).isdigit() and 1.0 <= float(rate) <= 1000.0):
            raise FormatError(f"frameRate={rate!r}, expected 1 to 1000 per second", path=self.path)
        return float(rate)

    def markings(self, side: str) -> FloatArray:
        """Of highD's "upper" or "lower" lanes, y pointing down. [m]"""
        text = self._stated(f"{side}LaneMarkings")
        places = pd.to_numeric(pd.Series(text.split(";")), errors="coerce").to_numpy(dtype=np.float64)
        if not np.isfinite(places).all():
            raise FormatError(f"{side}LaneMarkings are {text!r}, which are no places", path=self.path)
        return places

    def _stated(self, column: str) -> str:
        if column not in self.about.columns or self.about.empty:
            raise FormatError(f"no value of {column} in the recording's meta file", path=self.path)
        return str(self.about[column].iloc[0])

    def classes(self, meta: pd.DataFrame) -> NDArray[np.str_]:
        """Of the rows of `meta`, in the package's words."""
        return classes_of(meta["class"].astype(str), self.path, "class").to_numpy(dtype=str)

    def identified(self, name: str, x: str, y: str) -> pd.DataFrame:
        """Rows by vehicle and time, with `vehicle`, and its `name`; see `dropped`."""
        codes, labels = self.tracks[name].factorize(sort=True)
        time, east, north = (self.tracks[column].to_numpy(dtype=np.float64) for column in ("frame", x, y))
        known = identify([str(label) for label in labels], codes, time / self.frame_rate, east, north, path=self.path)
        self.dropped.update(known.dropped)
        names = np.array(known.names, dtype=object)[known.vehicle]
        return self.tracks.iloc[known.rows].reset_index(drop=True).assign(vehicle=known.vehicle, name=names)

    def require(self, columns: Sequence[str]) -> None:
        """Refuse tracks that lack a column."""
        if missing := [name for name in columns if name not in self.tracks.columns]:
            raise FormatError(
                f"no column {', '.join(missing)}; neither highD nor exiD (others: import tracks --road)",
                path=self.path,
                line=1,
            )


def on_its_road(recording: Recording) -> tuple[WrittenRoad, Tracks, FloatArray]:
    """highD's road, which is straight and has its markings in the meta file, its tracks, and their acceleration."""
    recording.require(HIGHD_COLUMNS)
    lower, upper = (np.sort(recording.markings(side)) for side in ("lower", "upper"))
    table = recording.identified("id", "x", "y")
    meta = recording.meta.set_index("id").reindex(table["id"])
    is_ahead = meta["drivingDirection"].to_numpy() == 2
    way, velocity = np.where(is_ahead, 1.0, -1.0), table["xVelocity"].to_numpy(dtype=np.float64)
    where = "the recording's drivingDirection"
    require_lane_direction(way * np.sign(velocity), np.abs(velocity), where, recording.path)
    time, length, width = table["frame"].to_numpy(np.float64) / recording.frame_rate, table["width"], table["height"]
    x, y = (table["x"] + 0.5 * length).to_numpy(), -(table["y"] + 0.5 * width).to_numpy()  # y points down there
    place, speed = (x, y, np.where(is_ahead, 0.0, np.pi)), np.abs(velocity)
    when = tuple(table["name"].unique()), table["vehicle"].to_numpy(), time, 1.0 / recording.frame_rate
    kinds = recording.classes(meta)
    tracks = Tracks(*when, *place, speed, length.to_numpy(), kinds, width.to_numpy(), dropped=recording.dropped)
    middle = 0.5 * (upper[-1] + lower[0])
    sides = ((middle - float(upper[-1]), np.diff(upper)[::-1]), (float(lower[0]) - middle, np.diff(lower)))
    left, right = (
        [WrittenLane.even("median", inner), *(WrittenLane.even("driving", float(width)) for width in widths)]
        for inner, widths in sides
    )
    x0 = float(np.floor(table["x"].min() - ROAD_MARGIN))
    plan = np.array([[0.0, x0, -middle, 0.0, float(np.ceil((table["x"].max() + length.max()) + ROAD_MARGIN)) - x0]])
    return (
        WrittenRoad(f"highd-{recording.number}", plan, left, right),
        tracks,
        way * table["xAcceleration"].to_numpy(),
    )


def tracks_in(recording: Recording) -> Tracks:
    """Tracks of a recording whose road comes beside it, in the road's coordinates."""
    table = recording.tracks
    kinds = recording.classes(recording.meta.set_index("trackId").reindex(table["trackId"]))
    clock = table["frame"] / recording.frame_rate
    named = table.assign(time=clock, heading=np.radians(table["heading"]), vehicle_class=kinds)
    return tracks_of(named, recording.path, TableMapping())


def _placed(
    recording: Recording, network: RoadNetwork | None
) -> tuple[PlacedTracks, LaneGraph | dict[str, FloatArray], dict[str, FloatArray]]:
    """A recording on a road, or in the lanes that its rows name; who is beside whom, and columns as recorded."""
    if recording.layout == "highD":
        made, tracks, acceleration = on_its_road(recording)
        placed, graph = place_on_road(tracks, parse_opendrive(made.to_xml().encode(), made.name))
        placed.road = {name: placed.road[name] for name in ("lane_index", "lane_count")}
        return placed, graph, {"acceleration": acceleration}
    if network is None and recording.layout == "exiD":
        return _in_named_lanes(recording)
    if network is None:
        raise FormatError("comes without lanes: give its road with --road FILE.xodr", path=recording.path)
    placed, graph = place_on_road(tracks_in(recording), network)
    require_lanes(placed, Path(network.path).name, recording.path)
    return placed, graph, {}


def _in_named_lanes(recording: Recording) -> tuple[PlacedTracks, dict[str, FloatArray], dict[str, FloatArray]]:
    """ExiD's rows say where in their lane they are, and who is beside them."""
    recording.require(EXID_COLUMNS)
    table = recording.identified("trackId", "xCenter", "yCenter")
    offset, width = _first(table["latLaneCenterOffset"]), _first(table["laneWidth"])
    x, y, speed, length, acceleration = (
        table[name].to_numpy(dtype=np.float64)
        for name in ("xCenter", "yCenter", "lonVelocity", "length", "lonAcceleration")
    )
    kinds = recording.classes(recording.meta.set_index("trackId").reindex(table["trackId"]))
    heading, vehicle, step = np.radians(table["heading"].to_numpy()), table["vehicle"].to_numpy(), recording.frame_rate
    when = tuple(table["name"].unique()), vehicle, table["frame"].to_numpy() / step, 1.0 / step
    tracks = Tracks(*when, x, y, heading, speed, length, kinds, dropped=recording.dropped)
    known = np.isfinite(offset) & np.isfinite(width) & (width > 0.0)
    offset = offset * _left_sign(offset, tracks, recording.path)
    placed = PlacedTracks(tracks, np.where(known, 0, -1), np.zeros(len(x)), offset, width, np.ones(len(x)))
    return placed, _exid_neighbours(table, np.isin(kinds, list(TRUCKS))), {"acceleration": acceleration}


def _first(column: pd.Series) -> FloatArray:
    """First of the values parted by ``;``; NaN where there is none."""
    if column.dtype.kind == "f":
        return column.to_numpy(dtype=np.float64)
    first = column.astype(str).str.split(";").str[0]
    return np.asarray(pd.to_numeric(first, errors="coerce").to_numpy(dtype=np.float64))


def _left_sign(offset: FloatArray, tracks: Tracks, path: Path) -> float:
    """+1 if the offset grows when a vehicle heads to the left of its lane's course, -1 if it shrinks.

    By the correlation of its rate, but where a lane changes, with the way to the left, by the heading less its own mean
    over 4 s (the road's course).
    """
    half, vehicle = max(1, round(2.0 / tracks.step)), tracks.vehicle
    inside = np.arange(half, max(half, len(vehicle) - half))
    inside = inside[vehicle[inside + half] == vehicle[inside - half]]
    if len(inside) < 100:
        raise NotEnoughDataError(f"{path}: no track of 4 s; they are needed to find which side is left")
    moved = rate(offset, tracks.step)
    moved = np.where(np.abs(moved) < FASTEST_ASIDE, moved, 0.0)
    towards_left = tracks.speed[inside] * _about_mean(np.unwrap(tracks.heading), inside, half)
    agreement = float(np.corrcoef(towards_left, _about_mean(moved, inside, half))[0, 1])
    if not abs(agreement) > 0.1:
        what = f"the lane's positive side is undecided: correlation of heading and offset rate is {agreement:.2f}"
        raise FormatError(what, path=path, element="latLaneCenterOffset")
    return float(np.sign(agreement))


def _about_mean(values: FloatArray, rows: IntArray, half: int) -> FloatArray:
    """Values at `rows`, less their own mean over `half` rows to each side."""
    summed = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(values[rows] - (summed[rows + half + 1] - summed[rows - half]) / (2 * half + 1))


def _exid_neighbours(tracks: pd.DataFrame, is_truck: NDArray[np.bool_]) -> dict[str, FloatArray]:
    """Leader and neighbours from the ids that come along; distances bumper to bumper. Which lanes there are is not in
    the tracks, so beside, NaN is no lane as well as nobody."""
    frame = tracks["frame"].to_numpy(dtype=np.int64)
    places = pd.MultiIndex.from_arrays([frame, tracks["trackId"].to_numpy(dtype=np.int64)])
    rows, places = np.flatnonzero(~places.duplicated()), places.drop_duplicates()
    heading = np.radians(tracks["heading"].to_numpy())
    east, north, length = (tracks[name].to_numpy(dtype=np.float64) for name in ("xCenter", "yCenter", "length"))

    def rows_of(column: str) -> IntArray:
        """Row of the vehicle of the first id at the same frame; -1: none."""
        ids = np.nan_to_num(_first(tracks[column]), nan=-1.0).astype(np.int64)
        place = places.get_indexer(pd.MultiIndex.from_arrays([frame, ids]))
        return np.where(place >= 0, rows[place], -1)

    lead, lead_row = tracks["leadDHW"].to_numpy(dtype=np.float64), rows_of("leadId")
    there = (lead_row >= 0) & (lead >= 0.0) & (lead <= NEIGHBOUR_DISTANCE)
    near = {
        "lead_distance": np.where(there, lead, np.inf),
        "lead_is_truck": np.where(there, is_truck[lead_row], False).astype(np.float64),
    }
    for side in ("left", "right"):
        best, truck = np.full(len(tracks), np.inf), np.zeros(len(tracks))
        for place in ("Lead", "Rear", "Alongside"):
            other = rows_of(f"{side}{place}Id")
            along = (east[other] - east) * np.cos(heading) + (north[other] - north) * np.sin(heading)
            free = np.maximum(np.abs(along) - 0.5 * (length + length[other]), 0.0)
            gap = np.where(other >= 0, free, np.inf)
            closer = (gap < best) & (gap <= NEIGHBOUR_DISTANCE)
            best, truck = np.where(closer, gap, best), np.where(closer, is_truck[other], truck)
        near |= {f"{side}_distance": np.where(np.isfinite(best), best, np.nan), f"{side}_is_truck": truck}
    return near
