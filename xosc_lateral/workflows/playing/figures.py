"""Figures of a scenario, paths over the road and what happens over time, and the page of one that was played."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, rate
from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.note import Note
from xosc_lateral.files.pages.chart import DASHED, GRID, MUTED, NOMINAL, SHADE, Panel, color_of, label_of
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Page
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult, shown_rows
from xosc_lateral.workflows.playing.scene import lane_surfaces, markings
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import Crossing
from xosc_lateral.world.road.lanes import DRIVING

Rows = NDArray[np.int64]

ROAD_MARGIN = 30.0
"""Road that is drawn before and after the paths. [m]"""

MOST_ROADS = 3
"""Roads that are drawn stretched, those on which most time is spent."""

MOST_NAMED = 12
"""Entities up to which a figure of all has a legend."""

USUAL_ACCELERATION = 0.5
"""Lateral acceleration that real drivers seldom exceed while they keep their lane, beyond what the road asks. [m/s2]"""


# ---- over the road ---------------------------------------------------------------------------------------------------
def _extents_on_roads(enriched: Enriched) -> dict[int, tuple[float, float]]:
    """Road -> the s that vehicles cover on it; most time spent first."""
    there = ((one.motion, (one.motion.activity & Activity.ACTIVE) != 0) for one in enriched.entities)
    covered = grouped(
        (road, motion.s[here & (motion.road == road)])
        for motion, here in there
        for road in np.unique(motion.road[here & (motion.road >= 0)]).tolist()
    )
    whole = {road: np.concatenate(parts) for road, parts in covered.items()}
    order = sorted(whole, key=lambda road: -len(whole[road]))
    return {road: (float(whole[road].min()), float(whole[road].max())) for road in order}


def _breaks(motion: EntityMotion, rows: Rows) -> NDArray[np.bool_]:
    """Rows at which a line has to break: the entity is absent, or was placed anew since the row before."""
    bad = ((motion.activity & Activity.ACTIVE) == 0) | ((motion.activity & Activity.TELEPORTED) != 0)
    bad[0] = (motion.activity[0] & Activity.ACTIVE) == 0
    counted = np.cumsum(bad)
    return np.diff(counted[rows], prepend=int(bad[0])) > 0 if len(rows) else np.zeros(0, dtype=bool)


def broken(values: FloatArray, breaks: NDArray[np.bool_]) -> FloatArray:
    """NaN where a line has to break, shape (k,). [unit of the values]"""
    return np.where(breaks, np.nan, values)


def paths_stretched(enriched: Enriched) -> Figure | None:
    """Paths as t over s on the roads on which most time is spent; across is drawn far larger than along.

    None when no entity is on a road.
    """
    roads = list(_extents_on_roads(enriched).items())[:MOST_ROADS]
    if not roads:
        return None
    figure = Figure(len(roads), height=185.0, legend=len(enriched.entities) <= MOST_NAMED)
    for panel, (road, (first, last)) in zip(figure.panels, roads, strict=True):
        panel.x.limits, panel.y.limits = (first - ROAD_MARGIN, last + ROAD_MARGIN), _shown_t(enriched, road)
        for kind, s, right, left in lane_surfaces(enriched.network, road, *panel.x.limits):
            if kind in DRIVING:
                panel.band(s, right, left, SHADE)
        for mark, s, t in markings(enriched.network, road, *panel.x.limits):
            panel.line(s, t, MUTED, width=0.8, dashes="5 3" if "broken" in mark.type else "")
        for number in range(len(enriched.entities)):
            _draw_path(panel, enriched, number, road)
        panel.x.grid = panel.y.grid = False
        panel.title, panel.y.label = f"Road {enriched.network.road_ids[road]}", "across the road, t [m]"
        panel.x.label = "along the road, s [m]"
    return figure


def _draw_path(panel: Panel, enriched: Enriched, number: int, road: int) -> None:
    """One entity's way on a road, nominal and enriched, and a dot where it begins."""
    entity = enriched.entities[number]
    motion = entity.motion
    rows = shown_rows(motion)
    here = (motion.road[rows] == road) & ((motion.activity[rows] & Activity.ACTIVE) != 0)
    if not here.any():
        return
    kept = rows[here]
    breaks = _breaks(motion, rows)[here] | (np.diff(kept, prepend=kept[0] - 1) > 2 * (rows[-1] - rows[0]) / len(rows))
    breaks[0] = False
    color = color_of(number)
    sign = motion.way(kept)
    nominal, shifted = (
        enriched.network.offset_to_t(road, motion.lane[kept], motion.s[kept], motion.offset[kept] + added)
        for added in (0.0, sign * entity.deviation[kept])
    )
    panel.line(motion.s[kept], broken(nominal, breaks), NOMINAL, width=0.9, dashes=DASHED, label="nominal")
    panel.line(motion.s[kept], broken(shifted, breaks), color, label=label_of(entity.name))
    panel.dots(motion.s[kept[:1]], shifted[:1], color, size=5.0)


def _shown_t(enriched: Enriched, road: int) -> tuple[float, float]:
    """Range of t that holds the vehicles' lanes with a metre to spare."""
    edges = []
    for motion in (entity.motion for entity in enriched.entities):
        here = np.flatnonzero(motion.road == road)[::25]
        centre = enriched.network.lane_centre_t(road, motion.lane[here], motion.s[here])
        half = 0.5 * enriched.network.lane_width(road, motion.lane[here], motion.s[here])
        edges += [centre - half, centre + half]
    t = np.concatenate(edges)
    return float(t.min()) - 1.0, float(t.max()) + 1.0


def thumbnail(enriched: Enriched) -> str:
    """A small SVG document of all paths from above, the scale across the road exaggerated."""
    figure = Figure(width=200.0, height=56.0, axes=False)
    (panel,) = figure.panels
    paths = {}
    for number, entity in enumerate(enriched.entities):
        rows = np.flatnonzero((entity.motion.activity & Activity.ACTIVE) != 0)
        if len(rows):
            kept = rows[:: max(1, len(rows) // 60)]
            paths[number] = entity.trajectory.x[kept] + 1j * entity.trajectory.y[kept]
    longest = max(paths.values(), key=lambda path: float(abs(path[-1] - path[0])), default=np.zeros(1))
    along = np.exp(-1j * np.angle(longest[-1] - longest[0]))  # it goes from left to right
    for number, path in paths.items():
        color = color_of(number) if enriched.entities[number].is_enriched else MUTED
        turned = (path - longest[0]) * along
        panel.line(turned.real, turned.imag, color)
        panel.dots(turned.real[:1], turned.imag[:1], color, size=5.0)
    return figure.svg()


# ---- over time -------------------------------------------------------------------------------------------------------
def _figure_of_each(entities: Sequence[EntityResult], label: str) -> Figure:
    """A panel for each entity over time; grey: where it does not simply follow its road."""
    figure = Figure(len(entities), height=max(54.0, 120.0 / len(entities)), share_x="all", share_y="all")
    for panel, entity in zip(figure.panels, entities, strict=True):
        for span in entity.spans:
            if not span.is_road_following:
                panel.across(span.start, span.end, GRID, opacity=0.7)
        panel.title, panel.x.label = label_of(entity.name), "time [s]"
    figure.panels[len(entities) // 2].y.label = label
    return figure


def _number_of(enriched: Enriched, entity: EntityResult) -> int:
    """Its place among all entities, which decides on its colour in every figure."""
    return [each.name for each in enriched.entities].index(entity.name)


def offsets_over_time(enriched: Enriched, entities: Sequence[EntityResult]) -> Figure:
    """What was added to each entity's nominal offset."""
    figure = _figure_of_each(entities, "added offset [m]")
    reach = max(0.5, 1.1 * max(float(np.abs(entity.deviation).max()) for entity in entities))
    for panel, entity in zip(figure.panels, entities, strict=True):
        rows = shown_rows(entity.motion)
        panel.level(color=NOMINAL, dashes=DASHED)
        color = color_of(_number_of(enriched, entity))
        panel.line(entity.motion.time[rows], entity.deviation[rows], color, label=panel.title)
        panel.y.limits = (-reach, reach)
    return figure


def speeds_over_time(motion: NominalMotion, entities: Sequence[EntityResult] = ()) -> Figure:
    """Speed of every entity, enriched and nominal where there are results."""
    motions = [entity.motion for entity in entities] or motion.entities
    figure = Figure(height=160.0, legend=0 < len(motions) <= MOST_NAMED)
    (panel,) = figure.panels
    for number, vehicle in enumerate(motions):
        rows = shown_rows(vehicle)
        absent = (vehicle.activity[rows] & Activity.ACTIVE) == 0
        speed = entities[number].trajectory.speed if entities else vehicle.speed
        panel.line(vehicle.time[rows], broken(speed[rows], absent), color_of(number), label=label_of(vehicle.name))
        if entities:
            panel.line(
                vehicle.time[rows],
                broken(vehicle.speed[rows], absent),
                NOMINAL,
                dashes=DASHED,
                label="nominal",
            )
    panel.y.holds = (0.0,)
    panel.x.label, panel.y.label = "time [s]", "speed [m/s]"
    return figure


def accelerations_over_time(enriched: Enriched, entities: Sequence[EntityResult]) -> Figure:
    """Lateral acceleration that was added to each entity's motion, between lines that real drivers keep to."""
    figure = _figure_of_each(entities, "added [m/s²]")
    for panel, entity in zip(figure.panels, entities, strict=True):
        rows = shown_rows(entity.motion)
        time, added = entity.motion.time[rows], entity.lateral_acceleration()
        for bound in (-USUAL_ACCELERATION, USUAL_ACCELERATION):
            panel.level(bound, color=NOMINAL, dashes=DASHED)
        panel.line(time, added, color_of(_number_of(enriched, entity)), label="added")
    return figure


PEAK_SPEEDS = (0.52, 0.95)
"""Largest lateral speed of real lane changes, 5 and 95 % of 323 on vehicle motorway. [m/s]"""

SHOWN_TIME_BESIDE = 3.0
"""Time before and after a lane change that is drawn with it. [s]"""


def lane_changes_over_time(enriched: Enriched, chosen: Sequence[tuple[EntityResult, Crossing]]) -> Figure:
    """Lateral speed towards the new lane of each of these lane changes, as written and enriched."""
    figure = Figure(1, len(chosen), height=120.0, share_y="all")
    for panel, (entity, crossing) in zip(figure.panels, chosen, strict=True):
        time, side = entity.motion.time, np.sign(crossing.way[-1])
        begin, end = time[crossing.first], time[crossing.last]
        rows = slice(*np.searchsorted(time, (begin - SHOWN_TIME_BESIDE, end + SHOWN_TIME_BESIDE)))
        way = np.interp(time[rows], time[crossing.first : crossing.last + 1], crossing.way)
        panel.band(time[rows], PEAK_SPEEDS[0], PEAK_SPEEDS[1], SHADE)
        for added, style in ((0.0, {"dashes": DASHED}), (entity.deviation[rows], {})):
            color = color_of(_number_of(enriched, entity)) if not style else NOMINAL
            panel.line(time[rows], side * rate(way + added, time[rows]), color, **style)
        panel.title, panel.x.label = label_of(entity.name), "time [s]"
    figure.panels[0].y.label = "across [m/s]"
    return figure


# ---- The page of a played scenario, before anything is converted ----
def view_page(
    motion: NominalMotion,
    scene: str,
    source: str,
    provenance: Mapping[str, object],
    converted: Mapping[str, Any] | None = None,
) -> str:
    """HTML page with the player of a scene, self-contained; same input, same bytes.

    `source`: file name, for the reader; `provenance`: for the footer; `converted`: what the file says of its
    conversion, if it was converted.
    """
    page, profiles = Page(Path(source).name), (converted or {}).get("profiles")
    drivers = ", ".join(sorted(profiles)) if isinstance(profiles, Mapping) and profiles else "nobody"
    count = len(motion.entities)
    page.lead(
        f"{count} {'entity' if count == 1 else 'entities'}, {motion.end_time:.1f} s (ended by the {motion.ended_by}). "
        + (NOT_CONVERTED if converted is None else f"Converted by xosc-lateral, with lateral movement of {drivers}.")
    )
    beside = "" if '"enriched"' not in scene else " As written, and below it lifelike, with written places as outlines."
    page.section("Player", f"The scenario from above.{beside} {PLAYER_WORDS}")
    page.player(scene, "Scenario from above")
    page.section("Speed")
    page.figure(
        speeds_over_time(motion),
        "Speed over time. Click to take the player to that time.",
        "Speed over time of every entity",
        over_time=True,
    )
    add_notes(page, motion.notes)
    return page.html(provenance)


PLAYER_WORDS = (
    "Across the road, everything is drawn as many times wider as the lateral stretch says; at 1 it is as it is. Click "
    "a vehicle to follow it, point at it for its values, drag to look elsewhere."
)
NOT_CONVERTED = "The maneuvers are played as the scenario states them; no lateral movement was added to them."


def add_notes(page: Page, notes: Sequence[Note]) -> None:
    """The section on what was not played as the scenario states it."""
    page.section("Not played as written")
    if not notes:
        page.text("Nothing: every action and condition was played as the scenario states it.")
        return
    rows = [
        {"what": note.what, "element": note.element, "file": Path(note.path or "").name, "line": str(note.line or "")}
        for note in notes
    ]
    page.table(rows, "What was left out or played differently")
