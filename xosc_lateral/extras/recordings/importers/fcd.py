"""SUMO's FCD output ("floating car data"): where every vehicle of a run with the sublane model was.

Lanes are SUMO's, so is `posLat`, the place in them; in left-hand networks SUMO counts both from the left kerb, and they
are turned here. Widths and counts of lanes, and how edges hang together, come from the net, where it is given; else
lanes are 3.2 m wide, as SUMO has them, and nobody is seen on another edge.

References
----------
.. [1] Eclipse SUMO, FCD output and road networks: x and y are the middle of the front bumper, angles count clockwise
       from north; lanes count from the side of the kerb.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.vehicle_classes import ON_ROADS, TRUCKS, class_named
from xosc_lateral.drivers.drives.evidence import LEAST_JUMPS, jumps_of
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS, is_right_to_left
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer
from xosc_lateral.extras.recordings.importers.track_table import Tracks, tracks_of_rows
from xosc_lateral.extras.recordings.importers.tracks import lanes_beside
from xosc_lateral.extras.recordings.lane_order import LaneGraph
from xosc_lateral.extras.recordings.neighbours import neighbour_columns
from xosc_lateral.extras.recordings.road_file import DrivenLane
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import unpacked_text
from xosc_lateral.files.xml import root_tag
from xosc_lateral.workflows.options import flag

# ---- networks and vehicle types, as far as a recording of a run needs them ----
LANE_WIDTH = 3.2  # of SUMO's lanes [m]

LENGTHS = {
    "trailer": 16.5, "truck": 7.1, "lkw": 7.1, "coach": 14.0, "bus": 12.0, "delivery": 6.5, "emergency": 6.5,
    "army": 6.5, "motorcycle": 2.2, "moped": 2.1, "bicycle": 1.6, "tram": 22.0,
}  # fmt: skip
"""Of SUMO's vehicle classes (Vehicle Type Parameter Defaults); 5 m of all others. FCD output has no lengths. [m]"""

ON_FOOT = frozenset({"pedestrian", "bicycle", "wheelchair", "scooter", "rail", "tram", "rail_urban", "subway", "ship"})
"""A lane for these alone is no driving lane."""


@dataclass(frozen=True, slots=True)
class SumoLane:
    """A lane of a network: the edge that it is of, and its number there, from the kerb."""

    edge: str
    index: int
    width: float  # [m]
    length: float  # [m]
    is_driving: bool
    shape: str = ""  # points of its middle, as written


@dataclass(slots=True)
class SumoNet:
    """Lanes by their ids, inner ones of junctions included, and the lanes that each leads to, straight on first."""

    left_hand: bool = False
    lanes: dict[str, SumoLane] = field(default_factory=dict)
    following: dict[str, list[str]] = field(default_factory=dict)


def read_sumo_net(path: Path) -> SumoNet:
    """Raises `FormatError`: no SUMO network."""
    net, links = SumoNet(), list[tuple[bool, str, str]]()
    for event, element in elements(path, ("net", "lane", "connection")):
        if event == "end":
            continue
        if element.tag == "net":
            net.left_hand = element.get("lefthand", "false") in ("true", "1", "yes")
        elif element.tag == "lane" and (name := element.get("id")):
            edge, _, index = name.rpartition("_")
            allowed, denied = (set(element.get(key, "").split()) for key in ("allow", "disallow"))
            is_driving = not (allowed and allowed <= ON_FOOT) and "all" not in denied
            shape = element.get("shape", "")
            width = LANE_WIDTH if element.get("width") is None else number_of(element, "width", path)
            net.lanes[name] = SumoLane(edge, int(index), width, number_of(element, "length", path), is_driving, shape)
        elif element.tag == "connection" and element.get("from") is not None:
            here, there = (f"{element.get(end)}_{element.get(f'{end}Lane')}" for end in ("from", "to"))
            links.append((element.get("dir") != "s", here, element.get("via") or there))
    if not net.lanes:
        raise FormatError("no lane: not a SUMO network", path=path)
    for _, here, there in sorted(links):
        net.following.setdefault(here, []).append(there)
    return net


def fcd_vehicles(path: Path) -> Iterator[tuple[float, Any]]:
    """Time and element of each vehicle in FCD output. Raises `FormatError`: it is none; one is outside of a time."""
    if (tag := root_tag(path)) != "fcd-export":
        what = f"its root element is {tag!r}" if tag else "it is no XML"
        raise FormatError(f"no FCD output of SUMO: {what}", path=path)
    time = float("nan")
    for event, element in elements(path, ("timestep", "vehicle")):
        if event == "end":
            if element.tag == "timestep":
                element.clear()
        elif element.tag == "timestep":
            time = number_of(element, "time", path)
        elif np.isfinite(time):
            yield time, element
        else:
            raise wrong_element("a vehicle outside a timestep", element, path)


def is_left_handed(path: Path) -> bool:
    """Whether a network is of left-hand traffic, in which SUMO counts lanes and sides from the left kerb."""
    return next((element.get("lefthand") in ("true", "1", "yes") for _, element in elements(path, ("net",))), False)


def read_vehicle_types(path: Path | None) -> dict[str, tuple[float, str]]:
    """Length [m] and class of the vehicle types in a route or additional file; of none, nothing."""
    types = {}
    for event, element in elements(path, ("vType",)) if path is not None else ():
        if event == "start" and element.get("id"):
            kind = element.get("vClass", "passenger")
            length = usual_length(kind) if element.get("length") is None else number_of(element, "length", path)
            types[str(element.get("id"))] = length, kind
    if path is not None and not types:
        raise FormatError("no vType: not a file of SUMO's vehicle types", path=path)
    return types


def usual_length(name: str) -> float:
    """Of a vehicle whose type or class has such a name. [m]"""
    return next((length for word, length in LENGTHS.items() if word in name.lower()), 5.0)


def elements(path: Path, tags: tuple[str, ...]) -> Iterator[tuple[str, etree._Element]]:
    """Starts and ends of some elements of an XML file, packed or not."""
    try:
        with open_source(path) as source:
            yield from etree.iterparse(
                unpacked_text(source), events=("start", "end"), tag=tags,
                resolve_entities=False, no_network=True, load_dtd=False,
            )  # fmt: skip
    except etree.XMLSyntaxError as error:
        raise FormatError(f"not XML: {error.msg}", path=path, line=error.lineno) from error


def wrong_element(what: str, element: etree._Element, path: Path | None) -> FormatError:
    """With the element's line."""
    line: Any = element.sourceline  # int or None; its stubs say otherwise
    return FormatError(what, path=path, line=line, element=str(element.tag))


def number_of(element: etree._Element, name: str, path: Path | None) -> float:
    """An attribute. Raises `FormatError`: it is no finite number."""
    text = element.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise wrong_element(f"{name}={text!r}", element, path)
    return value


# ---- the output ----
LICENCE = "that of the simulation"
NUMERIC_ATTRIBUTES = ("pos", "posLat", "x", "y", "angle", "speed")
NET_ENDINGS = (".net.xml", ".net.xml.gz")
REAR_FROM_FRONT = 0.8  # rear axle behind the front bumper, as a share of the length: 3.7 m of a car of 4.6 m [-]


@importer
def import_fcd(
    source: Path, *,
    net: Annotated[str | Path | None, flag(kind=Path | None,
        help="Road network (.net.xml): lanes, side of the road, who is on the next edge.")] = None,
    types: Annotated[str | Path | None, flag(kind=Path | None,
        help="File with the vehicle types (.rou.xml): lengths.")] = None,
    lane_width: Annotated[float | None, flag(min=1, max=10,
        help="Without a network; default: as lane changes show it, else 3.2. [m]")] = None,
) -> ImportedDrives:  # fmt: skip
    """SUMO's FCD output of a run with the sublane model: a drive for every vehicle.

    It is a truck when its type's name or class says so.
    """
    known = None if net is None else read_sumo_net(Path(net))
    tracks, rows = read_fcd(source, None if types is None else Path(types), in_lanes=True)
    width = lane_width or shown_width(tracks, rows["posLat"].to_numpy())
    lanes = _net_of(rows, width) if known is None else known
    left_hand = _left_hand(tracks, rows, lanes, None if known is None else known.left_hand, source)
    turned = ["left-hand traffic: lanes and sides are counted from the left kerb, and turned"]
    notes = [*tracks.notes, *turned * left_hand]
    if known is None:
        notes.append(
            f"without --net: lanes without a width, {width:.4g} m are taken, and nobody is seen on another edge"
        )
    elif len(strange := rows["lane"][~rows["lane"].isin(list(known.lanes))]):
        raise FormatError(f"lane {strange.iloc[0]!r} is not in {net}", path=source)
    return imported(
        _drive_table(tracks, rows, lanes, left_hand), step=tracks.step, dropped=tracks.dropped, notes=notes,
        sources=[source, *(Path(file) for file in (net, types) if file is not None)], format="fcd", licence=LICENCE,
        settings={"lane_width": width if net is None else None},
    )  # fmt: skip


def read_fcd(path: Path, types: Path | None = None, *, in_lanes: bool = False) -> tuple[Tracks, pd.DataFrame]:
    """Tracks of the fronts' middles, and `lane`, `pos` and `posLat` of their rows, which have to be there `in_lanes`.

    Raises `FormatError`, `NotEnoughDataError`.
    """
    stated = read_vehicle_types(types)
    rows = pd.DataFrame(_rows(path, in_lanes), columns=["time", "name", "kind", "lane", *NUMERIC_ATTRIBUTES])
    if rows.empty:
        raise NotEnoughDataError(f"{path}: no vehicle")
    vehicle, names = rows["name"].factorize(sort=True)
    number, kinds = rows["kind"].factorize()
    known = [stated.get(kind.partition("@")[0], (usual_length(kind), kind)) for kind in kinds]
    words = [name if (name := class_named(kind)) in ON_ROADS else "" for _, kind in known]
    length = np.array([size for size, _ in known])[number]
    columns = {name: rows[name].to_numpy() for name in ("time", "x", "y", "speed")}
    columns |= {"heading": np.radians(90.0 - rows["angle"].to_numpy()), "kind": np.array(words)[number]}
    tracks, order = tracks_of_rows(
        list(map(str, names)), vehicle, columns | {"length": length, "rear": -0.5 * length}, path
    )
    return tracks, rows[["lane", "pos", "posLat"]].iloc[order].reset_index(drop=True)


def _rows(path: Path, in_lanes: bool) -> Iterator[tuple[Any, ...]]:
    """Time, name, type, lane, `NUMERIC_ATTRIBUTES` of each vehicle at each instant; NaN: not needed, and not there."""
    needed = ("speed", "pos", "posLat") if in_lanes else ("speed", "x", "y", "angle")
    for time, element in fcd_vehicles(path):
        if in_lanes and element.get("posLat") is None:
            what = "no posLat: it is written with the sublane model and --fcd-output.attributes all"
            raise wrong_element(what, element, path)
        name, kind, lane = element.get("id"), element.get("type", ""), element.get("lane")
        if name is None or (in_lanes and lane is None):
            raise wrong_element("no id or lane", element, path)
        numbers = (
            number_of(element, one, path) if one in needed else float(element.get(one, "nan"))
            for one in NUMERIC_ATTRIBUTES
        )
        yield time, name, kind, lane, *numbers


def shown_width(tracks: Tracks, side: FloatArray) -> float:
    """Of lanes: how far places in them jump where they change, in the median, else SUMO's own. [m]"""
    parts = np.split(np.arange(len(side)), np.flatnonzero(np.diff(tracks.vehicle)) + 1)
    jumps = [jumps_of(tracks.time[part], side[part], np.full(len(part), LANE_WIDTH), None)[0] for part in parts]
    sizes = np.abs(np.concatenate(jumps))
    return round(float(np.median(sizes)), 2) if len(sizes) >= LEAST_JUMPS else LANE_WIDTH


def _drive_table(tracks: Tracks, rows: pd.DataFrame, net: SumoNet, left_hand: bool) -> pd.DataFrame:
    side = rows["posLat"].to_numpy()
    numbers, left, following = _driving_lanes(net, left_hand)
    graph, (index, count) = (
        LaneGraph(np.array([net.lanes[name].length for name in numbers]), left, following),
        lanes_beside(left),
    )
    piece = np.array([numbers.get(name, -1) for name in rows["lane"]])
    is_truck = np.isin(tracks.kind, list(TRUCKS))
    near = neighbour_columns(
        graph, piece, rows["pos"].to_numpy() - 0.5 * tracks.length, tracks.clock(), tracks.vehicle, tracks.step,
        tracks.speed, tracks.length, is_truck,
    )  # fmt: skip
    return pd.DataFrame({
        "drive": np.array(tracks.names, dtype=object)[tracks.vehicle], "time": tracks.time,
        "offset": (-side if left_hand else side) + 0.0, "speed": tracks.speed,
        "lane_width": rows["lane"].map({name: lane.width for name, lane in net.lanes.items()}),
        "lane_index": index[piece], "lane_count": count[piece], "is_truck": is_truck.astype(np.float64), **near,
        "state": np.where(rows["lane"].str.startswith(":"), "junction", np.where(piece < 0, "no lane", KEPT_ROWS)),
    })  # fmt: skip


def _driving_lanes(net: SumoNet, left_hand: bool) -> tuple[dict[str, int], IntArray, list[list[int]]]:
    """Numbers of the lanes that vehicles drive on, which is on the left of each (-1: none), and those that each leads
    to: lanes of an edge lie side by side, counted from the kerb."""
    numbers = {name: k for k, name in enumerate(name for name, lane in net.lanes.items() if lane.is_driving)}
    lanes, side = [net.lanes[name] for name in numbers], -1 if left_hand else 1
    left = np.array([numbers.get(f"{lane.edge}_{lane.index + side}", -1) for lane in lanes], dtype=np.int64)
    following = [[numbers[other] for other in net.following.get(name, ()) if other in numbers] for name in numbers]
    return numbers, left, following


def _net_of(rows: pd.DataFrame, width: float) -> SumoNet:
    """What the output alone says of the lanes: those in which somebody was, and all on their right."""
    last, end = dict[str, int](), dict[str, float]()
    for name, place in rows.loc[~rows["lane"].str.startswith(":"), ["lane", "pos"]].itertuples(index=False):
        edge, _, index = name.rpartition("_")
        last[edge], end[edge] = max(last.get(edge, 0), int(index)), max(end.get(edge, 0.0), place)
    lanes = [SumoLane(edge, k, width, end[edge], True) for edge, top in last.items() for k in range(top + 1)]
    return SumoNet(lanes={f"{lane.edge}_{lane.index}": lane for lane in lanes})


def _left_hand(tracks: Tracks, rows: pd.DataFrame, net: SumoNet, stated: bool | None, source: Path) -> bool:
    """Whether sides are counted from the left kerb: as the network says, which positions must not contradict."""
    inside = rows["lane"].isin(list(net.lanes)).to_numpy()
    lanes = [net.lanes[name] for name in rows["lane"][inside]]
    across = np.array([lane.index * lane.width for lane in lanes]) + rows["posLat"].to_numpy()[inside]
    edge = pd.factorize(np.array([lane.edge for lane in lanes], dtype=object))[0]
    seen = is_right_to_left(tracks.x[inside], tracks.y[inside], tracks.heading[inside], across, edge)
    if stated is not None and seen is not None and seen is stated:
        hands = ("right", "left") if stated else ("left", "right")
        what = f"positions are of {hands[0]}-hand traffic, the network is of {hands[1]}-hand traffic: is it this run's?"
        raise FormatError(what, path=source)
    return bool(stated) if stated is not None else seen is False


# ---- for `reconstruct`: the lanes of a network as lines, and where vehicles' rear axles were -------------------------
def lanes_of_net(net: SumoNet, path: Path) -> list[DrivenLane]:
    """Lanes that vehicles drive on, those inside junctions included. Raises `FormatError`: a lane without a shape."""
    numbers, beside, following = _driving_lanes(net, net.left_hand)
    if not numbers:
        raise FormatError("no lane for vehicles", path=path)
    lanes = list[DrivenLane]()
    for name, on_left, onward in zip(numbers, beside.tolist(), following, strict=True):
        lane = net.lanes[name]
        try:
            points = np.array([point.split(",")[:2] for point in lane.shape.split()], dtype=np.float64)
        except ValueError:
            points = np.empty(0)
        moved = np.hypot(*np.diff(points, axis=0).T) if points.ndim == 2 else np.empty(0)
        if not (moved > 0.0).any() or not np.isfinite(points).all():
            raise FormatError(f"shape={lane.shape[:40]!r} is no line", path=path, element=f"lane {name!r}")
        points = points[np.r_[True, moved > 0.0]]
        pieces = np.diff(points, axis=0)
        normals = np.stack([-pieces[:, 1], pieces[:, 0]], axis=1) / np.hypot(*pieces.T)[:, None]
        normal = np.concatenate([normals[:1], normals[:-1] + normals[1:], normals[-1:]])
        normal[1:-1] /= 1.0 + (normals[:-1] * normals[1:]).sum(axis=1, keepdims=True)  # as far from both pieces
        half = 0.5 * lane.width * normal
        lanes.append(DrivenLane(points + half, points - half, on_left, onward))
    return lanes


def of_rear_axles(tracks: Tracks) -> Tracks:
    """Tracks of fronts as those of the rear axles, which pass where the front did: SUMO turns vehicles about theirs."""
    x, y, heading = tracks.x, tracks.y, tracks.heading
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(tracks.vehicle)) + 1):
        first, behind = part[0], REAR_FROM_FRONT * tracks.length[part[0]]
        start = [x[first] - behind * np.cos(heading[first]), y[first] - behind * np.sin(heading[first])]
        front = np.vstack([start, np.stack([x[part], y[part]], axis=1)])
        way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(front, axis=0).T))]
        x[part], y[part] = (np.interp(way[1:] - behind, way, front[:, axis]) for axis in (0, 1))
    return replace(tracks, time=tracks.time - float(tracks.time.min()), rear=(REAR_FROM_FRONT - 0.5) * tracks.length)
