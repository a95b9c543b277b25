"""OSI traces: their ground truth message by message, and from it what vehicles did and where lanes are."""

from __future__ import annotations

import struct
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import groupby, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.vehicle_classes import class_of
from xosc_lateral.extras.recordings.importers.track_table import USUAL_LENGTH, Tracks, tracks_of_rows
from xosc_lateral.files.apart import apart
from xosc_lateral.files.osi import SUFFIXES, osi
from xosc_lateral.files.source import check_regular, open_source
from xosc_lateral.files.tables import foreign_errors, read_arrow
from xosc_lateral.world.motion.nominal import axes

TRUTHS = ("GROUND_TRUTH", "SENSOR_VIEW")  # messages of the true world; a sensor view has it as its global ground truth
NANOSECONDS = 1_000_000_000
PLACES = {
    "position": ("x", "y", "z"),
    "velocity": ("vel_x", "vel_y", "vel_z"),
    "acceleration": ("acc_x", "acc_y", "acc_z"),
    "orientation": ("roll", "pitch", "yaw"),
    "dimension": ("length", "width", "height"),
}
"""Part of OSI's `BaseMoving` -> columns of omega-prime's Parquet."""

ROW_COLUMNS = ("total_nanos", "idx", "type", "role", "subtype", *(name for names in PLACES.values() for name in names))


class Trace:
    """An open trace; use it as a context, and iterate over its ground truths.

    `channel`: topic of an MCAP file; without it the one that holds ground truth, else a sensor view. `notes`: channels
    that are not read. `opendrive`: the road, where the file has it and was read.
    """

    def __init__(self, path: Path, channel: str | None = None) -> None:
        suffix = path.suffix.lower()
        if suffix not in (*SUFFIXES, ".parquet"):
            what = f"an OSI trace ends in {', '.join(SUFFIXES)}, one of omega-prime in .parquet too"
            raise FormatError(what, path=path)
        check_regular(path)
        if path.stat().st_size == 0:
            raise FormatError("is empty", path=path)
        if channel is not None and suffix != ".mcap":
            raise FormatError(f"has no channels, so no channel {channel!r}", path=path)
        self.path = path
        self.notes: list[str] = []
        self.opendrive: bytes | None = None
        self._reader: Any = None
        if suffix != ".parquet":
            self._reader = self._of_mcap(channel) if suffix == ".mcap" else self._of_messages()

    def __enter__(self) -> Trace:
        return self

    def __exit__(self, *error: object) -> None:
        if self._reader is not None:
            self._reader.close()

    def __iter__(self) -> Iterator[Any]:
        if self._reader is None:
            yield from self._of_rows()
            return
        number = 0
        while (result := self._reader.read_message()) is not None:
            number += 1
            if result.message is None:
                why = " ".join(str(result.error_message).split())
                raise FormatError(f"damaged: {why}", path=self.path, element=f"message {number}")
            is_view = type(result.message).__name__ == "SensorView"
            yield result.message.global_ground_truth if is_view else result.message

    def _of_mcap(self, channel: str | None) -> Any:
        utilities = osi("osi_utilities")
        _refuse_unpacking(self.path)
        reader = utilities.MultiTraceReader()
        if not reader.open(self.path):
            raise FormatError("not an MCAP file, or one that was not closed", path=self.path)
        names = {kind: name for name, kind in utilities.MessageType.__members__.items()}
        topics = {known.topic: names[known.message_type] for known in reader.list_channel_specifications()}
        others = [topic for topic in reader.get_available_topics() if topic not in topics]
        listed = ", ".join([f"{topic} ({kind})" for topic, kind in topics.items()] + others) or "none"
        truths = [topic for wanted in TRUTHS for topic, kind in topics.items() if kind == wanted]
        chosen = next((topic for topic in truths if channel in (None, topic)), None)
        if chosen is None:
            reader.close()
            what = "ground truth or a sensor view" + ("" if channel is None else f" named {channel!r}")
            raise FormatError(f"no channel with {what}; there are: {listed}", path=self.path)
        if len(topics) + len(others) > 1:
            self.notes.append(f"{self.path.name}: read channel {chosen} of {listed}")
        reader.set_topics([chosen])
        return reader

    def _of_messages(self) -> Any:
        utilities = osi("osi_utilities")
        kinds = utilities.MessageType
        named = utilities.infer_message_type_from_filename(self.path.name)
        if named not in (kinds.UNKNOWN, kinds.GROUND_TRUTH, kinds.SENSOR_VIEW):
            raise FormatError(f"its name says {named.name}: neither ground truth nor a sensor view", path=self.path)
        if named is not kinds.UNKNOWN:
            return self._opened(named)
        # nothing in the file says what its messages are: a sensor view is one that shows moving objects
        reader = self._opened(kinds.SENSOR_VIEW)
        first = reader.read_message()
        reader.close()
        is_view = first.message is not None and first.message.global_ground_truth.moving_object
        return self._opened(kinds.SENSOR_VIEW if is_view else kinds.GROUND_TRUTH)

    def _opened(self, kind: Any) -> Any:
        reader = osi("osi_utilities").SingleTraceReader()
        reader.set_message_type(kind)
        if not reader.open(self.path):
            raise FormatError("not an OSI trace", path=self.path)
        return reader

    def _of_rows(self) -> Iterator[Any]:
        """Ground truths of omega-prime's Parquet, whose lanes or road are in its metadata."""
        path, ground_truth = self.path, osi("osi3.osi_groundtruth_pb2").GroundTruth
        with foreign_errors(path, "can't be read as Parquet"):
            rows = read_arrow(path, ROW_COLUMNS, "not a recording of omega-prime")
            about = rows.schema.metadata or {}
            rows = rows.sort_by([("total_nanos", "ascending"), ("idx", "ascending")])
        self.opendrive = about.get(b"xodr")
        with foreign_errors(path, "can't be read as a recording of omega-prime"):
            lanes = ground_truth()
            if b"osi" in about:
                osi("google.protobuf.json_format").Parse(about[b"osi"], lanes, ignore_unknown_fields=True)
            host = int(about.get(b"host_vehicle_idx", b"-1"))
        every = (row for batch in rows.to_batches(max_chunksize=10_000) for row in batch.to_pylist())
        for number, (nanoseconds, present) in enumerate(groupby(every, key=lambda row: row["total_nanos"]), 1):
            message = ground_truth()
            if number == 1:
                message.CopyFrom(lanes)
                message.ClearField("moving_object")
            with foreign_errors(path, f"message {number}"):
                message.timestamp.seconds, message.timestamp.nanos = divmod(nanoseconds, NANOSECONDS)
                if host >= 0:
                    message.host_vehicle_id.value = host
                for row in present:
                    _fill(message.moving_object.add(), row)
            yield message


CHUNK, CHUNK_HEAD = 6, struct.Struct("<QQQII")
"""Opcode of an MCAP file's packed chunks; first and last time, unpacked size, checksum, length of the packer's name."""


def _refuse_unpacking(path: Path) -> None:
    """Refuse a trace with a chunk that says it is too large, before anything is unpacked; chunks come one by one."""
    with open_source(path) as source:
        place = 8  # after the magic number
        while source.file.seek(place) == place and len(head := source.file.read(9)) == 9:
            size = int.from_bytes(head[1:], "little")
            if head[0] == CHUNK and len(stated := source.file.read(CHUNK_HEAD.size)) == CHUNK_HEAD.size:
                *_, unpacked, _, named = CHUNK_HEAD.unpack(stated)
                packer = source.file.read(min(named, size))
                packed = source.file.read(8 + 18)[8:]  # a frame's header has 18 bytes at most
                if packer == b"zstd" and len(packed) > 4:
                    unpacked = max(unpacked, osi("zstandard").frame_content_size(packed))  # what is reserved for it
                replace(source, size=size).unpacked(unpacked)
            place += 9 + size


def _fill(thing: Any, row: dict[str, Any]) -> None:
    thing.id.value, thing.type = row["idx"], row["type"]
    for part, names in PLACES.items():
        vector = getattr(thing.base, part)
        fields = names if part in ("orientation", "dimension") else ("x", "y", "z")
        for name, column in zip(fields, names, strict=True):
            setattr(vector, name, row[column])
    for name, column in (("type", "subtype"), ("role", "role")):
        if row[column] >= 0:
            setattr(thing.vehicle_classification, name, row[column])


# ---- what vehicles did, and where lanes are --------------------------------------------------------------------------
LANE_FIELDS = ("lane", "lane_boundary", "logical_lane", "logical_lane_boundary")  # what is kept besides objects
ROW_SIZE = 12  # number, time, x, y, yaw, speed, length, pitch, roll; the rear axle, on the ground, from the middle


@dataclass
class Recorded:
    """A trace's vehicles, lanes and what a reader has to know."""

    # tracks: x and y are those of the ground below the rear axle where the trace says where that is, else below
    # the middle
    tracks: Tracks
    things: Mapping[str, Mapping[int, Any]]  # of `LANE_FIELDS`: by identifier, as far as all messages show them
    hosts: tuple[str, ...]  # names of all host vehicles
    numbers: dict[str, str]  # name -> identifier
    notes: list[str]
    opendrive: bytes | None = None


@apart
def read_osi(path: Path, channel: str | None = None) -> Recorded:
    """Read a trace, message by message. Raises `FormatError`, `NotEnoughDataError`."""
    with Trace(path, channel) as trace:
        collected = _Collected(path)
        for number, message in enumerate(trace, 1):
            collected.take(message, number)
        return replace(collected.recorded(trace.notes), opendrive=trace.opendrive)


@dataclass
class _Collected:
    path: Path
    values: array[float] = field(default_factory=lambda: array("d"))
    names: dict[int, str] = field(default_factory=dict)
    kinds: dict[int, str] = field(default_factory=dict)
    things: dict[str, dict[int, Any]] = field(default_factory=lambda: {name: {} for name in LANE_FIELDS})
    latest: dict[tuple[str, int], Any] = field(default_factory=dict)  # of `things`, as last seen
    hosts: dict[int, None] = field(default_factory=dict)
    others: dict[int, str] = field(default_factory=dict)  # what is no vehicle, by identifier
    lost: Counter[str] = field(default_factory=Counter)  # their rows, by what they are
    messages: int = 0
    zero: int = 0

    def take(self, message: Any, number: int) -> None:
        """One `GroundTruth`."""
        self.messages = number
        if not message.HasField("timestamp"):
            raise FormatError("has no timestamp", path=self.path, element=f"message {number}")
        nanoseconds = message.timestamp.seconds * 1_000_000_000 + message.timestamp.nanos
        if number == 1:
            self.zero = nanoseconds
        if message.HasField("host_vehicle_id"):
            self.hosts[message.host_vehicle_id.value] = None
        for thing_there in message.moving_object:
            self._vehicle(thing_there, 1e-9 * (nanoseconds - self.zero), number)
        for name, known in self.things.items():
            for thing in getattr(message, name):
                number_of = thing.id.value
                latest = self.latest.get((name, number_of))
                if latest == thing:
                    continue
                self.latest[name, number_of] = deepcopy(thing)  # a part would keep the whole message
                if latest is None:
                    known[number_of] = deepcopy(thing)
                else:
                    extend_thing(known[number_of], thing)

    def _vehicle(self, vehicle: Any, time: float, number: int) -> None:
        name = vehicle.id.value
        if name not in self.names:
            self._meet(vehicle)
        if name not in self.kinds:
            self.lost[self.others[name]] += 1
            return
        base = vehicle.base
        where = f"message {number}: moving object {name}"
        if not base.HasField("position"):
            raise FormatError("has no position", path=self.path, element=where)
        yaw = base.orientation.yaw if base.HasField("orientation") else np.nan
        speed = np.hypot(base.velocity.x, base.velocity.y) if base.HasField("velocity") else np.nan
        length = base.dimension.length if base.HasField("dimension") else 0.0
        rear = vehicle.vehicle_attributes.bbcenter_to_rear
        turned = base.orientation.pitch, base.orientation.roll
        x, y = base.position.x, base.position.y
        row = (name, time, x, y, yaw, speed, length or np.nan, *turned, rear.x, rear.y, -0.5 * base.dimension.height)
        if not np.isfinite(row[2:4]).all():
            raise FormatError(f"x {row[2]:g}, y {row[3]:g}: not a position", path=self.path, element=where)
        self.values.extend(map(float, row))

    def _meet(self, vehicle: Any) -> None:
        kinds = osi("osi3.osi_object_pb2").MovingObject
        name = vehicle.id.value
        stated = [r.identifier[-1] for r in vehicle.source_reference if "openscenario" in r.type and r.identifier]
        self.names[name] = stated[0] if stated and stated[0] not in self.names.values() else str(name)
        has_class = vehicle.HasField("vehicle_classification")
        if vehicle.type == kinds.TYPE_VEHICLE or (vehicle.type == kinds.TYPE_UNKNOWN and has_class):
            kind = kinds.VehicleClassification.Type.Name(vehicle.vehicle_classification.type).removeprefix("TYPE_")
            self.kinds[name] = "" if kind == "UNKNOWN" else class_of(kind) or ""
        else:
            self.others[name] = kinds.Type.Name(vehicle.type).removeprefix("TYPE_").lower()

    def recorded(self, notes: list[str]) -> Recorded:
        """All of it, in order."""
        rows = np.frombuffer(self.values, dtype=np.float64).reshape(-1, ROW_SIZE)
        others = Counter(self.others.values())
        notes = [*notes, *(f"{count} moving objects of type {kind} left out" for kind, count in others.items())]
        numbers, codes = np.unique(rows[:, 0].astype(np.int64), return_inverse=True)
        labels = [self.names[number] for number in numbers.tolist()]
        kinds = np.array([self.kinds[number] for number in numbers.tolist()], dtype=str)[codes]
        _, time, x, y, yaw, speed, length, *rest = rows.T
        usual = np.array([USUAL_LENGTH.get(str(kind), 4.6) for kind in kinds])
        length = np.where(np.isfinite(length), length, usual)
        columns = {"time": time, "x": x, "y": y, "heading": yaw, "speed": speed, "kind": kinds, "length": length}
        tracks, order = tracks_of_rows(labels, codes, columns, self.path, dropped=self.lost)
        notes += [*tracks.notes, *(f"{count} rows left out: {why}" for why, count in tracks.dropped.items())]
        hosts = tuple(self.names.get(host, str(host)) for host in self.hosts)
        if len(hosts) > 1:
            notes.append(f"several host vehicles: {', '.join(hosts)}")
        pitch, roll, *rear = (column[order] for column in rest)
        sides = zip(rear, axes(tracks.heading, pitch, roll), strict=True)
        arm = np.sum([part[:, None] * axis for part, axis in sides], axis=0)
        tracks = replace(
            tracks, time=tracks.time - float(tracks.time.min()), x=tracks.x + arm[:, 0], y=tracks.y + arm[:, 1],
            rear=-rear[0] if rear[0].any() else None, notes=(),
        )  # fmt: skip
        stated = {name: str(number) for number, name in self.names.items()}
        return Recorded(tracks, self.things, hosts, stated, notes)


BEYOND_END = 1e-3  # points farther than this past the end of a line go on with it [m]


def extend_thing(kept: Any, seen: Any) -> None:
    """Add to a lane or boundary what a later message shows of it: points beyond its ends, further identifiers."""
    kind = type(kept).__name__
    if kind in ("LaneBoundary", "LogicalLaneBoundary"):
        _extend(kept.boundary_line, seen.boundary_line, lambda point: point.position)
    elif kind == "Lane":
        _extend(kept.classification.centerline, seen.classification.centerline, lambda point: point)
        for name in ("left_lane_boundary_id", "right_lane_boundary_id", "left_adjacent_lane_id",
                     "right_adjacent_lane_id", "lane_pairing"):  # fmt: skip
            _unite(getattr(kept.classification, name), getattr(seen.classification, name))
    else:
        kept.start_s, kept.end_s = min(kept.start_s, seen.start_s), max(kept.end_s, seen.end_s)
        for name in ("left_boundary_id", "right_boundary_id", "left_adjacent_lane", "right_adjacent_lane",
                     "predecessor_lane", "successor_lane"):  # fmt: skip
            _unite(getattr(kept, name), getattr(seen, name))


def _unite(kept: Any, seen: Any) -> None:
    for thing in seen:
        if thing not in kept:
            kept.add().CopyFrom(thing)


def _extend(line: Any, seen: Any, place: Callable[[Any], Any]) -> None:
    if len(seen) < 2:
        return
    if len(line) < 2:
        del line[:]
        line.extend(seen)
        return
    line.extend(_beyond(place(line[-2]), place(line[-1]), list(reversed(seen)), place)[::-1])
    for point in reversed(_beyond(place(line[1]), place(line[0]), list(seen), place)):
        line.insert(0, point)


def _beyond(before: Any, end: Any, points: list[Any], place: Callable[[Any], Any]) -> list[Any]:
    """Of points from the far end inwards, those past a line's end."""
    dx, dy = end.x - before.x, end.y - before.y
    size = max((dx * dx + dy * dy) ** 0.5, 1e-9)
    ways = (((place(point).x - end.x) * dx + (place(point).y - end.y) * dy) / size for point in points)
    return [point for point, _ in takewhile(lambda pair: pair[1] > BEYOND_END, zip(points, ways, strict=True))]
