"""How well `reconstruct` does: lane changes against another reading of the tracks, residuals, round trips.

    python -m laboratory.reconstruction WHEEL [--part design|test] [--esmini PATH]
    python -m laboratory.reconstruction --round-trip SCENARIO...

WHEEL is `tasi-0.15.4-py3-none-any.whl`. The windows of each part were written down before any was looked at
(docs/design/reconstruction.md): 0-60, 60-120, 120-180 s for design, 180-240, 240-300 s for the test. The other
reading of the tracks knows nothing of the reconstruction: it takes the 20 Hz rows in the import's own coordinates, and
where the lateral position passes between two lanes it looks for the rows before and after at which the lateral speed is
below 0.1 m/s. Who is within a quarter of a lane from its centre at both has changed lanes (others are counted as
neither right nor wrong); begin and end are those of a sinusoid with the same times of 10 and 90 % of the way.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory import agreement
from xosc_lateral.extras.recordings.importers import dlr_ht
from xosc_lateral.extras.recordings.reconstruct import reconstruct_recording
from xosc_lateral.extras.recordings.reconstruction import Reconstruction, drivers_table
from xosc_lateral.extras.recordings.recordings import RecordedTraffic, read_recording
from xosc_lateral.extras.recordings.settings import ReconstructSettings
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import Activity, NominalMotion

FloatArray = NDArray[np.float64]

PARTS = {"design": (0.0, 60.0, 120.0), "test": (180.0, 240.0)}
WINDOW = 60.0
CALM, SETTLED = 0.1, 0.25  # [m/s], of a lane


@dataclass(frozen=True)
class Read:
    """A lane change as read: begin, end and crossing [s], side, and whether both lanes were kept to."""

    begin: float
    end: float
    crossing: float
    side: int
    sure: bool


class OtherReading:
    """Lateral position of every row, counted in lanes: 0 in the middle of the right one, 1 of the left one."""

    def __init__(self, source: Path) -> None:
        table = dlr_ht.read_tracks(source)
        found = dlr_ht.find_lanes(table)
        xy = table[["center_easting", "center_northing"]].to_numpy()
        _, d = found.reference.project(xy, found.s)
        d = np.where(found.forward, d, -d)
        s = np.where(found.forward, found.s, found.reference.length - found.s)
        height = table["dimension_height"].to_numpy()
        self.x = np.zeros(len(table))
        for name, mine in (("northbound", found.forward), ("southbound", ~found.forward)):
            right, left = (one.at(np.clip(s[mine], one.start, one.end), height[mine]) for one in found.lanes[name])
            self.x[mine] = (d[mine] - right) / (left - right)
        self.time, self.name = table["time"].to_numpy(), table["id"].astype(str).to_numpy(dtype=str)

    def changes(self, name: str, begin: float, end: float) -> list[Read]:
        """Of a vehicle whose recorded name ends like this, in a part of time [s]."""
        mine = np.char.endswith(self.name, name) & (self.time >= begin - 1e-6) & (self.time <= end + 1e-6)
        t, x = self.time[mine], self.x[mine]
        x = np.convolve(np.pad(x, 5, mode="edge"), np.ones(11) / 11, "valid")
        rate = np.gradient(x, t) * 3.75
        found = []
        for k in np.flatnonzero(np.diff(x > 0.5)) + 1:
            side = 1 if x[k] > 0.5 else -1
            before, after = np.flatnonzero(side * rate[:k] <= CALM), np.flatnonzero(side * rate[k:] <= CALM)
            a = int(before[-1]) if len(before) else 0
            b = k + int(after[0]) if len(after) else len(t) - 1
            low, high = (0, 1) if side > 0 else (1, 0)
            sure = abs(x[a] - low) <= SETTLED and abs(x[b] - high) <= SETTLED
            u = (x[a : b + 1] - x[a]) / ((x[b] - x[a]) or 1.0)
            t10, t90 = (t[a + int(np.argmax(u >= level))] for level in (0.1, 0.9))
            first = np.arccos(0.8) / np.pi  # share of the duration at which a sinusoid has done 10 %
            whole = (t90 - t10) / (1.0 - 2.0 * first)
            found.append(Read(t10 - first * whole, t90 + first * whole, float(t[k]), side, bool(sure)))
        return found


def lane_changes(made: Reconstruction, other: OtherReading) -> tuple[int, int, int, FloatArray]:
    """Found by both, by the other reading alone, by the reconstruction alone; differences of begin and end [s]."""
    both, missed, extra, ends = 0, 0, 0, list[tuple[float, float]]()
    start = made.recording.start
    for plan in made.plans:
        time = plan.vehicle.time + start
        reading = other.changes(plan.vehicle.name, float(time[0]), float(time[-1]))
        left = list(plan.changes)
        for one in [each for each in reading if each.sure]:
            moment = one.crossing - start
            hit = next((c for c in left if np.sign(c.lanes) == one.side and c.start <= moment <= c.end), None)
            if hit is None:
                missed += 1
                continue
            left.remove(hit)
            both += 1
            begin = max(one.begin, float(time[0]))  # who is seen amid a change has begun it before: nobody can say when
            ends.append((hit.start - (begin - start), hit.end - (one.end - start)))
        unsure = [each.crossing - start for each in reading if not each.sure]
        extra += sum(not any(c.start - 2.0 <= moment <= c.end + 2.0 for moment in unsure) for c in left)
    return both, missed, extra, np.array(ends).reshape(-1, 2)


def window_lines(traffic: RecordedTraffic, other: OtherReading, begins: Sequence[float]) -> list[str]:
    columns = ("window", "vehicles", "lane changes", "precision", "recall", "begin, end within 0.5 s", "within 1 s")
    lines = ["| " + " | ".join((*columns, "along, 95 % [m]", "across in maneuvers, in lane, rms [m]")) + " |"]
    lines.append("|---" * 9 + "|")
    for begin in begins:
        made = reconstruct_recording(traffic, ReconstructSettings(begin=begin, end=begin + WINDOW))
        both, missed, extra, ends = lane_changes(made, other)
        near, nearer = (np.abs(ends) < 1.0).mean(axis=0), (np.abs(ends) < 0.5).mean(axis=0)
        along, across, in_lane = (
            np.concatenate([getattr(plan.residuals, name) for plan in made.plans])
            for name in ("along", "across", "in_lane")
        )
        rms = [float(np.sqrt((across[part] ** 2).mean())) for part in (~in_lane, in_lane)]
        lines.append(
            f"| {begin:g}-{begin + WINDOW:g} s | {len(made.plans)} | {both + extra} | "
            f"{both / max(both + extra, 1):.3f} | "
            f"{both / max(both + missed, 1):.3f} | {nearer[0]:.2f}, {nearer[1]:.2f} | {near[0]:.2f}, {near[1]:.2f} | "
            f"{np.quantile(np.abs(along), 0.95):.2f} | {rms[0]:.2f}, {rms[1]:.2f} |"
        )
    return lines


def write(made: Reconstruction, folder: Path) -> Path:
    """Scenario, road and table of drivers."""
    (folder / made.traffic.road_name).write_bytes(made.traffic.road)
    path = folder / f"{made.traffic.name}.xosc"
    path.write_text(made.scenario, encoding="utf-8")
    drivers_table(made, folder / "drivers.csv")
    return path


def in_other_player(traffic: RecordedTraffic, begin: float, esmini: Path, **settings: bool) -> str:
    """Farthest that any vehicle is from where our player has it, in frames of 0.05 s."""
    agreement.PATIENCE = 1800.0
    with tempfile.TemporaryDirectory() as folder:
        made = reconstruct_recording(traffic, ReconstructSettings(begin=begin, end=begin + WINDOW, **settings))
        scenario = write(made, Path(folder))
        rows = agreement.reference_rows(esmini, scenario, 0.05, WINDOW + 1.0)
        played = play_scenario(scenario, step=0.05)
    shift = played.network.header_offset
    worst, absent = 0.0, 0
    for motion in played.motion.entities:
        mine = rows[rows["name"] == motion.name]
        k = np.round(mine["time"].to_numpy() / 0.05).astype(int)
        inside = k < len(motion.time)
        k, x, y = k[inside], mine["x"].to_numpy()[inside], mine["y"].to_numpy()[inside]
        there = (motion.activity[k] & Activity.ACTIVE) != 0
        away = np.hypot(x - shift.x - motion.x[k], y - shift.y - motion.y[k])[there]
        absent += not len(away)
        worst = max(worst, float(away.max()) if len(away) else 0.0)
    count = len(played.motion.entities)
    return f"{begin:g} s {settings or ''}: {count} vehicles, {absent} absent, at most {worst:.4f} m apart"


def round_trip(scenario: Path) -> str:
    """Played, reconstructed from the states, played again: share of positions within 0.2 m, lateral maneuvers."""
    played = xl.play(scenario)
    road = played._played.scenario.road_file
    with tempfile.TemporaryDirectory() as folder:
        states = played.write(Path(folder) / "states.csv")
        made = xl.reconstruct(states, Path(folder) / "again", road=road)
        again = xl.play(Path(folder) / "again/states.xosc")
    rows, others = played.to_frame(), again.to_frame()
    facts = made.to_dict()
    names = {row["recorded_as"]: row["entity"] for row in facts["vehicles"]}
    worst, away = ("", 1.0), []
    for name, entity in names.items():
        one, other = rows[rows["name"] == name], others[others["name"] == entity]
        both = one.merge(other, on="time", suffixes=("", "_again"))
        near = np.hypot(both["x"] - both["x_again"], both["y"] - both["y_again"]).to_numpy() <= 0.2
        worst = min(worst, (name, float(near.mean())), key=lambda each: each[1])
        away.append(near)
    wanted = {name: word for name in names if (word := _moved(played._played.motion, name))}
    found = dict[str, str]()
    for row in facts["maneuvers"]:
        name = next(name for name, entity in names.items() if entity == row["entity"])
        found[name] = found.get(name, "") + ("c" if row["kind"] == "lane change" else "o")
    within = float(np.concatenate(away).mean())
    good = "yes" if within >= 0.95 and wanted == found else "no"
    left = len(set(rows["name"])) - len(names)
    return (
        f"| {scenario.stem} | {good} | {len(names)} (+{left}) | {within:.3f} | {worst[0]} {worst[1]:.2f} | "
        f"{wanted or ''} | {found or ''} |"
    )


def _moved(motion: NominalMotion, name: str) -> str:
    """Lane changes and offsets of an entity that move it, in order: c and o."""
    entity = next(one for one in motion.entities if one.name == name)
    word = ""
    for one in sorted((each for each in motion.actions if each.actor == name), key=lambda each: each.start):
        kind = type(one.action.content).__name__
        if kind in ("LaneChangeAction", "LaneOffsetAction") and one.path != ("Init",):
            end = motion.end_time if one.end is None else one.end
            first, last = (int(np.searchsorted(entity.time, time - 1e-6)) for time in (one.start, end))
            offset = entity.offset[first : min(last, len(entity.time) - 1) + 1]
            if np.ptp(offset) > 0.02:
                word += "c" if kind == "LaneChangeAction" else "o"
    return word


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path, nargs="?")
    parser.add_argument("--part", choices=list(PARTS), default="design")
    parser.add_argument("--esmini", type=Path)
    parser.add_argument("--round-trip", type=Path, nargs="+", default=[])
    args = parser.parse_args()
    for scenario in args.round_trip:
        try:
            print(round_trip(scenario), flush=True)
        except xl.XoscLateralError as error:
            print(f"| {scenario.stem} | {' '.join(str(error).split())[:150]} | | | | | |", flush=True)
    if args.source is None:
        return
    traffic = read_recording(args.source)
    if args.esmini is not None:
        for settings in ({}, {"relative": True}, {"exact": True}):
            print(in_other_player(traffic, PARTS[args.part][0], args.esmini, **settings), flush=True)
    else:
        print("\n".join(window_lines(traffic, OtherReading(args.source), PARTS[args.part])))


if __name__ == "__main__":
    main()
