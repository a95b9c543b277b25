"""Recordings with positions of several vehicles, with the road that they were driven on: given, or made from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.base.errors import FormatError, absent
from xosc_lateral.base.texts import composed
from xosc_lateral.extras.recordings.cuts import require_lane_direction
from xosc_lateral.extras.recordings.importers import ImportedDrives, dlr_ht, dlr_ut, import_drives, levelx
from xosc_lateral.extras.recordings.importers.fcd import (
    NET_ENDINGS,
    lanes_of_net,
    of_rear_axles,
    read_fcd,
    read_sumo_net,
)
from xosc_lateral.extras.recordings.importers.track_table import USUAL_LENGTH, Tracks, read_tracks
from xosc_lateral.extras.recordings.importers.tracks import LaneShape, place_on_road
from xosc_lateral.extras.recordings.lane_order import LaneGraph
from xosc_lateral.extras.recordings.recorded import RecordedTrack
from xosc_lateral.extras.recordings.road_file import (
    SHOULDER,
    WIDTH_PIECE_LENGTH,
    DrivenLane,
    WrittenLane,
    WrittenRoad,
    curved_plan,
    roads_of_lanes,
)
from xosc_lateral.files.held import exists
from xosc_lateral.files.mapping import MappingLike, TableMapping, as_mapping
from xosc_lateral.files.opendrive.reader import parse_opendrive, read_opendrive
from xosc_lateral.files.source import read_source
from xosc_lateral.files.tables import foreign_errors
from xosc_lateral.files.xml import root_tag
from xosc_lateral.world.motion.nominal import made_vehicle
from xosc_lateral.world.road.network import RoadNetwork

STEP = 0.1  # rows are thinned to this: lane changes and braking last seconds [s]
REAR_AXLE = 0.3  # middle of a vehicle ahead of its rear axle, as a share of its length: 1.4 m of a car of 4.6 m [-]
GATE_ROWS = 20_000  # so many rows tell whether a recording drives along its lanes [-]
MAXIMUM_LENGTH = 60.0  # of vehicles with all that they pull: road trains have 53.5 m [m]
MAXIMUM_WIDTH = 6.0  # of what drives on roads, heavy transports included [m]
USUAL_WIDTH = {"truck": 2.5, "bus": 2.5, "trailer": 2.5, "van": 2.0, "motorcycle": 0.8, "motorbike": 0.8}
"""Where no width is given; 1.8 m for the rest (2.55 m is the EU's limit, directive 96/53/EC). [m]"""
USUAL_HEIGHT = {"truck": 3.6, "bus": 3.2, "trailer": 3.6, "van": 2.3}
"""Where no height is given; 1.5 m for the rest. [m]"""


@dataclass(frozen=True, eq=False, slots=True)
class RecordedTraffic:
    """Tracks in the coordinates of a road."""

    name: str  # of what is made from it
    tracks: tuple[RecordedTrack, ...]
    network: RoadNetwork
    road: bytes  # the road's file
    road_name: str  # of the file
    sources: tuple[Path, ...]  # what was read
    notes: tuple[str, ...] = field(default=())
    host: str | None = None  # vehicle that the recording calls its host
    label: str = ""  # of this one of several in a file
    dropped: Mapping[str, int] = field(default_factory=dict)  # rows of the file that are in no track, by reason
    read: int = 0  # rows that tracks were made from, before they were thinned

    @property
    def span(self) -> tuple[float, float]:
        """First and last time. [s]"""
        return min(float(t.time[0]) for t in self.tracks), max(float(t.time[-1]) for t in self.tracks)


def read_recording(
    source: Path, *, kind: str | None = None, road: Path | None = None, columns: MappingLike | None = None,
    recording: str | None = None,
) -> RecordedTraffic:  # fmt: skip
    """Read a recording, see `read_recordings`. Raises `FormatError`: the file holds several, and none is named."""
    every = read_recordings(source, kind=kind, road=road, columns=columns, recording=recording)
    if len(every) > 1:
        labels = ", ".join(traffic.label for traffic in every[:8])
        raise FormatError(f"{len(every)} recordings ({labels}): name one with --case", path=source)
    return every[0]


def read_recordings(
    source: Path, *, kind: str | None = None, road: Path | None = None, columns: MappingLike | None = None,
    recording: str | None = None,
) -> list[RecordedTraffic]:  # fmt: skip
    """Every recording of a file, or the one that is named, who was there at once in each.

    `kind`: one of `READERS`, else told from the name. `road`: OpenDRIVE. `columns`: of tables.
    """
    kind = kind or format_of(source)
    if kind not in (*READERS, "tracks"):
        raise FormatError(f"no recording format {kind!r}; there are {', '.join((*READERS, 'tracks'))}", path=source)
    if not exists(source):
        raise FormatError(absent(source), path=source)
    with foreign_errors(source, "can't be read as a recording"), np.errstate(all="ignore"):
        if kind == "tracks":
            every = _tracks(source, road, as_mapping(columns), recording)
        else:
            every = [READERS[kind](source, road, as_mapping(columns))]
    return [
        replace(traffic, tracks=tuple(map(_composed, traffic.tracks)), host=composed(traffic.host)) for traffic in every
    ]


def _composed(track: RecordedTrack) -> RecordedTrack:
    name = composed(track.name)
    return replace(track, name=name, entity=structs.replace(track.entity, name=name))


def drives_of(source: Path, road: Path, columns: MappingLike | None = None) -> ImportedDrives:
    """The drives of a recording on a road."""
    kind = format_of(source)
    return import_drives(kind, source, road=road, **({"columns": columns} if kind == "tracks" else {}))


def format_of(source: Path) -> str:
    """A recording's format by its name and what lies beside it; a table, where nothing else fits."""
    name = source.name.lower()
    if name.endswith((".whl", ".zip")) or name.startswith("trajectories_"):
        return "dlr-ut" if "urban" in name else "dlr-ht"
    if any(map(_is_levelx, source.glob("*_tracks.csv"))) if source.is_dir() else _is_levelx(source):
        return "levelx"
    if name.endswith((".osi", ".mcap", ".osi.gz")):
        return "osi"
    if name.endswith((".xml", ".xml.gz")) and root_tag(source) == "fcd-export":
        return "fcd"
    return "commonroad" if name.endswith((".xml", ".pb")) else "tracks"


# ---- tracks on a known road, or on the recording's own lanes ---------------------------------------------------------
def _tracks(source: Path, road: Path | None, columns: TableMapping, wanted: str | None = None) -> list[RecordedTraffic]:
    every = read_tracks(source, columns).of_recording(wanted, source)
    return [_on_road(tracks, source, road) for tracks in every]


def _osi(source: Path, road: Path | None, columns: TableMapping) -> RecordedTraffic:
    from xosc_lateral.extras.recordings.importers.osi import lanes_of
    from xosc_lateral.extras.recordings.osi_trace import read_osi

    recorded = read_osi(source)
    lanes = lanes_of(recorded) if road is None and recorded.opendrive is None else None
    traffic = _on_road(recorded.tracks, source, road, recorded.opendrive, lanes=lanes)
    host = recorded.hosts[0] if len(recorded.hosts) == 1 else None
    return replace(traffic, notes=(*recorded.notes, *traffic.notes), host=host)


def _commonroad(source: Path, road: Path | None, columns: TableMapping) -> RecordedTraffic:
    from xosc_lateral.extras.recordings.importers.commonroad import read_obstacles

    tracks, shapes, graph, _ = read_obstacles(source, source.stem)
    names = tuple(name.removeprefix(f"{source.stem}:") for name in tracks.names)
    return _on_road(replace(tracks, names=names), source, road, lanes=(shapes, graph))


def _fcd(source: Path, road: Path | None, columns: TableMapping) -> RecordedTraffic:
    if road is None:
        raise FormatError("comes without lanes: give its network with --road FILE.net.xml", path=source)
    if not road.name.lower().endswith(NET_ENDINGS):
        return _on_road(of_rear_axles(read_fcd(source)[0]), source, road)
    net = read_sumo_net(road)
    made = roads_of_lanes(lanes_of_net(net, road), name_of(source), left_handed=net.left_hand).encode()
    return replace(_on_road(of_rear_axles(read_fcd(source)[0]), source, None, made), sources=(source, road))


def _is_levelx(source: Path) -> bool:
    """A recording of levelX has its meta beside it: others call their tracks the same."""
    name = source.name
    return name.endswith("_tracks.csv") and source.with_name(name.replace("_tracks.csv", "_recordingMeta.csv")).exists()


def name_of(source: Path) -> str:
    """Of what is made from a recording."""
    return source.name.split(".")[0]


def _on_road(
    tracks: Tracks, source: Path, road: Path | None, made: bytes | None = None, *,
    lanes: tuple[Sequence[LaneShape], LaneGraph] | None = None,
) -> RecordedTraffic:  # fmt: skip
    """`made`: OpenDRIVE of the recording's own lanes, or these, for where no road is given."""
    if made is None and road is None and lanes is not None:
        made = roads_of_lanes(driven_lanes(*lanes), name_of(source)).encode()
    if road is not None:
        network, data, road_name = read_opendrive(road), read_source(road).data, road.name
    elif made is not None:
        network, data, road_name = parse_opendrive(made, name_of(source)), made, f"{name_of(source)}.xodr"
    else:
        raise FormatError("comes without a road: give it with --road FILE.xodr", path=source)
    x, y = network.header_offset.undo(tracks.x, tracks.y)
    heading = tracks.heading - network.header_offset.heading
    placed, _ = place_on_road(tracks.rows(np.arange(0, len(x), max(1, len(x) // GATE_ROWS))), network)
    require_lane_direction(placed.agreement, placed.tracks.speed, Path(network.path).name or "its lanes", source)
    vehicles, notes = _vehicles(replace(tracks, x=x, y=y, heading=heading))
    sources = (source,) if road is None else (source, road)
    label = tracks.recordings[0] if len(tracks.recordings) == 1 else ""
    return RecordedTraffic(
        name_of(source),
        vehicles,
        network,
        data,
        road_name,
        sources,
        (*placed.notes(), *notes),
        host=None,
        label=label,
        dropped=tracks.dropped,
        read=len(tracks.x),
    )


def _vehicles(tracks: Tracks) -> tuple[tuple[RecordedTrack, ...], tuple[str, ...]]:
    """Each vehicle, its rows `STEP` apart or as recorded, the first and the last always; and whose size is none."""
    vehicles, notes = list[RecordedTrack](), list[str]()
    parts = np.split(np.arange(len(tracks.x)), np.flatnonzero(np.diff(tracks.vehicle)) + 1)
    for name, part in zip(tracks.names, parts, strict=True):
        number = np.floor((tracks.time[part] - tracks.time[part[0]]) / STEP + 1e-6)
        rows = part[np.r_[True, np.diff(number[:-1]) > 0, True][: len(part)]]
        first, time, x, y, heading = (
            rows[0],
            *(each[rows] for each in (tracks.time, tracks.x, tracks.y, tracks.heading)),
        )
        if np.isnan(heading).all():
            heading = np.arctan2(np.gradient(y), np.gradient(x)) if len(rows) > 1 else np.zeros(1)
        kind, length = str(tracks.kind[first]), float(tracks.length[first])
        usual = USUAL_LENGTH.get(kind, 4.6), USUAL_WIDTH.get(kind, 1.8)
        width = usual[1] if tracks.width is None else float(tracks.width[first])
        if not (0.0 < length <= MAXIMUM_LENGTH and 0.0 < width <= MAXIMUM_WIDTH):
            taken = f"{usual[0]:g} m x {usual[1]:g} m are taken"
            notes.append(f"{name}: no vehicle has {length:g} m x {width:g} m, {taken}")
            length, width = usual
        height = USUAL_HEIGHT.get(kind, 1.5) if tracks.height is None else float(tracks.height[first])
        middle = REAR_AXLE * length if tracks.rear is None else float(tracks.rear[first])
        ahead = 0.0 if tracks.is_reference or tracks.rear is not None else middle
        columns = {"x": x, "y": y, "heading": heading}
        entity = made_vehicle(name, length, width, middle, height, kind)
        vehicles.append(RecordedTrack(name, time, columns, np.empty(0, dtype=np.intp), entity, ahead))
    return tuple(vehicles), tuple(notes)


def driven_lanes(shapes: Sequence[LaneShape], graph: LaneGraph) -> list[DrivenLane]:
    """Lanes of a recording as lines."""
    return [
        DrivenLane(shape.left, shape.right, int(beside), following)
        for shape, beside, following in zip(shapes, graph.left, graph.following, strict=True)
    ]


# ---- recordings whose road is made -----------------------------------------------------------------------------------
def _made(road: WrittenRoad, tracks: Tracks, source: Path, *notes: str) -> RecordedTraffic:
    data, (vehicles, odd) = road.to_xml().encode(), _vehicles(tracks)
    network = parse_opendrive(data, road.name)
    return RecordedTraffic(
        road.name, vehicles, network, data, f"{road.name}.xodr", (source,), (*notes, *tracks.notes, *odd),
        dropped=tracks.dropped, read=len(tracks.x),
    )  # fmt: skip


def _dlr(source: Path, road: Path | None, columns: TableMapping) -> RecordedTraffic:
    table = dlr_ht.read_tracks(source)
    made = dlr_road(dlr_ht.find_lanes(table))
    kinds, vehicle = dlr_ht.vehicle_classes(table), table["vehicle"].to_numpy()
    x, y, time = (table[name].to_numpy() for name in ("center_easting", "center_northing", "time"))
    length, height, speed = (
        table[name].to_numpy() for name in ("dimension_length", "dimension_height", "velocity_magnitude")
    )
    width = table[dlr_ht.WIDTH_COLUMN].to_numpy() if dlr_ht.WIDTH_COLUMN in table else None
    short = _short(table["id"].astype(str).to_numpy(dtype=str))
    names = tuple(short[str(name)] for name in table["id"][np.r_[True, np.diff(vehicle) != 0]])
    place = x - made.origin[0], y - made.origin[1], np.full(len(x), np.nan)  # headings are not recorded
    dropped = table.attrs["dropped"]
    tracks = Tracks(
        names, vehicle, time, dlr_ht.STEP, *place, speed, length, kinds, width, height=height, dropped=dropped
    )
    note = "the road is that of the traffic: lane centres are those of its vehicles, nobody measured markings"
    return _made(made, tracks, source, note)


def _levelx(source: Path, road: Path | None, columns: TableMapping) -> RecordedTraffic:
    """One recording of highD, whose road is straight and has its markings in the meta file; exiD comes with a road."""
    files = sorted(source.glob("*_tracks.csv")) if source.is_dir() else [source]
    if len(files) != 1:
        raise FormatError(f"{len(files)} recordings (XX_tracks.csv); name one", path=source)
    recording = levelx.Recording.read(files[0])
    if recording.layout != "highD":
        return _on_road(levelx.tracks_in(recording), files[0], road)
    made, tracks, _ = levelx.on_its_road(recording)
    return _made(made, tracks, files[0])


def _short(names: NDArray[np.str_]) -> dict[str, str]:
    """Names without the beginning that all have in common, as long as a digit is left."""
    every = sorted(set(names.tolist()))
    common = 0
    while len(every) > 1 and common < len(every[0]) - 1 and len({name[: common + 1] for name in every}) == 1:
        common += 1
    return {name: name[common:] for name in every}


def dlr_road(lanes: dlr_ht.Carriageways) -> WrittenRoad:
    """Both carriageways along one line; a lane is as wide as its direction's centres are apart."""
    line = lanes.reference
    middle = line.place(np.array([0.5 * line.length]), 0)[0]
    origin = float(np.round(middle[0])), float(np.round(middle[1]))
    s = np.linspace(0.0, line.length, max(2, round(line.length / WIDTH_PIECE_LENGTH)) + 1)
    sides = []
    for name in ("southbound", "northbound"):
        along = s if name == "northbound" else line.length - s
        outer, inner = (
            -lane.at(np.clip(along, lane.start, lane.end), np.full(len(s), lane.height)) for lane in lanes.lanes[name]
        )
        width = outer - inner
        driving = WrittenLane.through("driving", s, width)
        median = WrittenLane.through("median", s, inner - 0.5 * width)
        sides.append([median, driving, driving, WrittenLane.even("shoulder", SHOULDER)])
    return WrittenRoad("dlr-ht", curved_plan(line, origin), sides[0], sides[1], origin)


def _dlr_ut(source: Path, road: Path | None, columns: TableMapping) -> RecordedTraffic:
    tracks, shapes, graph, _ = dlr_ut.read_streams(source)
    made = None if road is not None else roads_of_lanes(driven_lanes(shapes, graph), "dlr-ut").encode()
    note = "the road is that of the traffic: lanes are the mean paths of its vehicles, their width is assumed"
    traffic = _on_road(tracks, source, road, made)
    return replace(
        traffic, name="dlr-ut", road_name="dlr-ut.xodr" if road is None else road.name, notes=(*traffic.notes, note)
    )


READERS: dict[str, Callable[[Path, Path | None, TableMapping], RecordedTraffic]] = {
    "dlr-ht": _dlr, "dlr-ut": _dlr_ut, "levelx": _levelx, "osi": _osi, "commonroad": _commonroad, "fcd": _fcd,
}  # fmt: skip
