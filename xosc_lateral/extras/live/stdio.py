"""Drivers over a pipe: one line of JSON in, one out, for benches in any language; `docs/schemas/live.json` has both."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.limits import LIVE_LINE, LIVE_RANGES
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.moment import Moves, OpenDriveRoads, Places
from xosc_lateral.extras.live.traffic import Moment, Traffic
from xosc_lateral.files.json_text import refuse_depth
from xosc_lateral.files.opendrive.reader import read_opendrive

USUAL_SIZE = {"length": 4.6, "width": 1.9, "center_x": 1.4}
"""Of a vehicle that nobody knows the size of: a usual car's, from its rear axle. [m]"""

_PLACE_KEYS = ("road", "lane", "s")

_VEHICLE_KEYS = (*_PLACE_KEYS, *USUAL_SIZE, "speed", "lane_width", "offset", "base", "following", "driven", "is_truck")
"""What a line says of a vehicle beside its context."""


def lines_of(file: BinaryIO) -> Iterator[bytes]:
    """Lines of a pipe; of one that is longer than any may be, its beginning."""
    while line := file.readline(LIVE_LINE.bytes + 1):
        yield line
        while not line.endswith(b"\n") and line:
            line = file.readline(LIVE_LINE.bytes + 1)


class Pipe:
    """Answers line by line; with a `road` (OpenDRIVE) vehicles say `road`, `lane` and `s`, and see each other there."""

    def __init__(self, profile: DriverProfile, *, seed: int = 0, road: str | Path | None = None) -> None:
        self.network = None if road is None else read_opendrive(road)
        roads = None if self.network is None else OpenDriveRoads(self.network)
        left_hand = self.network is not None and any(one.rule == "LHT" for one in self.network.roads)
        self.traffic = Traffic(profile, seed=seed, roads=roads, left_hand=left_hand)
        self._known = (set(CONTEXT_UNITS) | set(profile.columns)) - set(_VEHICLE_KEYS)
        self._columns: set[str] = set()

    def answers(self, lines: Iterable[str | bytes]) -> Iterator[str]:
        """One line for each; what can't be used is answered by an `error`, and the next line goes on."""
        for line in lines:
            if line.strip():
                try:
                    yield json.dumps(self.answer(line), allow_nan=False)
                except SimulationError as error:
                    yield json.dumps({"error": " ".join(str(error).split())})

    def answer(self, line: str | bytes) -> dict[str, Any]:
        """To one line.

        Raises `SimulationError`: if it can't be used; nothing has changed then.
        """
        if len(line) > LIVE_LINE.bytes:
            raise SimulationError(LIVE_LINE.refusal(len(line) / 1e6))
        try:
            text = line if isinstance(line, str) else line.decode()
            refuse_depth(text)
            message = json.loads(text)
            if "\\u" in text:
                json.dumps(message, ensure_ascii=False).encode()  # half a letter is none
        except ValueError as error:
            raise SimulationError(f"no JSON: {error}") from error
        if not isinstance(message, dict):
            raise SimulationError("a line has to be a JSON object")
        if unknown := message.keys() - {"time", "vehicles", "save", "restore"}:
            raise SimulationError(f"unknown: {min(unknown)!r}; a line says time and vehicles, save, or restore")
        if "save" in message:
            return {"state": self.traffic.to_dict()}
        if "restore" in message:
            self.traffic.restore(message["restore"])
            return {"restored": len(self.traffic)}
        vehicles = message.get("vehicles")
        if not isinstance(vehicles, dict) or not all(isinstance(values, dict) for values in vehicles.values()):
            raise SimulationError("`vehicles` has to be an object of objects, by name")
        columns = self._columns.union(*vehicles.values()) & self._known
        moves = self.traffic.step(_number(message, "time", "the line"), self._moment(vehicles, columns))
        self._columns = columns
        rows = zip(*(column.tolist() for column in moves), strict=True)
        answers: dict[str, dict[str, Any]] = {
            name: dict(zip(Moves._fields, row, strict=True)) for name, row in zip(vehicles, rows, strict=True)
        }
        for name in self.traffic.faults.keys() & answers.keys():
            answers[name]["fault"] = self.traffic.faults[name]
        return {"time": message["time"], "vehicles": answers}

    def _moment(self, vehicles: Mapping[str, Mapping[str, Any]], columns: set[str]) -> Moment:
        seen = [(f"vehicle {name!r}", values) for name, values in vehicles.items()]
        for vehicle, values in seen:
            if unknown := values.keys() - self._known - set(_VEHICLE_KEYS):
                raise SimulationError(f"{vehicle}: unknown column {min(unknown)!r}; see docs/schemas/live.json")
        placed = self.network is not None and all(all(key in values for key in _PLACE_KEYS) for _, values in seen)
        places = self._places(seen) if placed else None
        if self.network is not None and not placed and seen:
            raise SimulationError(f"with a road, every vehicle says {', '.join(_PLACE_KEYS)}")
        width = _numbers(seen, "lane_width", 0.0 if placed else None)
        if places is not None and self.network is not None:
            on = places.road >= 0
            width[on] = self.network.lane_width(places.road[on], places.lane[on], places.s[on])
            width[~on] = 1.0
        return Moment(
            tuple(vehicles),
            _numbers(seen, "speed"),
            width,
            _numbers(seen, "offset", 0.0),
            _flags(seen, "following", True) & (True if places is None else places.road >= 0),
            _flags(seen, "driven", True),
            _flags(seen, "is_truck", False),
            base=_numbers(seen, "base", 0.0),
            context={name: _numbers(seen, name, float("nan")) for name in columns},
            places=places,
        )  # fmt: skip

    def _places(self, seen: _Seen) -> Places:
        assert self.network is not None
        roads = {name: index for index, name in enumerate(self.network.road_ids)}
        for vehicle, values in seen:
            if isinstance(values["road"], bool) or not isinstance(values["road"], str | int):
                raise SimulationError(f"{vehicle}: road is {json.dumps(values['road'])[:40]}, expected an id")
            if not _number(values, "lane", vehicle).is_integer():
                raise SimulationError(f"{vehicle}: lane is {values['lane']}, expected a whole number")
        road = np.array([roads.get(str(values["road"]), -1) for _, values in seen], dtype=np.int64)
        lane = np.array([int(values["lane"]) for _, values in seen], dtype=np.int64)
        s, offset = (_numbers(seen, key, 0.0) for key in ("s", "offset"))
        for row in range(len(seen)):
            if road[row] >= 0 and not self.network.has_lane_at(int(road[row]), int(lane[row]), float(s[row])):
                road[row] = -1
        on, pose = road >= 0, np.zeros((3, len(seen)))
        pose[0, ~on] = 1e9  # beyond everybody's sight
        if on.any():
            poses = self.network.lane_to_world(road[on], lane[on], s[on], offset[on])
            centre = self.network.lane_to_world(road[on], lane[on], s[on])
            pose[:, on] = poses.x, poses.y, centre.heading
        length, width, center_x = (_numbers(seen, key, usual) for key, usual in USUAL_SIZE.items())
        return Places(pose[0], pose[1], pose[2], road, lane, s, length, width, center_x)


_Seen = list[tuple[str, Mapping[str, Any]]]
"""Vehicles, as messages name them, and what a line says of them."""


def _numbers(seen: _Seen, name: str, missing: float | None = None) -> FloatArray:
    return np.array([_number(values, name, vehicle, missing) for vehicle, values in seen])


def _number(values: Mapping[str, Any], name: str, vehicle: str, missing: float | None = None) -> float:
    value = values.get(name, missing)
    if value is None and name in values and name in CONTEXT_UNITS and name not in ("speed", "lane_width"):
        return float("nan")  # JSON's way to say that there is none
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SimulationError(f"{vehicle}: {name} is {json.dumps(value)[:40]}, expected a number")
    believed = LIVE_RANGES.get(name)
    if believed is not None and not believed.low <= value <= believed.high:
        raise SimulationError(f"{vehicle}: {name} {value!s:.40} is not within [{believed.low:g}, {believed.high:g}]")
    try:
        return float(value)
    except OverflowError as error:
        raise SimulationError(f"{vehicle}: {name} is a number of {len(str(value))} digits") from error


def _flags(seen: _Seen, name: str, usual: bool) -> BoolArray:
    for vehicle, values in seen:
        if not isinstance(value := values.get(name, usual), bool):
            raise SimulationError(f"{vehicle}: {name} is {json.dumps(value)[:40]}, expected true or false")
    return np.array([values.get(name, usual) for _, values in seen], dtype=np.bool_)
