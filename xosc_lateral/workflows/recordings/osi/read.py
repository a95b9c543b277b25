"""What vehicles did and where lanes are, from the ground truth of an OSI trace."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.files.osi import osi
from xosc_lateral.workflows.recordings.importers.track_table import USUAL_LENGTH, Tracks, ground_speed, travel_heading
from xosc_lateral.workflows.recordings.osi.trace import Trace
from xosc_lateral.world.motion.nominal import axes

KINDS = {
    **dict.fromkeys(("SMALL_CAR", "COMPACT_CAR", "CAR", "MEDIUM_CAR", "LUXURY_CAR"), "car"),
    **{"DELIVERY_VAN": "van", "VAN": "van", "HEAVY_TRUCK": "truck", "SEMITRACTOR": "truck", "MOTORBIKE": "motorcycle"},
}
"""`VehicleClassification.Type` -> vehicle class; others by their own names."""

LANE_FIELDS = ("lane", "lane_boundary", "logical_lane", "logical_lane_boundary")  # what is kept besides objects
LEAP_DISTANCE = 3.0  # farther than twice what it drives in a step, and by this much: not the same vehicle any more [m]
COLUMNS = 12  # number, time, x, y, yaw, speed, length, pitch, roll; the rear axle, on the ground, from the middle


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
    left_out: Counter[str] = field(default_factory=Counter)
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
                copy = type(thing)()
                copy.CopyFrom(thing)  # a part would keep the whole message
                self.latest[name, number_of] = copy
                if latest is None:
                    known[number_of] = type(thing)()
                    known[number_of].CopyFrom(thing)
                else:
                    extend_thing(known[number_of], thing)

    def _vehicle(self, vehicle: Any, time: float, number: int) -> None:
        name = vehicle.id.value
        if name not in self.names:
            self._meet(vehicle)
        if name not in self.kinds:
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
            self.kinds[name] = KINDS.get(kind, "" if kind in ("UNKNOWN", "OTHER") else kind.lower())
        else:
            self.left_out[kinds.Type.Name(vehicle.type).removeprefix("TYPE_").lower()] += 1

    def recorded(self, notes: list[str]) -> Recorded:
        """All of it, in order."""
        rows = np.frombuffer(self.values, dtype=np.float64).reshape(-1, COLUMNS)
        notes = [*notes, *(f"{count} moving objects of type {kind} left out" for kind, count in self.left_out.items())]
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        new = np.r_[True, (np.diff(rows[:, :2], axis=0) != 0).any(axis=1)] if len(rows) else np.zeros(0, dtype=bool)
        if not new.all():
            notes.append(f"{int((~new).sum())} rows have the time stamp of the row before: left out")
            rows = rows[new]
        same = rows[1:, 0] == rows[:-1, 0]
        if not same.any():
            raise NotEnoughDataError(f"{self.path}: no vehicle in two of {self.messages} messages")
        step = float(np.median(np.diff(rows[:, 1])[same]))
        vehicle, names = self._split(rows, same, step, notes)
        tracks = self._tracks(rows, vehicle, names, step)
        hosts = tuple(self.names.get(host, str(host)) for host in self.hosts)
        if len(hosts) > 1:
            notes.append(f"several host vehicles: {', '.join(hosts)}")
        numbers = {name: str(number) for number, name in self.names.items()}
        return Recorded(tracks, self.things, hosts, numbers, notes)

    def _split(
        self, rows: FloatArray, same: NDArray[np.bool_], step: float, notes: list[str]
    ) -> tuple[IntArray, list[str]]:
        """Track of every row: an identifier that leaps is another vehicle from there on."""
        moved, passed = np.hypot(*np.diff(rows[:, 2:4], axis=0).T), np.diff(rows[:, 1])
        recent = np.fmax(rows[1:, 5], rows[:-1, 5])
        leaps = same & np.isfinite(recent) & (moved > 2.0 * recent * passed + LEAP_DISTANCE)
        vehicle = np.concatenate([[0], np.cumsum(~same | leaps)]).astype(np.int64)
        first = np.flatnonzero(np.r_[True, ~same | leaps])
        names, count = list[str](), Counter[int]()
        for row in first.tolist():
            number = int(rows[row, 0])
            count[number] += 1
            names.append(self.names[number] + (f"#{count[number]}" if count[number] > 1 else ""))
        if leaps.any():
            notes.append(f"{int(leaps.sum())} leaps of a vehicle: another one from there on (NAME#2 ...)")
        return vehicle, names

    def _tracks(self, rows: FloatArray, vehicle: IntArray, names: list[str], step: float) -> Tracks:
        _, time, x, y, yaw, speed, length, pitch, roll, *rear = rows.T
        kinds = np.array([self.kinds[int(number)] for number in rows[:, 0]])
        usual = np.array([USUAL_LENGTH.get(kind, 4.6) for kind in kinds])
        heading = np.where(np.isfinite(yaw), yaw, travel_heading(x, y, vehicle, time, step))
        speed = np.where(np.isfinite(speed), speed, ground_speed(x, y, vehicle, time, step))
        arm = sum(part[:, None] * axis for part, axis in zip(rear, axes(heading, pitch, roll), strict=True))
        length, behind = np.where(np.isfinite(length), length, usual), -rear[0] if rear[0].any() else None
        when, place = (time - float(time.min()), step), (x + arm[:, 0], y + arm[:, 1], heading)
        return Tracks(tuple(names), vehicle, *when, *place, speed, length, kinds, rear=behind)


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
    beyond = []
    for point in points:
        at = place(point)
        if ((at.x - end.x) * dx + (at.y - end.y) * dy) / size <= BEYOND_END:
            break
        beyond.append(point)
    return beyond
