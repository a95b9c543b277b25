"""OpenACC, AstaZero campaign (Joint Research Centre of the European Commission): cars of a platoon on a closed loop.

Files have a column `Time`, and for each car k `Speed{k}`, `E{k}`, `N{k}`; `IVS{k}` is the gap from car k to the next
one, bumper to bumper. Positions are those of differential GNSS (OxTS RT-Range S), with noise of about 1 mm. There is no
lane geometry: the lane's centre is the mean path of all passes of all files, so that the mean over all of them is 0 by
construction, and each drive's own mean is kept.

- The centre line follows the mean path by a Gaussian of 12 m, in rounds: what all passes share at any length becomes
  the lane, what a pass adds is movement. A loop that is closed badly would raise the power at 0.5 Hz tenfold, so lines
  are periodic from the first round on.
- The width of the lane is not measured: 3.5 m is assumed.

References
----------
.. [1] M. Makridis, K. Mattas, A. Anesiadou, B. Ciuffo, "OpenACC. An open database of car-following experiments to study
       the properties of commercial ACC systems", Transportation Research Part C 125, 2021, 103047.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, true_slices
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import interpolate, pd, spatial
from xosc_lateral.base.track import Track
from xosc_lateral.drivers.drives.cleaning import RESOLUTION, RUN, VALID_BELOW
from xosc_lateral.drivers.drives.identity import identify
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, importer, paths_of
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import unpacked_text
from xosc_lateral.workflows.options import flag

LICENCE = (
    "OpenACC, AstaZero campaign: (c) European Union, Joint Research Centre, CC BY 4.0 (doi:10.1016/j.trc.2021.103047). "
    "No tracks are passed on with a profile, only fitted parameters."
)
LANE_WIDTH = 3.5  # assumed: usual on rural roads; the campaign gives none [m]
HIGHEST_FREQUENCY = 1.5  # runs at 5 Hz keep what is slower; noise there (2e-8 m2/Hz) is a tenth of the movement [Hz]
POSITION_RESOLUTION = 1e-3  # noise of the positions [m]
GRID_STEP = 1.0  # points of the centre line are so far apart [m]
SMOOTHING_LENGTH, ROUNDS = 12.0, 5  # Gaussian by which the centre line follows the mean path [m], and how often
RETURN_DISTANCE = 5.0  # a lap is over where a car is as near to where it began [m] ...
PLACING_STEPS = 4  # of the search for the point of a line abreast: each leaves less than a tenth of the last [-]
MINIMUM_LAP = 500.0  # ... and has come so far since [m]
MINIMUM_SPEED = 5.0  # slower rows (standing start, end of a test) say nothing about the lane's centre [m/s]
LANE_SHARE = 0.5  # of the lane's width: rows further from its centre are elsewhere [-]
MAXIMUM_STEP = 0.25  # rows further apart in time are no longer one run [s]
FROZEN_TIME = 10.0
"""A speed of a moving car that stands to the last digit for so long is none that was measured: in some recordings of
the campaigns it does for minutes, the engine's too; measured ones here repeat for 1.6 s at most. [s]"""

HEADER_LINES = 50  # lines before the header, at most: the campaign's files have five [-]


@importer
def import_openacc(
    source: Path | Sequence[Path],
    *,
    lane_width: Annotated[float, flag(help="Of the road, which the files don't give. [m]", min=2, max=6)] = LANE_WIDTH,
) -> ImportedDrives:
    """OpenACC's platoons on the closed loop of AstaZero: lane centre from all passes of all files."""
    paths = paths_of(source)
    dropped, leaps = Counter[str](), list[str]()
    cars = [car for path in paths for car in _cars(path, dropped, leaps)]
    if not cars:
        raise NotEnoughDataError(f"{paths[0]}: no car moves")
    frames = []
    for side in (1.0, -1.0):  # counter-clockwise, clockwise: two lanes
        if same := [car for car in cars if _turn(car) == side]:
            frames += _placed(same, _centre_line(same), lane_width)
    table = pd.concat(frames, ignore_index=True)
    note = "lane centre: mean path of all passes; lane width assumed; steering by hand assumed throughout"
    about: dict[str, Any] = {"format": "openacc", "version": "AstaZero 2019", "licence": LICENCE}
    step = float(np.median(np.diff(cars[0].time)))
    about |= {"settings": {"lane_width": lane_width}, "notes": (note, *leaps), "dropped": dropped}
    return imported(table, sources=paths, step=step, **about)


def _moves(car: Track) -> BoolArray:
    """Rows that say something about the lane, shape (n,)."""
    return np.asarray(car.speed > MINIMUM_SPEED)


def _turn(car: Track) -> float:
    """1 for a loop driven counter-clockwise, else -1."""
    area = float(np.sum(car.x[:-1] * np.diff(car.y) - car.y[:-1] * np.diff(car.x)))
    return 1.0 if area >= 0.0 else -1.0


def _cars(path: Path, dropped: Counter[str], notes: list[str]) -> list[Track]:
    """Those that move; `dropped`, `notes`: of the others' rows, and of what is no car's."""
    with open_source(path) as opened:
        lines = unpacked_text(opened).read().decode("utf-8", "replace").splitlines(keepends=True)
    heads = [k for k, line in enumerate(lines[:HEADER_LINES]) if line.split(",")[0].strip().lower() == "time"]
    if not heads:
        raise FormatError("no header that begins with Time; is this a file of OpenACC?", path=path, line=1)
    frame = pd.read_csv(io.StringIO("".join(lines[heads[0] :])), low_memory=False)
    frame, first = frame.rename(columns=lambda name: str(name).strip()), heads[0] + 1
    numbers = sorted(int(name[1:]) for name in frame.columns if re.fullmatch(r"E\d+", name))
    needed = ["Time", *(f"{name}{k}" for k in numbers for name in ("E", "N", "Speed"))]
    missing = [name for name in needed if name not in frame]
    if missing or not numbers:
        what = f"no column {missing[0] if missing else 'E1'}; is this a file of OpenACC's AstaZero campaign?"
        raise FormatError(what, path=path, line=first)
    gaps = [f"IVS{k}" for k in numbers if f"IVS{k}" in frame]
    values = {name: _numbers(frame[name], path, first) for name in (*needed, *gaps)}
    cars = []
    for k in numbers:
        x, y, speed = (values[f"{name}{k}"] for name in ("E", "N", "Speed"))
        if not (np.isfinite(speed).any() and np.nanmax(speed) > MINIMUM_SPEED):
            dropped["stands"] += len(frame)
            continue
        lead = values.get(f"IVS{k - 1}", np.full(len(frame), np.nan))
        there = np.isfinite(values["Time"]) & np.isfinite(x) & np.isfinite(y) & np.isfinite(speed)
        time, *columns = (column[there] for column in (values["Time"], x, y, speed, lead))
        name = f"{path.name.split('.')[0]}:{k}"
        known = identify([name], np.zeros(len(time), dtype=np.int64), time, columns[0], columns[1], path=path)
        dropped.update({"no place": len(frame) - len(time), **known.dropped})
        notes += known.notes
        parts = (known.rows[known.vehicle == number] for number in range(len(known.names)))
        for called, part in zip(known.names, parts, strict=True):
            driven = {key: column[part] for key, column in zip(("x", "y", "speed", "lead"), columns, strict=True)}
            cars.append(Track(called, time[part], driven, np.empty(0, dtype=np.intp)))
    return cars


def _numbers(column: pd.Series, path: Path, first: int) -> FloatArray:
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64)
    wrong = np.isnan(numbers) & column.notna().to_numpy()
    if wrong.any():
        row = int(np.argmax(wrong))
        what, element = f"no number: {column.iloc[row]!r}", f"column {column.name!r}"
        raise FormatError(what, path=path, line=first + 1 + row, element=element)
    return numbers


@dataclass(frozen=True, eq=False)
class _Loop:
    """A closed line with points about `GRID_STEP` apart, shape (n, 2). [m]"""

    points: FloatArray

    def normals(self) -> FloatArray:
        """To the left at each point, shape (n, 2). [-]"""
        along = np.roll(self.points, -1, axis=0) - np.roll(self.points, 1, axis=0)
        along /= np.hypot(*along.T)[:, None]
        return np.stack([-along[:, 1], along[:, 0]], axis=1)

    def curvature(self) -> FloatArray:
        """At each point, positive to the left, shape (n,). [1/m]"""
        first = 0.5 * (np.roll(self.points, -1, axis=0) - np.roll(self.points, 1, axis=0))
        second = np.roll(self.points, -1, axis=0) - 2.0 * self.points + np.roll(self.points, 1, axis=0)
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return np.asarray(cross / np.hypot(*first.T) ** 3)

    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Index along the points with its fraction, and distance to the left [m], as between two normals."""
        normals, where = self.normals(), np.stack([x, y], axis=1)
        columns = self.points, normals, np.stack([normals[:, 1], -normals[:, 0]], axis=1)
        index: FloatArray = np.asarray(spatial.cKDTree(self.points).query(where)[1], dtype=np.float64)
        for _ in range(PLACING_STEPS):
            centre, _, tangent = _between_points(index, columns)
            index = index + np.einsum("ij,ij->i", where - centre, tangent) / GRID_STEP
        centre, normal, _ = _between_points(index, columns)
        return np.asarray(index % len(self.points)), np.einsum("ij,ij->i", where - centre, normal)


def _between_points(index: FloatArray, columns: Sequence[FloatArray]) -> list[FloatArray]:
    """Periodic cubic interpolation (Catmull-Rom) of columns, shape (n, 2) each."""
    low = np.floor(index).astype(np.int64)
    share = (index - low)[:, None]
    values = []
    for column in columns:
        a, b, c, d = (column[(low + k) % len(column)] for k in (-1, 0, 1, 2))
        cubic = c - a + share * (2 * a - 5 * b + 4 * c - d + share * (3 * (b - c) + d - a))
        values.append(b + 0.5 * share * cubic)
    return values


def _centre_line(cars: Sequence[Track]) -> _Loop:
    loop = _even(_smooth(_first_lap(cars)))
    x, y = (np.concatenate([car.columns[name][_moves(car)] for car in cars]) for name in ("x", "y"))
    for _ in range(ROUNDS):
        index, offset = loop.place(x, y)
        near = np.abs(offset) < LANE_SHARE * LANE_WIDTH
        n = len(loop.points)
        at = np.round(index[near]).astype(np.int64) % n
        sums, counts = (np.bincount(at, each, n).astype(np.float64) for each in (offset[near], np.ones(len(at))))
        shift = _smooth(sums) / np.maximum(_smooth(counts), 1e-9)
        loop = _even(loop.points + shift[:, None] * loop.normals())
    return loop


def _first_lap(cars: Sequence[Track]) -> FloatArray:
    """The first closed lap of the car that goes furthest, shape (n, 2), points `GRID_STEP` apart, its ends met. [m]"""
    car = max(cars, key=lambda car: float(np.hypot(np.diff(car.x), np.diff(car.y)).sum()))
    path = np.stack([car.x, car.y], axis=1)[_moves(car)]
    way = _way(path)
    for begin in range(0, len(path), max(1, len(path) // 100)):  # the very first metres may lie beside the loop
        back = np.hypot(*(path - path[begin]).T)
        returned = np.flatnonzero((way - way[begin] > MINIMUM_LAP) & (back < RETURN_DISTANCE))
        if len(returned):
            end = returned[0] + int(np.argmin(back[returned[0] : returned[0] + 50]))
            closed, at, even = _closed(path[begin:end])
            return np.stack([np.interp(even, at, closed[:, k]) for k in range(2)], axis=1)
    raise NotEnoughDataError(f"{car.name} drives {way[-1]:.0f} m and never comes back to where it was: no closed loop")


def _way(path: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])


def _closed(path: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A line with its beginning at its end, ways along it, and others at even steps of about `GRID_STEP`."""
    closed = np.concatenate([path, path[:1]])
    way = _way(closed)
    return closed, way, np.linspace(0.0, way[-1], round(way[-1] / GRID_STEP) + 1)[:-1]


def _even(points: FloatArray) -> _Loop:
    """With points at even steps again: arc lengths by cubics, so that corners don't get between points."""
    closed, way, even = _closed(points)
    return _Loop(np.asarray(interpolate.CubicSpline(way, closed, bc_type="periodic")(even)))


def _smooth(values: FloatArray) -> FloatArray:
    """Periodic columns through the Gaussian, shape of the values, (n,) or (n, 2)."""
    frequency = np.fft.rfftfreq(len(values), GRID_STEP)
    gain = np.exp(-0.5 * (2.0 * np.pi * SMOOTHING_LENGTH * frequency) ** 2)
    spectrum = np.fft.rfft(values, axis=0)
    return np.asarray(np.fft.irfft((spectrum.T * gain).T, len(values), axis=0))


def standing_speed(time: FloatArray, speed: FloatArray) -> BoolArray:
    """Rows of a moving car whose speed stands for `FROZEN_TIME` or more, shape (n,). [s], [m/s]"""
    frozen = np.zeros(len(speed), dtype=np.bool_)
    for part in true_slices(np.diff(speed) == 0.0):
        if speed[part.start] > MINIMUM_SPEED and time[part.stop] - time[part.start] >= FROZEN_TIME:
            frozen[part.start : part.stop + 1] = True
    return frozen


def _placed(cars: Sequence[Track], loop: _Loop, lane_width: float) -> list[pd.DataFrame]:
    bends = _smooth(loop.curvature())
    frames = []
    for car in cars:
        index, offset = loop.place(car.x, car.y)
        inside = np.abs(offset) <= LANE_SHARE * lane_width
        state = np.where(inside, KEPT_ROWS, "outside the lane")
        new = np.r_[True, (np.diff(car.time) > MAXIMUM_STEP) | (np.diff(inside.astype(np.int8)) != 0)]
        columns = {
            "drive": car.name,
            "time": car.time.round(6),
            "offset": offset.round(5),
            "lane_width": lane_width,
            "speed": car.speed.round(4),
            "curvature": bends[np.floor(index).astype(np.int64) % len(bends)].round(7),
            "lead_distance": np.where(car.columns["lead"] > 0.0, car.columns["lead"], np.nan).round(3),
            VALID_BELOW: HIGHEST_FREQUENCY,
            RESOLUTION: POSITION_RESOLUTION,
            RUN: np.cumsum(new),
            "state": np.where(standing_speed(car.time, car.speed), "speed frozen", state),
        }
        frames.append(pd.DataFrame(columns))
    return frames
