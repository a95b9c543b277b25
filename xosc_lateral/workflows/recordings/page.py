"""A reconstruction for people and machines: residuals, maneuvers, encounters, drivers, and what could not be said."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.version import __version__
from xosc_lateral.files.pages.chart import MEASURED, SAMPLED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import KeyFigure, Page
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.conversion.result import EntityResult, SampledSegment
from xosc_lateral.workflows.playing.scene import scene_of
from xosc_lateral.workflows.recordings.drivers import ChosenDriver
from xosc_lateral.workflows.recordings.encounters import Encounter
from xosc_lateral.workflows.recordings.plan import Residuals, VehiclePlan, planned_motion
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import SegmentKind, SegmentSpan
from xosc_lateral.world.motion.trajectory import WorldTrajectory

if TYPE_CHECKING:
    from xosc_lateral.workflows.recordings.reconstruct import Reconstruction

FRAME = 0.1  # rows of the page's player [s]
VEHICLES = {
    "entity": "entity", "recorded_as": "recorded as", "class": "class", "from": "from [s]", "to": "to [s]",
    "corners": "changes of acceleration", "along_rms": "along, rms [m]", "along_largest": "along, largest [m]",
    "across_in_lane_rms": "across in lane, rms [m]", "across_in_maneuvers_rms": "across in maneuvers, rms [m]",
    "profile": "profile",
}  # fmt: skip
MANEUVERS = {
    "entity": "entity", "kind": "maneuver", "side": "side", "start": "start [s]", "duration": "duration [s]",
    "shape": "shape", "lanes": "lanes", "residual": "residual, rms [m]", "bell_residual": "of a bell [m]",
    "cut_off": "cut off", "begins": "begins",
}  # fmt: skip
ENCOUNTERS = {
    "entity": "entity", "kind": "maneuver", "time": "time [s]", "side": "side", "ahead": "ahead",
    "gap_ahead": "gap ahead [m]", "time_to_collision_ahead": "time to collision ahead [s]", "behind": "behind",
    "gap_behind": "gap behind [m]", "time_to_collision_behind": "time to collision behind [s]",
}  # fmt: skip
"""Columns of the page's tables: keys of the rows, and headings."""
WORTH_NAMING = 1.0
"""A position that is off by more is named in the list of what could not be expressed, across beside the lane's own
spread. [m]"""


def summary(plans: Sequence[VehiclePlan], residuals: Sequence[Residuals], duration: float) -> dict[str, float]:
    """Counts, and residuals of all vehicles together. [m], [s]"""
    along, across = (np.concatenate([getattr(one, name) for one in residuals]) for name in ("along", "across"))
    in_lane = np.concatenate([one.in_lane for one in residuals])
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


def vehicle_rows(
    plans: Sequence[VehiclePlan], residuals: Sequence[Residuals], drivers: Sequence[ChosenDriver]
) -> list[dict[str, Any]]:
    """One row per vehicle. [s], [m]"""
    return [
        {
            "entity": plan.name,
            "recorded_as": plan.vehicle.name,
            "class": plan.vehicle.kind,
            "from": round(plan.present[0], 3),
            "to": round(plan.present[1], 3),
            "corners": len(plan.speed.time) - 2,
            "lane_changes": len(plan.changes),
            "along_rms": round(_rms(one.along), 4),
            "along_largest": round(float(np.abs(one.along).max()), 4) if len(one.along) else 0.0,
            "across_in_lane_rms": round(_rms(one.across[one.in_lane]), 4),
            "across_in_maneuvers_rms": round(_rms(one.across[~one.in_lane]), 4),
            "profile": driver.profile,
            "why": driver.why,
        }
        for plan, one, driver in zip(plans, residuals, drivers, strict=True)
    ]


def maneuver_rows(plans: Sequence[VehiclePlan], relative: Any) -> list[dict[str, Any]]:
    """One row per lateral maneuver, in order of time. [s], [m]"""
    rows = []
    for plan in plans:
        distances = relative.get(plan.name, ({}, {}))[0]
        for number, one in enumerate(plan.lateral.transitions):
            kind = "lane change" if one.lanes else "aborted lane change" if one.aborted else "lane offset"
            trigger = distances.get(number)
            rows.append(
                {
                    "entity": plan.name,
                    "kind": kind,
                    "side": "left" if one.change > 0 else "right",
                    "start": round(one.start, 3),
                    "duration": round(one.duration, 3),
                    "shape": one.shape.value,
                    "lanes": abs(one.lanes),
                    "residual": round(one.residual, 4),
                    "bell_residual": round(one.bell_residual, 4) if np.isfinite(one.bell_residual) else None,
                    "cut_off": one.cut,
                    "begins": "by the clock" if trigger is None else f"{trigger.distance:.1f} m from {trigger.other}",
                }
            )
    return sorted(rows, key=lambda row: (row["start"], row["entity"]))


def encounter_rows(met: Sequence[Encounter]) -> list[dict[str, Any]]:
    """One row per lane change and braking. [s], [m]; None: nobody, or it never comes to it."""
    rows = []
    for encounter in met:
        row: dict[str, Any] = {"kind": encounter.kind, "entity": encounter.vehicle, "time": round(encounter.time, 3)}
        row["side"] = encounter.side
        for word, other in (("ahead", encounter.ahead), ("behind", encounter.behind)):
            time = np.inf if other is None else other.time_to_collision
            row |= {
                word: None if other is None else other.name,
                f"gap_{word}": None if other is None else round(float(other.gap), 2),
                f"time_to_collision_{word}": round(float(time), 2) if np.isfinite(time) else None,
            }
        rows.append(row)
    return rows


def not_expressed(plans: Sequence[VehiclePlan], residuals: Sequence[Residuals], left_out: Sequence[str]) -> list[str]:
    """What the scenario does not say, or not as well as asked for: a line each."""
    lines = list(left_out)
    for plan, one in zip(plans, residuals, strict=True):
        cut = sum(each.cut for each in plan.lateral.transitions)
        if cut:
            lines.append(f"{plan.name}: {cut} lateral maneuvers begin or end outside of the recording")
        for word, values in (("along the road", one.along), ("beside its maneuvers", one.across)):
            if len(values) and (worst := float(np.abs(values).max())) > WORTH_NAMING:
                row = int(np.abs(values).argmax())
                lines.append(f"{plan.name}: up to {worst:.2f} m {word}, at {one.time[row]:.1f} s")
    fitted = [one for plan in plans for one in plan.lateral.transitions if np.isfinite(one.bell_residual)]
    if bells := sum(one.is_bell for one in fitted):
        lines.append(
            f"{bells} of {len(fitted)} lane changes are nearer to the bell of drivers than to a maneuver's shape: "
            "convert --lane-changes lifelike has it"
        )
    return lines


def recorded_path(plan: VehiclePlan, time: FloatArray, motion: EntityMotion) -> WorldTrajectory:
    """What was recorded, on the rows of a motion."""
    vehicle = plan.vehicle
    held = np.clip(time, vehicle.time[0], vehicle.time[-1])
    x, y = (np.interp(held, vehicle.time, values) for values in (vehicle.x, vehicle.y))
    speed = np.hypot(np.gradient(x, time), np.gradient(y, time)) if len(time) > 1 else motion.speed
    return WorldTrajectory(time, x, y, motion.z, motion.heading, motion.pitch, motion.roll, speed)


def facts_of(made: Reconstruction) -> dict[str, Any]:
    """Everything that is known of a reconstruction, as plain values."""
    recording, plans, residuals = made.recording, made.plans, made.residuals
    return {
        "name": made.traffic.name,
        "recording": made.traffic.sources[0].name,
        "window": [round(recording.start, 3), round(recording.end, 3)],
        "host": made.host,
        "summary": summary(plans, residuals, recording.end - recording.start),
        "vehicles": vehicle_rows(plans, residuals, made.drivers),
        "maneuvers": maneuver_rows(plans, made.relative),
        "encounters": encounter_rows(made.encounters),
        "not_expressed": [*made.traffic.notes, *not_expressed(plans, residuals, recording.left_out)],
        "provenance": {"package_version": __version__, "inputs": parsed_hashes(made.files)},
    }


def page_of(made: Reconstruction, facts: dict[str, Any]) -> str:
    """HTML page, self-contained: the recorded paths in the player, the planned ones as ghosts."""
    numbers = facts["summary"]
    page = Page(f"{facts['name']}: from the recording to maneuvers")
    page.lead(
        f"{numbers['vehicles']} vehicles of `{facts['recording']}`, {facts['window'][0]:.1f} to "
        f"{facts['window'][1]:.1f} s, as a maneuver-based scenario: lane changes, a speed of straight pieces for each, "
        "appearing and leaving. What maneuvers do not say, how somebody moves in the lane, is left to the driver "
        "profiles in `drivers.csv`."
    )
    in_lane = f"in lane {numbers['across_in_lane_rms']:.2f} m"
    page.key_figures(
        [
            KeyFigure(f"{numbers['vehicles']}", "vehicles", f"{numbers['duration']:g} s"),
            KeyFigure(f"{numbers['lane_changes']}", "lane changes"),
            KeyFigure(f"{numbers['along_p95']:.2f} m", "along the road, 95 % within", "recorded less maneuvers"),
            KeyFigure(f"{numbers['across_rms']:.2f} m", "across, rms", in_lane),
        ]
    )
    page.section(
        "Player",
        "From above. Filled boxes are the recorded vehicles, dashed outlines (nominal) the places that the maneuvers "
        "give them. Click a vehicle to follow it, point at it for its values, drag to look elsewhere.",
    )
    page.player(_scene(made, numbers["duration"]), "Recorded and reconstructed traffic from above")
    page.section(
        "Residuals",
        "Recorded less planned. Along the road, the speed profile is at fault: "
        f"{numbers['corners_per_minute']} changes of acceleration a minute leave 95 % within {numbers['along_p95']} m. "
        f"Across, it is mostly the driver: {numbers['across_in_lane_rms']} m rms outside of maneuvers, "
        f"{numbers['across_in_maneuvers_rms']} m in them.",
    )
    page.figure(
        _spread(made.residuals),
        "Distribution of the residuals of all vehicles.",
        "Histograms of recorded less planned position, along and across the road",
    )
    cut = "Residual of the fitted shape. Cut off: the recording begins or ends within it."
    met = (
        "Every lane change, half way, and every braking at its begin: who is ahead and behind in the lane it leads to, "
        "free space between the bumpers, and time until that is used up."
    )
    for title, key, headings, caption in (
        ("Vehicles", "vehicles", VEHICLES, "Profile: who drives it in a twin."),
        ("Lateral maneuvers", "maneuvers", MANEUVERS, cut),
        ("Encounters", "encounters", ENCOUNTERS, met),
    ):
        page.section(title)
        shown = [{heading: row[name] for name, heading in headings.items()} for row in facts[key]]
        # times to 0.1 s, lengths to 1 cm
        formats = {heading: ".1f" if "[s]" in heading else ".2f" for heading in headings.values() if "[" in heading}
        page.table(shown, caption, formats=formats)
    page.section("Not expressed")
    page.items(facts["not_expressed"])
    page.text("" if facts["not_expressed"] else "Nothing was left out.")
    return page.html(facts["provenance"])


def _scene(made: Reconstruction, duration: float) -> str:
    """The player's: recorded paths over planned motions."""
    time, network = np.arange(0.0, duration + 1e-9, FRAME), made.traffic.network
    motions, results = list[EntityMotion](), list[EntityResult]()
    for plan in made.plans:
        motion = planned_motion(plan, time, network)
        across = np.interp(time, plan.vehicle.time, plan.vehicle.offset + plan.vehicle.levels[0])
        deviation = across - plan.lateral.at(np.clip(time, *plan.present))
        span = SegmentSpan(SegmentKind.ROAD_FOLLOWING, 0, len(time) - 1, 0.0, float(time[-1]))
        shown, path = SampledSegment(span, time, deviation), recorded_path(plan, time, motion)
        motions.append(motion)
        results.append(EntityResult(motion, (), None, "", (shown,), deviation, path))
    nominal = NominalMotion(FRAME, tuple(motions), (), float(time[-1]), "end of the recording", ())
    return scene_of(nominal, network, results)


def _spread(residuals: Sequence[Residuals]) -> Figure:
    figure = Figure(1, 2, height=130.0, legend=True)
    left, right = figure.panels
    along, across, in_lane = (
        np.concatenate([getattr(one, name) for one in residuals]) for name in ("along", "across", "in_lane")
    )
    density, edges = np.histogram(np.clip(along, -1.0, 1.0), np.linspace(-1.0, 1.0, 81), density=True)
    left.steps(edges, density, SAMPLED)
    for part, color, label in ((in_lane, MEASURED, "road-following"), (~in_lane, SAMPLED, "in maneuvers")):
        if part.any():
            density, edges = np.histogram(across[part], np.linspace(-1.5, 1.5, 91), density=True)
            right.steps(edges, density, color, label=label)
    left.title, left.x.label, left.y.label = "Along the road", "recorded ahead of the maneuvers [m]", "density [1/m]"
    right.title, right.x.label = "Across", "recorded to the left of the maneuvers [m]"
    return figure


def as_text(facts: dict[str, Any]) -> str:
    """For a person, at the command line."""
    numbers, files = facts["summary"], facts["outputs"]
    profiles = [row["profile"] for row in facts["vehicles"] if row["profile"]]
    counted = ", ".join(f"{profiles.count(name)} {name}" for name in sorted(set(profiles)))
    lines = [
        f"{facts['name']}: {numbers['vehicles']} vehicles, {numbers['duration']:g} s, {numbers['lane_changes']} lane "
        f"changes, {numbers['corners_per_minute']:g} changes of acceleration a minute",
        f"  along the road: 95 % within {numbers['along_p95']:.2f} m, all within {numbers['along_largest']:.2f} m",
        f"  across: {numbers['across_rms']:.2f} m rms, of which in lane {numbers['across_in_lane_rms']:.2f} m, "
        f"in maneuvers {numbers['across_in_maneuvers_rms']:.2f} m",
        f"  drivers: {counted or 'none'}",
        f"  not expressed: {len(facts['not_expressed'])} lines in the report" if facts["not_expressed"] else "",
        *(f"  {path}" for path in files),
    ]
    return "\n".join(line for line in lines if line)
