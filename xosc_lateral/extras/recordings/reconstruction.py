"""What `reconstruct` gives: a scenario with its road and drivers, and in numbers how near it is to the recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note, notes
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.recordings.encounters import Encounter, Triggers
from xosc_lateral.extras.recordings.plan import VehiclePlan
from xosc_lateral.extras.recordings.recorded import Recording
from xosc_lateral.extras.recordings.recordings import RecordedTraffic
from xosc_lateral.files.output_paths import claim, output_folder
from xosc_lateral.files.output_tables import write_frame
from xosc_lateral.files.profiles import profile_bytes
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.result import PathLike, Result

NAMED_RESIDUAL = 1.0  # a position off by more is named as not expressed, across beside the lane's own spread [m]


@dataclass(frozen=True, slots=True)
class ChosenDriver:
    """Who drives an entity in a twin."""

    profile: str  # name of the profile; empty: too little was seen, or nobody drove it: no profile of its own
    seconds: float  # of road-following that this rests on [s]
    gain: float  # log likelihood beyond the population's [nat]
    why: str


@dataclass(eq=False, repr=False, slots=True)
class Reconstruction(Result):
    """A scenario with its road and drivers, and how near it is to the recording."""

    traffic: RecordedTraffic
    recording: Recording
    plans: tuple[VehiclePlan, ...]
    scenario: str  # the OpenSCENARIO document
    encounters: tuple[Encounter, ...]
    relative: Mapping[str, Triggers]  # by entity, triggers that are distances
    drivers: tuple[ChosenDriver, ...]  # in the order of the plans
    fitted: Mapping[str, DriverProfile]  # by name, profiles of single vehicles
    host: str | None  # entity that is the vehicle under test
    outputs: tuple[Path, ...] = ()  # files that were written

    @property
    def name(self) -> str:
        """Of the files, without suffix."""
        return self.traffic.name

    @property
    def messages(self) -> tuple[Note, ...]:
        """What the scenario does not say of the recording."""
        return notes([*self.traffic.notes, *not_expressed(self.plans, self.recording.left_out)])

    @property
    def left_out(self) -> tuple[str, ...]:
        """Vehicles, and parts of them, that are not in the scenario: a line each, with the reason."""
        return self.recording.left_out

    @property
    def files(self) -> tuple[Path, ...]:
        """Inputs that are files."""
        return tuple(path for path in self.traffic.sources if path.is_file())

    def headline(self) -> str:
        """One line."""
        return str(self).splitlines()[0]

    def __str__(self) -> str:
        return as_text(self.to_dict())

    def to_frame(self) -> pd.DataFrame:
        """One row per vehicle: when it is there, its maneuvers, residuals and driver."""
        return pd.DataFrame(self.to_dict()["vehicles"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them and the report holds them."""
        outputs = [str(path) for path in self.outputs]
        return facts_of(self) | {"outputs": outputs, "messages": self.message_records()}

    def write(self, folder: PathLike, *, force: bool = False) -> tuple[Path, ...]:  # type: ignore[override]
        """Write NAME.xosc and its road, drivers.csv for `convert`, report.html and report.json, all or none.

        Returns
        -------
        tuple of Path
        """
        from xosc_lateral.extras.recordings.page import page_of
        from xosc_lateral.files.atomic import together, write_atomically
        from xosc_lateral.files.json_text import canonical_json

        place, facts = output_folder(folder), facts_of(self)
        files: dict[str, bytes | str] = {
            self.traffic.road_name: self.traffic.road,
            f"{self.name}.xosc": self.scenario,
            **{f"drivers/{name}.json": profile_bytes(profile) for name, profile in self.fitted.items()},
            "report.html": page_of(facts, self.plans, self.traffic.network),
            "report.json": canonical_json(facts),
        }
        table, paths = place / "drivers.csv", {place / name: data for name, data in files.items()}
        kept = {path.resolve() for path in self.traffic.sources if path.exists() and (place / path.name).exists()}
        new = {path: data for path, data in paths.items() if path.resolve() not in kept}  # a road that lies there stays
        claim([*new, table], self.traffic.sources, force=force)
        with together():
            for path, data in new.items():
                write_atomically(path, data)
            drivers_table(self, table)
        self.outputs = (*paths, table)
        return self.outputs


def drivers_table(made: Reconstruction, path: Path) -> None:
    """Write the table of one row that `convert` takes: the scenario, who is under test, and everybody's profile."""
    drivers = {plan.name: driver.profile for plan, driver in zip(made.plans, made.drivers, strict=True)}
    driven = {name: profile for name, profile in drivers.items() if profile and name != made.host}
    cells = {"scenario": f"{made.name}.xosc"} | ({} if made.host is None else {"ego": made.host})
    cells |= {f"profile:{name}": profile for name, profile in driven.items()} | {"only": ";".join(driven)}
    write_frame(pd.DataFrame([cells]), path, {"inputs": parsed_hashes(made.files)})


def facts_of(made: Reconstruction) -> dict[str, Any]:
    """Everything that is known of a reconstruction, as plain values."""
    recording, plans = made.recording, made.plans
    return {
        "name": made.traffic.name,
        "recording": made.traffic.sources[0].name,
        "window": [round(recording.start, 3), round(recording.end, 3)],
        "host": made.host,
        "summary": summary(plans, recording.end - recording.start),
        "vehicles": vehicle_rows(plans, made.drivers),
        "maneuvers": maneuver_rows(plans, made.relative),
        "encounters": encounter_rows(made.encounters),
        "rows": rows_of(made),
        "inferred": {name: [list(gap) for gap in gaps] for name, gaps in recording.inferred.items()},
        "not_expressed": list(made.notes),
        "provenance": {"package_version": __version__, "inputs": parsed_hashes(made.files)},
    }


def rows_of(made: Reconstruction) -> dict[str, int]:
    """Rows of the recording's file by what became of them: they add up to all of it."""
    traffic = made.traffic
    thinned = max(traffic.read - sum(len(track.time) for track in traffic.tracks), 0)
    there = sum(made.recording.rows.values())
    others = sum(len(track.time) for track in traffic.tracks) - there
    counts = Counter(made.recording.rows) + Counter(traffic.dropped)
    counts += Counter({"thinned to 0.1 s": thinned, "of vehicles that were not asked for": others})
    return dict(sorted(counts.items()))


def summary(plans: Sequence[VehiclePlan], duration: float) -> dict[str, float]:
    """Counts, and residuals of all vehicles together. [m], [s]"""
    parts = [(*plan.residuals.columns.values(), plan.in_lane) for plan in plans]
    along, across, in_lane = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    driven = sum(float(plan.speed.time[-1] - plan.speed.time[0]) for plan in plans)
    corners = sum(len(plan.speed.time) - 2 for plan in plans)
    return {
        "vehicles": len(plans),
        "duration": round(duration, 3),
        "lane_changes": sum(len(plan.changes) for plan in plans),
        "other_lateral_maneuvers": sum(len(plan.lateral.transitions) - len(plan.changes) for plan in plans),
        "corners_per_minute": round(60.0 * corners / driven, 2),
        "along_p95": round(float(np.quantile(np.abs(along), 0.95)), 4),
        "along_largest": round(float(np.abs(along).max()), 4),
        "across_rms": round(_rms(across), 4),
        "across_in_lane_rms": round(_rms(across[in_lane]), 4),
        "across_in_maneuvers_rms": round(_rms(across[~in_lane]), 4),
    }


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else 0.0


def vehicle_rows(plans: Sequence[VehiclePlan], drivers: Sequence[ChosenDriver]) -> list[dict[str, Any]]:
    """One row per vehicle. [s], [m]"""
    return [
        {
            "entity": plan.name,
            "recorded_as": plan.vehicle.name,
            "class": plan.vehicle.entity.kind,
            "from": round(plan.present[0], 3),
            "to": round(plan.present[1], 3),
            "corners": len(plan.speed.time) - 2,
            "lane_changes": len(plan.changes),
            "along_rms": round(_rms(along), 4),
            "along_largest": round(float(np.abs(along).max(initial=0.0)), 4),
            "across_in_lane_rms": round(_rms(across[in_lane]), 4),
            "across_in_maneuvers_rms": round(_rms(across[~in_lane]), 4),
            "profile": driver.profile,
            "why": driver.why,
        }
        for plan, driver in zip(plans, drivers, strict=True)
        for along, across, in_lane in [(*plan.residuals.columns.values(), plan.in_lane)]
    ]


def maneuver_rows(plans: Sequence[VehiclePlan], relative: Mapping[str, Triggers]) -> list[dict[str, Any]]:
    """One row per lateral maneuver, in order of time. [s], [m]"""
    rows = []
    for plan in plans:
        distances = relative.get(plan.name, ({}, {}))[0]
        for number, transition in enumerate(plan.lateral.transitions):
            kind = "lane change" if transition.lanes else "aborted lane change" if transition.aborted else "lane offset"
            trigger = distances.get(number)
            bell = transition.bell_residual
            row = {
                "entity": plan.name,
                "kind": kind,
                "side": "left" if transition.change > 0 else "right",
                "start": round(transition.start, 3),
                "duration": round(transition.duration, 3),
                "shape": transition.shape.value,
                "lanes": abs(transition.lanes),
                "residual": round(transition.residual, 4),
                "bell_residual": round(bell, 4) if np.isfinite(bell) else None,
                "cut_off": transition.cut,
                "begins": "by the clock" if trigger is None else f"{trigger.distance:.1f} m from {trigger.other}",
            }
            rows.append(row)
    return sorted(rows, key=lambda row: (row["start"], row["entity"]))


def encounter_rows(met: Sequence[Encounter]) -> list[dict[str, Any]]:
    """One row per lane change and braking. [s], [m]; None: nobody, or it never comes to it."""
    rows = []
    for encounter in met:
        row: dict[str, Any] = {"kind": encounter.kind, "entity": encounter.vehicle, "time": round(encounter.time, 3)}
        row["side"] = encounter.side
        for word, other in (("ahead", encounter.ahead), ("behind", encounter.behind)):
            row |= dict.fromkeys((word, f"gap_{word}", f"time_to_collision_{word}"))
            if other is not None:
                time = other.time_to_collision
                row |= {word: other.name, f"gap_{word}": round(float(other.gap), 2)}
                row[f"time_to_collision_{word}"] = round(float(time), 2) if np.isfinite(time) else None
        rows.append(row)
    return rows


def not_expressed(plans: Sequence[VehiclePlan], left_out: Sequence[str]) -> list[str]:
    """What the scenario does not say, or not as well as asked for: a line each."""
    lines = list(left_out)
    for plan in plans:
        if cut := sum(transition.cut for transition in plan.lateral.transitions):
            lines.append(f"{plan.name}: {cut} lateral maneuvers begin or end outside of the recording")
        for word, name in (("along the road", "along"), ("beside its maneuvers", "across")):
            away = np.abs(plan.residuals.columns[name])
            if away.max(initial=0.0) > NAMED_RESIDUAL:
                time = plan.residuals.time[int(away.argmax())]
                lines.append(f"{plan.name}: up to {away.max():.2f} m {word}, at {time:.1f} s")
    transitions = [transition for plan in plans for transition in plan.lateral.transitions]
    fitted = [transition for transition in transitions if np.isfinite(transition.bell_residual)]
    if bells := sum(transition.is_bell for transition in fitted):
        lines.append(
            f"{bells} of {len(fitted)} lane changes are nearer to the bell of drivers than to a maneuver's shape: "
            "convert --lane-changes lifelike has it"
        )
    return lines


def as_text(facts: dict[str, Any]) -> str:
    """For a person, at the command line."""
    numbers = facts["summary"]
    profiles = [row["profile"] for row in facts["vehicles"] if row["profile"]]
    counted = ", ".join(f"{profiles.count(name)} {name}" for name in sorted(set(profiles)))
    lines = [
        f"{facts['name']}: {numbers['vehicles']} vehicles, {numbers['duration']:g} s, {numbers['lane_changes']} lane "
        f"changes, {numbers['corners_per_minute']:g} changes of acceleration a minute",
        f"  along the road: 95 % within {numbers['along_p95']:.2f} m, all within {numbers['along_largest']:.2f} m",
        f"  across: {numbers['across_rms']:.2f} m rms, of which in lane {numbers['across_in_lane_rms']:.2f} m, "
        f"in maneuvers {numbers['across_in_maneuvers_rms']:.2f} m",
        f"  drivers: {counted or 'none'}",
    ]
    if facts["not_expressed"]:
        lines.append(f"  not expressed: {len(facts['not_expressed'])} lines in the report")
    return "\n".join([*lines, *(f"  {path}" for path in facts["outputs"])])
