"""Real drives of a phone's camera: what the camera misjudged, what is written, drowsy against normal, the loop.

    python -m laboratory.phone_drives UAH-DRIVESET-v1 --drivers D4 D5 D6 --loop [--write PAGE.md]
    python -m laboratory.phone_drives UAH-DRIVESET-v1 --drivers D1 D2 D3 --sensitivity [--write PAGE.md]

The UAH-DriveSet [1]_ (not redistributed; for non-commercial use): six drivers and cars on a motorway and a secondary
road, as they usually drive, as if aggressive and as if drowsy. Its accelerometer is no input of a fit: it is the
independent measurement that the driver's part of the camera's offsets is held against, between 0.15 Hz, below which
bends and crossfall weigh more, and 0.8 Hz, above which the car shakes.

References
----------
.. [1] E. Romera, L. M. Bergasa, R. Arroyo, "Need data for driver behaviour analysis? Presenting the public
   UAH-DriveSet", IEEE ITSC 2016.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from laboratory.markers import show
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives import markings
from xosc_lateral.drivers.drives.cleaning import RUN
from xosc_lateral.drivers.drives.drive import STEP, Drive, Run, cut_runs
from xosc_lateral.drivers.evaluation.profile_comparison import compare
from xosc_lateral.drivers.fitting.fitting import driver_runs, fit_population, fit_profile
from xosc_lateral.drivers.fitting.sensor import likelihood
from xosc_lateral.drivers.model.plausibility import drivable, strain
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.extras.loop.close import close_loop
from xosc_lateral.files.drives import drives_of_table

FloatArray = NDArray[np.float64]

GRAVITY = 9.81
BAND = (0.15, 0.8)
"""[Hz]"""
TRACKED = 2
"""State of the lane tracker in which it has the lane."""
SHORTEST = 15.0
"""Runs that a filter of the band has settled in. [s]"""
EDGE = 5
"""Samples left out at both ends of a filtered run."""
SELDOM = 0.999
SEEDS = range(3)
SAMPLED = 1200.0
"""[s]"""
LATERAL = 6
"""Column of the filtered acceleration to the side."""


@dataclass(frozen=True, eq=False)
class Trip:
    """One trip's table, and its accelerometer: time [s] and acceleration to the side [m/s2]."""

    name: str
    table: pd.DataFrame
    acceleration: tuple[FloatArray, FloatArray]

    @property
    def drive(self) -> Drive:
        """As any command reads it."""
        return drives_of_table(self.table.copy(), {}, self.name)[0]

    @property
    def recorded(self) -> Drive:
        """As the camera saw it: no marking is mended where an import has cut, but lane changes are looked for."""
        (drive,) = drives_of_table(self.table.assign(**{RUN: 0}), {}, self.name)
        return replace(drive, run=None)


def trips(folder: Path, drivers: Sequence[str]) -> Iterator[Trip]:
    """Trips of these drivers, by name: D1-NORMAL-MOTORWAY, ..."""
    for driver in drivers:
        for path in sorted(path for path in (folder / driver).iterdir() if path.is_dir()):
            yield Trip("-".join(path.name.split("-")[2:]), _table(path), _acceleration(path))


def _rows(path: Path, count: int) -> pd.DataFrame:
    return pd.read_csv(path, sep=r"\s+", header=None, names=list(range(count)), na_values=["-"], on_bad_lines="skip")


def _table(path: Path) -> pd.DataFrame:
    """What a phone tells apart from its inertial sensors: lane, speed, vehicle ahead, map."""
    lane, satellite = _rows(path / "PROC_LANE_DETECTION.txt", 5), _rows(path / "RAW_GPS.txt", 12)
    ahead, road = _rows(path / "PROC_VEHICLE_DETECTION.txt", 5), _rows(path / "PROC_OPENSTREETMAP_DATA.txt", 10)
    lane = lane[lane[4] == TRACKED].drop_duplicates(0)
    time = lane[0].to_numpy(dtype=float)
    distance, limit = _held(time, ahead, 1), _held(time, road, 1)
    return pd.DataFrame(
        {
            "time": time,
            "offset": lane[1].to_numpy(dtype=float),
            "lane_width": lane[3].to_numpy(dtype=float),
            "speed": np.interp(time, satellite[0], satellite[1]) / 3.6,
            "altitude": np.interp(time, satellite[0], satellite[4]),
            "front_distance": np.where(distance < 0.0, np.inf, distance),
            "vehicles": _held(time, ahead, 3),
            "speed_limit": np.where(limit < 0.0, np.nan, limit / 3.6),
            "lanes": _held(time, road, 4),
        }
    )


def _held(time: FloatArray, rows: pd.DataFrame, column: int) -> FloatArray:
    """The last value before each time."""
    values = pd.to_numeric(rows[column], errors="coerce").to_numpy(dtype=float)
    at = np.searchsorted(rows[0].to_numpy(dtype=float), time, side="right") - 1
    return np.asarray(values[np.clip(at, 0, len(values) - 1)])


def _acceleration(path: Path) -> tuple[FloatArray, FloatArray]:
    rows = _rows(path / "RAW_ACCELEROMETERS.txt", 11)
    return rows[0].to_numpy(dtype=float), GRAVITY * rows[LATERAL].to_numpy(dtype=float)


@dataclass(frozen=True)
class Agreement:
    """Lateral acceleration of the driver's part against the phone's, in the band.

    Correlation and ratio of standard deviations [-]; 99.9 % quantiles of both [m/s2].
    """

    correlation: float
    ratio: float
    ours: float
    phone: float


def agreement(drive: Drive, acceleration: tuple[FloatArray, FloatArray]) -> Agreement:
    """Of the driver's part of a drive's runs."""
    runs, _ = driver_runs(cut_runs(drive), [drive])
    pairs = [_in_band(run, acceleration) for run in runs if run.time[-1] - run.time[0] > SHORTEST]
    ours, phone = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    quantiles = [float(np.quantile(np.abs(one), SELDOM)) for one in (ours, phone)]
    return Agreement(float(np.corrcoef(ours, phone)[0, 1]), float(ours.std() / phone.std()), *quantiles)


def _in_band(run: Run, acceleration: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    sections = butter(2, BAND, "bandpass", fs=1.0 / STEP, output="sos")
    moved = np.gradient(np.gradient(run.offset, STEP), STEP)
    both = (moved, np.interp(run.time, *acceleration))
    first, second = (np.asarray(sosfiltfilt(sections, one))[EDGE:-EDGE] for one in both)
    return first, second


def written(profile: DriverProfile, speed: float) -> float:
    """Lateral acceleration that what `convert` writes exceeds in 0.1 % of the time, mean over seeds. [m/s2]"""
    step = profile.model.step
    segment = Segment.even(SAMPLED, step, profile.lane_width, speed)
    paths = [drivable(sample_offsets(profile, segment, seed), step, segment.speed)[0] for seed in SEEDS]
    return float(np.mean([strain(path, step, segment.speed).seldom for path in paths]))


def movement_table(all_trips: Sequence[Trip]) -> str:
    """What was mended, how far that agrees with the accelerometer, and what is written."""
    lines = [
        "| trip | one marking followed | none | r, as recorded | r, mended | size / phone's, as recorded | mended | "
        "99.9 % in the band: ours | phone's | as recorded | written, before | written |",
        "|" + "---|" * 12,
    ]
    numbers = []
    for trip in all_trips:
        drive, recorded = trip.drive, trip.recorded
        before, after = agreement(recorded, trip.acceleration), agreement(drive, trip.acceleration)
        speed = float(np.median(trip.table["speed"]))
        fast = [written(fit_profile([one], name=trip.name), speed) for one in (recorded, drive)]
        shares = (drive.mended.one_marking, drive.mended.no_marking) if drive.mended else (0.0, 0.0)
        row = [*shares, before.correlation, after.correlation, before.ratio, after.ratio]
        row += [after.ours, after.phone, before.ours, *fast]
        numbers.append(row)
        lines.append(_movement_line(trip.name, row))
    lines.append(_movement_line("**median**", np.median(numbers, axis=0).tolist()))
    return "\n".join(lines)


def _movement_line(name: str, row: Sequence[float]) -> str:
    shares = [f"{100 * value:.1f} %" for value in row[:2]]
    return f"| {name} | " + " | ".join([*shares, *(f"{value:.2f}" for value in row[2:])]) + " |"


def profiles_of(trip: Trip) -> list[DriverProfile]:
    """Of all runs of a trip, and of its first and its second half."""
    drive = trip.drive
    runs, sensor = driver_runs(cut_runs(drive), [drive])
    middle = 0.5 * sum(len(run) for run in runs)
    first = np.cumsum([len(run) for run in runs]) <= middle
    parts = ([True] * len(runs), first, ~first) if 0 < first.sum() < len(runs) else ([True] * len(runs),)
    return [
        fit_population([run for run, taken in zip(runs, part, strict=True) if taken], name=trip.name, sensor=sensor)
        for part in parts
    ]


def drowsiness_table(all_trips: Sequence[Trip]) -> str:
    """Distance of drowsy from normal profiles, beside that of two normal trips and of the halves of one."""
    lines = [
        "| driver, road | normal to drowsy | normal to normal, second trip | halves of normal | halves of drowsy |"
    ]
    lines.append("|---|---|---|---|---|")
    known = {trip.name: trip for trip in all_trips}
    for driver in sorted({name.split("-")[0] for name in known}):
        for road in ("MOTORWAY", "SECONDARY"):
            normal = [name for name in sorted(known) if name.startswith(f"{driver}-NORMAL") and name.endswith(road)]
            drowsy = f"{driver}-DROWSY-{road}"
            if normal and drowsy in known:
                lines.append(_drowsiness_line(f"{driver}, {road.lower()}", [known[name] for name in [*normal, drowsy]]))
    return "\n".join(lines)


def _drowsiness_line(name: str, of: Sequence[Trip]) -> str:
    """The last trip is the drowsy one."""
    fitted = [profiles_of(trip) for trip in of]
    distance = compare([one for several in fitted for one in several], 0).distance
    at = np.cumsum([0, *(len(several) for several in fitted)])
    second = distance[at[0], at[1]] if len(of) > 2 else np.nan
    halves = [distance[at[k] + 1, at[k] + 2] if len(fitted[k]) > 1 else np.nan for k in (0, len(of) - 1)]
    values = [distance[at[0], at[len(of) - 1]], second, *halves]
    return f"| {name} | " + " | ".join("" if np.isnan(value) else f"{value:.2f}" for value in values) + " |"


def loop_table(all_trips: Sequence[Trip]) -> str:
    """Findings of the closed loop in each trip, and the held-out error of base and returned profile."""
    lines = ["| trip | found | held-out error before [mm] | after [mm] | after / before |", "|---|---|---|---|---|"]
    for trip in all_trips:
        result = close_loop([trip.drive], seed=1)
        found = "; ".join(one.effect for one in result.findings) or "nothing"
        before, after = 1e3 * result.error_before, 1e3 * result.error_after
        lines.append(f"| {trip.name} | {found} | {before:.1f} | {after:.1f} | {after / before:.3f} |")
    return "\n".join(lines)


CONSTANTS: tuple[tuple[ModuleType, str, tuple[float, ...]], ...] = (
    (markings, "LEAST_NOISE", (0.02, 0.1)),
    (markings, "WIDENING", (1e-4, 1e-3, 3e-3)),
    (markings, "ACCELERATION", (0.005, 0.05, 0.1)),
    (markings, "DEGREES", (2.0, 8.0)),
    (markings, "LEAST_TRUST", (0.05, 0.25)),
    (likelihood, "LEVEL_SD", (0.25, 1.0)),
)
"""Where they are, and what is tried instead."""


def sensitivity_table(all_trips: Sequence[Trip]) -> str:
    """What other constants make of the agreement with the accelerometer, and no second view of the errors."""
    lines = [
        "| constant | mean r | median size / phone's | median 99.9 % in the band, ours [m/s2] |",
        "|---|---|---|---|",
    ]
    lines.append(_sensitivity_line("as recorded", [agreement(trip.recorded, trip.acceleration) for trip in all_trips]))
    lines.append(_sensitivity_line("**as it is**", [agreement(trip.drive, trip.acceleration) for trip in all_trips]))
    blind = [agreement(replace(trip.drive, half_width=None), trip.acceleration) for trip in all_trips]
    lines.append(_sensitivity_line("lane width not asked for the camera's errors", blind))
    for module, name, values in CONSTANTS:
        usual = getattr(module, name)
        for value in values:
            setattr(module, name, value)
            label = f"`{name}` {value:g} (is {usual:g})"
            lines.append(_sensitivity_line(label, [agreement(trip.drive, trip.acceleration) for trip in all_trips]))
        setattr(module, name, usual)
    return "\n".join(lines)


def _sensitivity_line(name: str, found: Sequence[Agreement]) -> str:
    numbers = [np.mean([one.correlation for one in found])]
    numbers += [np.median([getattr(one, what) for one in found]) for what in ("ratio", "ours")]
    return f"| {name} | " + " | ".join(f"{value:.3f}" for value in numbers) + " |"


def main() -> None:
    """Print the tables; write them where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--drivers", nargs="+", default=["D4", "D5", "D6"])
    parser.add_argument("--loop", action="store_true", help="the closed loop as well")
    parser.add_argument("--sensitivity", action="store_true", help="of constants, and nothing else")
    parser.add_argument("--write", type=Path, metavar="PAGE.md")
    args = parser.parse_args()
    every = list(trips(args.folder, args.drivers))
    if args.sensitivity:
        tables = {"markings-sensitivity": sensitivity_table(every)}
    else:
        tables = {"phone-movement": movement_table(every), "phone-drowsy": drowsiness_table(every)}
        tables |= {"phone-loop": loop_table(every)} if args.loop else {}
    for marker, table in tables.items():
        show(table, args.write, marker)


if __name__ == "__main__":
    main()
