"""A reconstruction as a page: the recorded paths in a player, residuals, vehicles, maneuvers and encounters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray, rate
from xosc_lateral.base.track import Track
from xosc_lateral.extras.recordings.plan import FRAME, VehiclePlan
from xosc_lateral.extras.recordings.recorded import own_lateral
from xosc_lateral.files.pages.chart import MEASURED, SAMPLED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import KeyFigure, Page
from xosc_lateral.workflows.conversion.result import EntityResult, SampledSegment
from xosc_lateral.workflows.playing.scene import scene_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, MovingTraffic
from xosc_lateral.world.motion.segments import SegmentKind, SegmentSpan
from xosc_lateral.world.road.network import RoadNetwork

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


def page_of(facts: dict[str, Any], plans: Sequence[VehiclePlan], network: RoadNetwork) -> str:
    """HTML page, self-contained: the recorded paths in the player, the planned ones as ghosts."""
    numbers = facts["summary"]
    page = Page(f"{facts['name']}: from the recording to maneuvers")
    page.lead(
        f"Maneuvers put the {numbers['vehicles']} vehicles of `{facts['recording']}`, {facts['window'][0]:.1f} to "
        f"{facts['window'][1]:.1f} s, where they were recorded to within {numbers['along_p95']:.2f} m along the road "
        f"(95 % of the time) and {numbers['across_rms']:.2f} m across it (rms).",
        "They are lane changes, a speed of straight pieces for each, appearing and leaving. What they do not say, how "
        "somebody moves in the lane, is left to the driver profiles in `drivers.csv`.",
    )
    figures = [
        KeyFigure(f"{numbers['vehicles']}", "vehicles", f"{numbers['duration']:g} s"),
        KeyFigure(f"{numbers['lane_changes']}", "lane changes"),
        KeyFigure(f"{numbers['along_p95']:.2f} m", "along the road, 95 % within", "recorded less maneuvers"),
        KeyFigure(f"{numbers['across_rms']:.2f} m", "across, rms", f"in lane {numbers['across_in_lane_rms']:.2f} m"),
    ]
    page.key_figures(figures)
    page.section(
        "Player",
        "From above. Filled boxes are the recorded vehicles, dashed outlines (nominal) the places that the maneuvers "
        "give them. Click a vehicle to follow it, point at it for its values, drag to look elsewhere.",
    )
    page.player(_scene(plans, network, numbers["duration"]), "Recorded and reconstructed traffic from above")
    page.section(
        "Residuals",
        "Recorded less planned. Along the road, the speed profile is at fault: "
        f"{numbers['corners_per_minute']} changes of acceleration a minute leave 95 % within {numbers['along_p95']} m. "
        f"Across, it is mostly the driver: {numbers['across_in_lane_rms']} m rms outside of maneuvers, "
        f"{numbers['across_in_maneuvers_rms']} m in them.",
    )
    page.figure(
        _spread(plans),
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


def _scene(plans: Sequence[VehiclePlan], network: RoadNetwork, duration: float) -> str:
    time = np.arange(0.0, duration + 1e-9, FRAME)
    motions, results = list[EntityMotion](), list[EntityResult]()
    for plan in plans:
        motion = _planned_motion(plan, time, network)
        aside = np.interp(time, plan.vehicle.time, own_lateral(plan.vehicle)[0])
        deviation = aside - plan.lateral.at(np.clip(time, *plan.present))
        span = SegmentSpan(SegmentKind.ROAD_FOLLOWING, 0, len(time) - 1, 0.0, float(time[-1]))
        shown, path = SampledSegment(span, time, deviation), recorded_path(plan, time, motion)
        motions.append(motion)
        results.append(EntityResult(motion, (), None, "", (shown,), deviation, path))
    return scene_of(MovingTraffic(FRAME, tuple(motions)), network, results, views=("Maneuvers", "Recorded"))


def _planned_motion(plan: VehiclePlan, time: FloatArray, network: RoadNetwork) -> EntityMotion:
    """Where the plan has the vehicle at times [s], shape (n,): what any player makes of it, but for its frames."""
    vehicle = plan.vehicle
    begin, end = plan.present
    held = np.clip(time, begin, end)
    way = plan.speed.way(held)
    recorded = plan.time_at(way)
    row = np.clip(np.searchsorted(vehicle.time, recorded, side="right") - 1, 0, len(vehicle.time) - 2)
    share = (recorded - vehicle.time[row]) / (vehicle.time[row + 1] - vehicle.time[row])
    same = (vehicle.road[row] == vehicle.road[row + 1]) & (vehicle.lane[row] == vehicle.lane[row + 1])
    s = vehicle.s[row] + np.where(same, share * (vehicle.s[row + 1] - vehicle.s[row]), 0.0)
    road, lane = vehicle.road[row], vehicle.lane[row]
    way_on_lane = vehicle.way(row)
    offset = way_on_lane * (plan.lateral.at(held) - own_lateral(vehicle)[1][row])
    poses = network.lane_to_world(road, lane, s, offset)
    speed = plan.speed.at(held)
    is_there = (time >= begin - 1e-9) & (time <= end + FRAME)
    activity = np.where(is_there, Activity.ACTIVE, 0).astype(np.uint8)
    heading = poses.heading + np.where(way_on_lane < 0, np.pi, 0.0)
    entity = structs.replace(vehicle.entity, name=plan.name)
    return EntityMotion.of(
        entity, time, **poses._asdict() | {"heading": heading}, speed=speed, road=road, lane=lane, s=s, offset=offset,
        heading_relative=np.where(way_on_lane < 0, np.pi, 0.0), activity=activity,
    )  # fmt: skip


def _spread(plans: Sequence[VehiclePlan]) -> Figure:
    figure = Figure(1, 2, height=130.0, legend=True)
    left, right = figure.panels
    parts = [(*plan.residuals.columns.values(), plan.in_lane) for plan in plans]
    along, across, in_lane = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    density, edges = np.histogram(np.clip(along, -1.0, 1.0), np.linspace(-1.0, 1.0, 81), density=True)
    left.steps(edges, density, SAMPLED)
    for part, color, label in ((in_lane, MEASURED, "road-following"), (~in_lane, SAMPLED, "in maneuvers")):
        if part.any():
            density, edges = np.histogram(across[part], np.linspace(-1.5, 1.5, 91), density=True)
            right.steps(edges, density, color, label=label)
    left.title, left.x.label, left.y.label = "Along the road", "recorded ahead of the maneuvers [m]", "density [1/m]"
    right.title, right.x.label = "Across", "recorded to the left of the maneuvers [m]"
    return figure


def recorded_path(plan: VehiclePlan, time: FloatArray, motion: EntityMotion) -> Track:
    """What was recorded, on the rows of a motion."""
    vehicle = plan.vehicle
    held = np.clip(time, vehicle.time[0], vehicle.time[-1])
    x, y = (np.interp(held, vehicle.time, values) for values in (vehicle.x, vehicle.y))
    speed = np.hypot(rate(x, FRAME), rate(y, FRAME))
    return motion.having(x=x, y=y, speed=speed)
