"""Tables of tracks, whatever their headers: vehicle, time, x, y, and what else there is."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray, rate
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.vehicle_classes import ON_ROADS
from xosc_lateral.drivers.drives.cleaning import MAX_MEDIAN_SPEED
from xosc_lateral.drivers.drives.evidence import of_clock
from xosc_lateral.drivers.drives.identity import LONGEST_GAP, identify
from xosc_lateral.extras.recordings import evidence
from xosc_lateral.extras.recordings.cuts import MOVING_SPEED, require_headings
from xosc_lateral.files.columns import (
    as_word,
    chosen_rows,
    epoch_factor,
    listed,
    no_time,
    numbers_of,
    seconds_of_stamps,
)
from xosc_lateral.files.mapping import (
    COMPASS,
    UNITS,
    ColumnSource,
    MappingLike,
    TableMapping,
    as_mapping,
    standard_sources,
)
from xosc_lateral.files.output_tables import RECOGNISED_BY
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import foreign_errors, read_table, unpacked_text

HEADERS: Mapping[str, tuple[str, ...]] = {
    "recording": (
        *("recording", "recording_id", "case_id", "scenario_id", "scene_id", "sequence_id", "log_id", "location"),
        *("episode_id", "run_index", "run_id"),
    ),
    "vehicle": ("vehicle", "id", "track_id", "vehicle_id", "object_id", "agent_id", "car_id", "track", "drive"),
    "time": ("time", "timestamp", "t", "global_time", "timestamp_seconds", "sim_time"),
    "x": ("x", "x_center", "center_x", "easting", "center_easting", "pos_x", "position_x", "car_center_x", "global_x"),
    "y": (
        "y",
        "y_center",
        "center_y",
        "northing",
        "center_northing",
        "pos_y",
        "position_y",
        "car_center_y",
        "global_y",
    ),
    "heading": ("heading", "yaw", "psi", "psi_rad", "orientation"),
    "speed": ("speed", "velocity", "v", "v_vel"),
    "vx": ("vx", "velocity_x", "x_velocity"),
    "vy": ("vy", "velocity_y", "y_velocity"),
    "length": ("length", "vehicle_length", "dimension_length", "v_length"),
    "width": ("width", "vehicle_width", "dimension_width", "v_width"),
    "rear": ("rear",),
    "vehicle_class": ("vehicle_class", "class", "type", "agent_type", "object_type", "vehicle_type", "object_category"),
}
"""Name -> headers that are understood, as `plain_header` has them, the first that is there; others by the map."""

USUAL_LENGTH = {"truck": 16.5, "bus": 12.0, "trailer": 12.0, "motorcycle": 2.2, "motorbike": 2.2}
"""Where no length is given; 4.6 m for the rest (EU new cars, 2023: mean 4.4 m). [m]"""

BEHIND_MIDDLE = {"centre": 0.0, "front": -0.5, "rear": 0.5, "rear axle": 0.3}
"""How far a point that recordings refer to lies behind a vehicle's middle, as a share of its length. [-]"""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Rows sorted by vehicle and time; each array of shape (n,), in m, s, rad, m/s."""

    names: tuple[str, ...]
    vehicle: IntArray
    time: FloatArray
    step: float
    x: FloatArray
    y: FloatArray
    heading: FloatArray
    speed: FloatArray
    length: FloatArray
    kind: NDArray[Any]  # words
    width: FloatArray | None = None
    is_reference: bool = False  # positions are those of the reference point, as `play` writes them, not of the middle
    rear: FloatArray | None = None  # how far x and y lie behind the vehicle's middle; None: they are the middle [m]
    height: FloatArray | None = None
    recording: IntArray | None = None  # number of the recording that each row is of; None: all of one
    recordings: tuple[str, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)  # reason -> rows of the source that are not here
    notes: tuple[str, ...] = ()

    def clock(self) -> FloatArray:
        """Times at which those of two recordings don't meet, shape (n,). [s]"""
        return self.time if self.recording is None else apart_in_time(self.time, self.recording, self.step)

    def of_recording(self, wanted: str | None, path: Path) -> list[Tracks]:
        """Each recording alone, or the one that is wanted. Raises `FormatError`: there is none such."""
        if wanted is not None and wanted not in self.recordings:
            raise FormatError(f"no recording {wanted!r}; there are {listed(self.recordings) or 'none'}", path=path)
        if self.recording is None or len(self.recordings) < 2:
            return [self]
        made = []
        for number, label in enumerate(self.recordings):
            mine = np.flatnonzero(self.recording == number)
            if len(mine) and wanted in (None, label):
                numbers, vehicle = np.unique(self.vehicle[mine], return_inverse=True)
                names = tuple(self.names[k] for k in numbers.tolist())
                alone = self.rows(mine)
                made.append(replace(alone, names=names, vehicle=vehicle, recording=None, recordings=(label,)))
        return made

    def rows(self, rows: IntArray) -> Tracks:
        """Some rows, of vehicles of the same numbers."""
        arrays: dict[str, Any] = {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}
        return replace(self, **{name: values[rows] for name, values in arrays.items()})


USUAL_SPEEDS = 5.0, 60.0  # of moving traffic in the median, towns to motorways [m/s]
MAX_SPEED_RATIO = 1.39  # a speed off by more is in another unit: root of the nearest, knots, 1.94 times as many [-]
LEAST_FRAME_RATE, FRAME_RATE_AGREED = 5, 0.1  # slower, and 3.6, 3.28 or 2.24, are units of speed [1/s], [-]
SPEED_WINDOW = 0.4  # positions are differenced over this where no speed was recorded [s]


def apart_in_time(time: FloatArray, recording: IntArray, step: float) -> FloatArray:
    """Times at which nobody of one recording meets somebody of another, shape (n,). [s]"""
    if not recording.any():
        return time
    clock, at = np.empty(len(time)), 0.0
    for number in np.unique(recording):
        mine = recording == number
        begin = float(time[mine].min())
        clock[mine] = time[mine] - begin + at
        at = step * np.ceil((float(clock[mine].max()) + 10.0 * LONGEST_GAP) / step)
    return clock


def travelled(x: FloatArray, y: FloatArray, vehicle: IntArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Heading [rad] and speed [m/s] from positions, shape (n,)."""
    vx, vy = (rate(each, time, SPEED_WINDOW, whose=vehicle) for each in (x, y))
    return np.arctan2(vy, vx), np.hypot(vx, vy)


def read_tracks(path: Path, columns: MappingLike | None = None) -> Tracks:
    """Read a table of tracks. `columns`: ``NAME=COLUMN[:UNIT]`` for other headers and units than usual."""
    saved = as_mapping(columns)
    if path.is_dir():
        return tracks_of(read_table(path, saved), path, saved)
    with open_source(path) as source:
        is_log = unpacked_text(source).read(len(LOG_BEGINNING)) == LOG_BEGINNING
    # no name holds the table: it goes as soon as its columns are taken
    return tracks_of(read_esmini_log(path) if is_log else read_table(path, saved), path, saved, is_log=is_log)


def tracks_of(table: pd.DataFrame, path: Path, saved: TableMapping, *, is_log: bool = False) -> Tracks:
    """Tracks of a table that is read; see `read_tracks`. `is_log`: it is one of esmini, whose units are known."""
    is_played = set(map(str, table.columns)) >= set(RECOGNISED_BY)
    if is_played:  # its positions are those of reference points
        table = table.rename(columns={"name": "vehicle", "h": "heading"})
    rows, lost = _columns(table, path, saved)
    del table
    codes, labels = rows.pop("vehicle").factorize(sort=True)
    time = rows.pop("time").to_numpy()
    if (factor := epoch_factor(time)) != 1.0:
        time = time * factor
    is_named = is_log or is_played or "speed" in rows or rows.attrs["names time"]
    if wrong := of_clock(time[np.lexsort((time, codes))], is_named=is_named):  # all that moves would leap
        raise FormatError(wrong, path=path, element="column 'time'")
    kind, usual, recording = np.full(len(time), ""), np.full(len(time), 4.6), None
    if "recording" in rows:
        recording = rows.pop("recording")
    if "vehicle_class" in rows:
        number, words = rows.pop("vehicle_class").factorize()
        kind, usual = (
            np.array(each, dtype=of)[number]  # words as objects: eight bytes a row, however long they are
            for each, of in ((list(words), object), ([USUAL_LENGTH.get(word, 4.6) for word in words], None))
        )
    more: dict[str, Any] = {name: rows.pop(name).to_numpy() for name in list(rows.columns)}
    velocity = more.pop("vx", None), more.pop("vy", None)  # along which axes, only their hypotenuse does not ask
    if "speed" not in more and velocity[0] is not None and velocity[1] is not None:
        more["speed"] = np.hypot(*velocity)
    if "length" in more:
        usual = np.where(np.isfinite(more["length"]), more["length"], usual)
    if "rear" in more:
        more["rear"] = np.nan_to_num(more["rear"])
    more |= {"time": time, "length": usual, "kind": kind}
    del time, usual, kind
    tracks, _ = tracks_of_rows(
        list(map(str, labels)), codes, more, path, recording=recording, dropped=lost, is_believed=is_played or is_log
    )
    x, y = tracks.x, tracks.y
    if behind := BEHIND_MIDDLE[saved.reference]:
        ahead = behind * tracks.length
        x, y = x + ahead * np.cos(tracks.heading), y + ahead * np.sin(tracks.heading)
    return replace(tracks, time=tracks.time - float(tracks.time.min()), x=x, y=y, is_reference=is_played)


def tracks_of_rows(
    names: Sequence[str], vehicle: IntArray, rows: dict[str, Any], path: Path, *, recording: pd.Series | None = None,
    step: float | None = None, dropped: Mapping[str, int] = MappingProxyType({}), is_believed: bool = True,
) -> tuple[Tracks, IntArray]:  # fmt: skip
    """Tracks of rows in file order, and which row each of theirs is: who is who is asked here, for all formats.

    `rows`: columns of `Tracks`, shape (n,) each: time, x, y, length, kind and what else there is; they are taken out,
    so that there are never two of all.

    Headings and speeds that are not there (NaN) are those of the way; unless they are believed, all have to agree with
    it. Raises `FormatError`, `NotEnoughDataError`.
    """
    known = identify(names, vehicle, rows["time"], rows["x"], rows["y"], recording, path=path)
    order, whose = known.rows, known.vehicle
    is_sorted = len(order) == len(vehicle) and bool((np.diff(order) == 1).all())
    columns = {name: rows.pop(name) if is_sorted else rows.pop(name)[order] for name in list(rows)}
    time, x, y = (columns.pop(name) for name in ("time", "x", "y"))
    if not (same := whose[1:] == whose[:-1]).any():
        raise NotEnoughDataError(f"{path}: no vehicle has two rows")
    step = float(np.median(np.diff(time)[same])) if step is None else step
    way, driven = travelled(x, y, whose, time)
    heading, speed = (
        np.where(np.isfinite(columns[name]), columns.pop(name), otherwise) if name in columns else otherwise
        for name, otherwise in (("heading", way), ("speed", driven))
    )
    speed = np.abs(speed)
    if not is_believed:
        require_headings(heading, way, driven, path)
        _require_speed(speed, driven, path, counts=bool((time == np.round(time)).all()))
        if wrong := evidence.of_sizes(columns["length"], columns.get("width")):
            raise FormatError(wrong, path=path, element="columns 'length', 'width'")
    clock, ahead = apart_in_time(time, known.recording, step), np.nan_to_num(columns.get("rear", np.zeros(len(x))))
    middle = x + ahead * np.cos(heading), y + ahead * np.sin(heading)
    notes = evidence.of_vehicles(
        known.names, whose, clock, *middle, heading, columns["length"], columns.get("width"), step
    )
    tracks = Tracks(
        known.names, whose, time, step, x, y, heading, speed, recordings=known.recordings,
        recording=known.recording if len(known.recordings) > 1 else None,
        dropped={**dropped, **known.dropped}, notes=(*known.notes, *notes), **columns,
    )  # fmt: skip
    return tracks, order


def _require_speed(speed: FloatArray, driven: FloatArray, path: Path, *, counts: bool) -> None:
    """Refuse speeds that are not those of x and y; `counts`: times are whole numbers. [m/s]"""
    moving = (np.maximum(driven, speed) > MOVING_SPEED) & (np.minimum(driven, speed) > 0.0)
    places = {f"x and y may be in {unit} (x=COLUMN:{unit}, y=COLUMN:{unit})": by
              for unit, by in (("ft", 0.3048), ("cm", 1e-2), ("mm", 1e-3))}  # fmt: skip
    if moving.any() and (usual := float(np.median(driven[moving]))) > MAX_MEDIAN_SPEED and (speed == driven).all():
        causes = [cause for cause, by in places.items() if USUAL_SPEEDS[0] < usual * by < USUAL_SPEEDS[1]]
        causes += ["time in min (time=COLUMN:min)"] * (USUAL_SPEEDS[0] < usual / 60.0 < USUAL_SPEEDS[1])
        raise FormatError(f"traffic moves at {usual:.4g} m/s: {', or '.join(causes) or 'a unit is wrong'}", path=path)
    ratio = float(np.median(speed[moving] / driven[moving])) if moving.any() else 1.0
    if 1.0 / MAX_SPEED_RATIO <= ratio <= MAX_SPEED_RATIO:
        return
    if (frames := round(ratio)) >= LEAST_FRAME_RATE and abs(ratio / frames - 1.0) < FRAME_RATE_AGREED and counts:
        what = f"speed is {ratio:.3g} times as fast as x and y move; time may count frames: time=COLUMN:1/{frames} s"
        raise FormatError(what, path=path)
    factors = {"x and y may be in km (x=COLUMN:km, y=COLUMN:km), or time in ms": 1e3,
               "time may be in min: time=COLUMN:min": 1.0 / 60.0, **places}  # fmt: skip
    for cause, factor in factors.items():
        if abs(np.log(ratio / factor)) < np.log(MAX_SPEED_RATIO):
            raise FormatError(f"speed is {ratio:.3g} times as fast as x and y move; {cause}", path=path)
    units = {unit: abs(np.log(ratio * by)) for unit, (kind, by) in UNITS.items() if kind == "speed"}
    unit = min(units, key=lambda name: units[name])
    close = units[unit] < np.log(MAX_SPEED_RATIO) and unit != "m/s"
    cause = f"it may be in {unit}: speed=COLUMN:{unit}" if close else "or time, x or y are in another unit"
    raise FormatError(f"is {ratio:.3g} times as fast as x and y move; {cause}", path=path, element="column 'speed'")


def _columns(table: pd.DataFrame, path: Path, saved: TableMapping) -> tuple[pd.DataFrame, dict[str, int]]:
    """Columns under their names, and the rows that are not in them by reason."""
    mapping = dict(saved.columns)
    if "class" in mapping:
        mapping["vehicle_class"] = mapping.pop("class")
    if unknown := mapping.keys() - HEADERS.keys():
        raise FormatError(f"--map {min(unknown)}: tracks have {', '.join(HEADERS)}", path=path)
    by_name = standard_sources(table.columns, HEADERS, path)
    columns: dict[str, pd.Series] = {}
    clock = mapping.get("time", by_name.get("time", ColumnSource("time"))).column
    read, table = len(table), chosen_rows(table, saved.missing, saved.rows, path, clock)
    for name in HEADERS:
        source = mapping.get(name, by_name.get(name))
        if source is None or source.column not in table.columns:
            if name in mapping or name in ("vehicle", "time", "x", "y"):
                what = f"no column {repr(name) if source is None else source.column}"
                advice = no_time(table.columns if name == "time" else (), f"--map {name}=COLUMN")
                what = f"{what}; there are {listed(table.columns)} (translate with {advice})"
                raise FormatError(what, path=path, line=1)
            continue
        column = table[source.column]
        if name == "vehicle":
            columns[name] = column
        elif name in ("recording", "vehicle_class"):
            codes, labels = column.factorize(use_na_sentinel=False)
            label = pd.Series(labels, name=column.name)
            named = saved.class_names(label, path) if name == "vehicle_class" else label.map(as_word)
            columns[name] = named.astype("category").take(codes).set_axis(column.index)
        else:
            stamps = None
            if name == "time" and not pd.api.types.is_numeric_dtype(column):
                stamps = seconds_of_stamps(column, path, saved.time_zone, columns["vehicle"])
            numbers = numbers_of(column, path, name) * source.factor if stamps is None else stamps
            numbers += 0.5 * np.pi * (source.unit == COMPASS)
            numbers[np.isinf(numbers)] = np.nan
            columns[name] = pd.Series(numbers, index=column.index)
    every = pd.DataFrame(columns, copy=False)
    every.attrs["names time"] = bool(mapping.get("time", by_name.get("time", ColumnSource("time"))).unit)
    placed = np.asarray(every[["vehicle", "time", "x", "y"]].notna().to_numpy().all(axis=1))
    made = every if placed.all() else every.loc[placed]
    lost = {"not chosen": read - len(every), "no place or time": len(every) - len(made)}
    if "vehicle_class" in made:
        for word, rows in made["vehicle_class"].value_counts().items():
            lost |= {} if word in ON_ROADS or not word else {str(word): int(rows)}
        is_known = made["vehicle_class"].isin([*ON_ROADS, ""]).to_numpy()
        made = made if is_known.all() else made.loc[is_known]
    return made, {reason: count for reason, count in lost.items() if count}


# ---- logs of esmini --------------------------------------------------------------------------------------------------
LOG_BEGINNING = b"esmini "  # of the lines before the table, which name the player's version
TABLE_HEAD = "Index [-]"
MOST_LINES = 50  # before the table's head; a player writes seven

_LOGGED = {
    "vehicle": "Entity_Name",
    "x": "World_Position_X",
    "y": "World_Position_Y",
    "heading": "World_Heading_Angle",
    "speed": "Current_Speed",
    "length": "bb_length",
    "width": "bb_width",
    "rear": "bb_x",
}
"""Column of a table of tracks -> the log's. Positions are those of the rear axle, `bb_x` behind the box's middle."""

_NAME = re.compile(r"\s*#(\d+)\s+(\w+)")


def read_esmini_log(path: Path) -> pd.DataFrame:
    """Columns of `_LOGGED` and `time`, one vehicle below the other: a line has a group of columns for each."""
    with open_source(path) as source, foreign_errors(path, "can't be read as a log of esmini"):
        text = unpacked_text(source)
        head = (text.readline().decode("utf-8", "replace") for _ in range(MOST_LINES))
        names = next((line.rstrip().rstrip(",").split(",") for line in head if line.startswith(TABLE_HEAD)), None)
        if names is None:
            raise FormatError(f"a log of esmini without a line that begins with '{TABLE_HEAD}'", path=path)
        lines = text.read()
        width = max((line.count(b",") + 1 for line in lines.splitlines()), default=len(names))
        table = pd.read_csv(BytesIO(lines), header=None, names=range(width), skipinitialspace=True, index_col=False)
    matches = [_NAME.match(name) for name in names]
    group = {match[2]: column for column, match in enumerate(matches) if match is not None and match[1] == "1"}
    if not group:
        raise FormatError("no vehicle in the table's head", path=path)
    if missing := sorted(set(_LOGGED.values()) - group.keys()):
        raise FormatError(f"vehicle #1: no column {missing[0]}", path=path)
    frames = []
    for shift in range(0, width - max(group.values()), len(group)):
        frame = pd.DataFrame({name: table[group[theirs] + shift] for name, theirs in _LOGGED.items()})
        frames.append(frame.assign(time=table[1]).dropna(subset=["vehicle"]))  # fewer vehicles: empty
    rows = pd.concat(frames).sort_index(kind="stable")  # line by line: a vehicle's columns change
    rows["vehicle"] = rows["vehicle"].astype(str).str.strip()
    return rows
