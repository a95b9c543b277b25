"""Figures of a scenario: paths over the road, from above and stretched, and what happens over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.arrays import FloatArray
from xosc_lateral.enrich.result import Enriched, EntityResult
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.report.chart import DASHED, ENRICHED, GRID, INK, MUTED, NOMINAL, SHADE, Panel, color_of, label_of
from xosc_lateral.report.figure import WIDTH, Figure, text_width
from xosc_lateral.report.path_dynamics import COMFORTABLE, lateral_dynamics
from xosc_lateral.road import RoadNetwork

Rows = NDArray[np.int64]

ROW_STEP = 0.1
"""Rows that are drawn. [s]"""

STEP = 4.0
"""Between two points of a lane's edge. [m]"""

MARGIN = 30.0
"""Road that is drawn before and after the paths. [m]"""

MOST_ROADS = 3
"""Roads that are drawn stretched, those on which most time is spent."""

MOST_NAMED = 12
"""Entities up to which a figure of all has a legend."""


class View(NamedTuple):
    """A turned view from above: `x`, `y` of the middle go to 0, and `angle` [rad] to the horizontal."""

    x: float
    y: float
    angle: float

    def turn(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """World to figure. [m]"""
        turned = (np.asarray(x) - self.x + 1j * (np.asarray(y) - self.y)) * np.exp(-1j * self.angle)
        return turned.real, turned.imag


def view_along(x: FloatArray, y: FloatArray) -> View:
    """The view in which the points stretch from left to right; the first of them on the left."""
    points = np.column_stack([x, y])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    if len(points) < 2 or not np.ptp(points, axis=0).any():
        return View(float(middle[0]), float(middle[1]), 0.0)
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    along = axes[0] * np.sign((points[-1] - points[0]) @ axes[0] or 1.0)
    return View(float(middle[0]), float(middle[1]), float(np.arctan2(along[1], along[0])))


# ---- roads ----
class EdgeLine(NamedTuple):
    """Edge of a lane, or a marking, along a road: `t` [m] over `s` [m], and how it is drawn."""

    s: FloatArray
    t: FloatArray
    color: str
    dashes: str


def edge_lines(network: RoadNetwork, road: int, first: float, last: float) -> Iterator[EdgeLine]:
    """Edges of the driving lanes, and markings, of one road between two s."""
    for s, right, left in _lane_surfaces(network, road, first, last):
        yield from (EdgeLine(s, t, GRID, "") for t in (right, left))
    for mark in network.road_marks(road):
        s = _grid(max(first, mark.s_start), min(last, mark.s_end))
        if len(s):
            outer = 0.5 * np.sign(mark.lane) * network.lane_width(road, mark.lane, s) if mark.lane else 0.0
            dashes = "5 3" if "broken" in mark.type else ""
            yield EdgeLine(s, network.lane_centre_t(road, mark.lane, s) + outer, MUTED, dashes)


def _lane_surfaces(
    network: RoadNetwork, road: int, first: float, last: float
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Driving lanes, section by section: s, and t of both edges."""
    start, last = max(0.0, first), min(network.roads[road].length, last)
    while start < last:
        section_start, section_end = network.section_at(road, start)
        s = _grid(start, min(section_end, last))
        for lane in network.lanes_at(road, 0.5 * (section_start + section_end)):
            if lane.type == "driving":
                centre = network.lane_centre_t(road, lane.id, s)
                half = 0.5 * network.lane_width(road, lane.id, s)
                yield s, centre - half, centre + half
        if section_end <= start:  # a section of no length: OpenDRIVE forbids it, field files have it
            break
        start = section_end


def _grid(start: float, stop: float) -> FloatArray:
    """From start to just before stop, where the next section begins; empty if there is nothing in between."""
    return np.unique(np.append(np.arange(start, stop, STEP), max(start, stop - 1e-6))) if start < stop else np.empty(0)


def _extents_on_roads(enriched: Enriched) -> dict[int, tuple[float, float]]:
    """Road -> the s that vehicles cover on it; most time spent first."""
    covered: dict[int, list[FloatArray]] = {}
    for entity in enriched.entities:
        motion = entity.motion
        here = (motion.activity & Activity.ACTIVE) != 0
        for road in np.unique(motion.road[here & (motion.road >= 0)]).tolist():
            covered.setdefault(road, []).append(motion.s[here & (motion.road == road)])
    whole = {road: np.concatenate(parts) for road, parts in covered.items()}
    order = sorted(whole, key=lambda road: -len(whole[road]))
    return {road: (float(whole[road].min()), float(whole[road].max())) for road in order}


# ---- rows of an entity ----
def shown_rows(motion: EntityMotion) -> Rows:
    """Rows that are drawn, 0.1 s apart, shape (k,)."""
    step = motion.time[1] - motion.time[0] if len(motion.time) > 1 else ROW_STEP
    return np.arange(0, len(motion.time), max(1, round(ROW_STEP / step)))


def _breaks(motion: EntityMotion, rows: Rows) -> NDArray[np.bool_]:
    """Rows at which a line has to break: the entity is absent, or was placed anew since the row before."""
    bad = ((motion.activity & Activity.ACTIVE) == 0) | ((motion.activity & Activity.TELEPORTED) != 0)
    bad[0] = (motion.activity[0] & Activity.ACTIVE) == 0
    counted = np.cumsum(bad)
    return np.diff(counted[rows], prepend=int(bad[0])) > 0 if len(rows) else np.zeros(0, dtype=bool)


def broken(values: FloatArray, breaks: NDArray[np.bool_]) -> FloatArray:
    """NaN where a line has to break, shape (k,). [unit of the values]"""
    return np.where(breaks, np.nan, values)


# ---- over the road ----
def paths_from_above(enriched: Enriched) -> Figure | None:
    """Nominal and enriched paths with the lanes, true to scale, turned so that they stretch from left to right.

    None when no entity is on a road.
    """
    on_road = [entity for entity in enriched.entities if (entity.motion.road >= 0).any()]
    if not on_road:
        return None
    moving = max(on_road, key=lambda each: float(np.ptp(each.motion.x) + np.ptp(each.motion.y)))
    view = view_along(moving.motion.x, moving.motion.y)
    figure = Figure(equal=True)
    (panel,) = figure.panels
    for road, (first, last) in _extents_on_roads(enriched).items():
        for line in edge_lines(enriched.network, road, first - MARGIN, last + MARGIN):
            poses = enriched.network.road_to_world(road, line.s, line.t)
            panel.line(*view.turn(poses.x, poses.y), line.color, width=0.8, dashes=line.dashes)
    paths = [_path_from_above(panel, entity, number, view) for number, entity in enumerate(enriched.entities)]
    taken = np.ptp(np.concatenate(paths, axis=1), axis=1)
    figure.height = float(np.clip(0.9 * WIDTH * taken[1] / max(taken[0], 1.0) + 24.0, 70.0, 480.0))
    panel.x.label, panel.y.label = "along the drive [m]", "across [m]"
    return figure


def _path_from_above(panel: Panel, entity: EntityResult, number: int, view: View) -> FloatArray:
    """Draw one entity, nominal and enriched; where it goes, shape (2, k). [m]"""
    rows = shown_rows(entity.motion)
    breaks = _breaks(entity.motion, rows)
    x, y = view.turn(entity.motion.x[rows], entity.motion.y[rows])
    panel.line(broken(x, breaks), broken(y, breaks), NOMINAL, width=0.8, dashes=DASHED, label="nominal")
    if entity.is_enriched:
        x, y = view.turn(entity.trajectory.x[rows], entity.trajectory.y[rows])
        panel.line(broken(x, breaks), broken(y, breaks), color_of(number), width=1.3, label=label_of(entity.name))
    panel.dots(x[:1], y[:1], color_of(number))
    return np.stack([x, y])


def paths_stretched(enriched: Enriched) -> Figure | None:
    """Paths as t over s on the roads on which most time is spent; across is drawn far larger than along.

    None when no entity is on a road.
    """
    roads = list(_extents_on_roads(enriched).items())[:MOST_ROADS]
    if not roads:
        return None
    figure = Figure(len(roads), height=185.0)
    for panel, (road, (first, last)) in zip(figure.panels, roads, strict=True):
        panel.x.limits, panel.y.limits = (first - MARGIN, last + MARGIN), _shown_t(enriched, road)
        for s, right, left in _lane_surfaces(enriched.network, road, *panel.x.limits):
            panel.band(s, right, left, SHADE)
        for line in edge_lines(enriched.network, road, *panel.x.limits):
            panel.line(line.s, line.t, line.color, width=0.8, dashes=line.dashes)
        starts = [_path_on_road(panel, enriched, number, road) for number in range(len(enriched.entities))]
        _name_starts(panel, figure.height, [start for start in starts if start is not None])
        panel.x.grid = panel.y.grid = False
        panel.title, panel.y.label = f"Road {enriched.network.road_ids[road]}", "t [m]"
        panel.x.label = "s along the road [m]"
    return figure


def _path_on_road(panel: Panel, enriched: Enriched, number: int, road: int) -> tuple[float, float, str, str] | None:
    """Draw one entity's way on a road; where it begins, its name and colour, if this is the road that it starts on."""
    entity = enriched.entities[number]
    motion = entity.motion
    rows = shown_rows(motion)
    here = (motion.road[rows] == road) & ((motion.activity[rows] & Activity.ACTIVE) != 0)
    if not here.any():
        return None
    kept = rows[here]
    breaks = _breaks(motion, rows)[here] | (np.diff(kept, prepend=kept[0] - 1) > 2 * (rows[-1] - rows[0]) / len(rows))
    breaks[0] = False
    name, color = label_of(entity.name), color_of(number) if entity.is_enriched else INK
    sign = np.where(np.cos(motion.heading_relative[kept]) >= 0.0, 1.0, -1.0)
    nominal, shifted = (
        enriched.network.offset_to_t(road, motion.lane[kept], motion.s[kept], motion.offset[kept] + added)
        for added in (0.0, sign * entity.deviation[kept])
    )
    panel.line(motion.s[kept], broken(nominal, breaks), NOMINAL, width=0.9, dashes=DASHED, label=f"{name}, nominal")
    panel.line(motion.s[kept], broken(shifted, breaks), color, label=name)
    panel.dots(motion.s[kept[:1]], shifted[:1], color, size=5.0)
    is_first_road = road == motion.road[np.argmax(motion.road >= 0)]
    return (float(motion.s[kept[0]]), float(shifted[0]), name, color) if is_first_road else None


def _name_starts(panel: Panel, height: float, starts: Sequence[tuple[float, float, str, str]]) -> None:
    """Names beside the starts, each a line higher or lower where it would cover another one."""
    (first, last), (low, high) = panel.x.ends, panel.y.ends
    scale_s, scale_t = 0.92 * WIDTH / (last - first), height / (high - low)
    taken: list[tuple[float, float, float]] = []
    for s, t, name, color in sorted(starts):
        left, right = s * scale_s, s * scale_s + text_width(name)
        for lift in (-6.0, 12.0, -16.0, 22.0, -26.0, 32.0):
            base = lift - t * scale_t
            if all(left > end or right < begin or abs(base - other) > 9.0 for begin, end, other in taken):
                break
        taken.append((left, right, base))
        panel.note(s, t, name, color, lift=(4.0, lift), anchor="start")


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
    paths = []
    for number, entity in enumerate(enriched.entities):
        rows = np.flatnonzero((entity.motion.activity & Activity.ACTIVE) != 0)
        rows = rows[:: max(1, len(rows) // 60)]
        if len(rows):
            paths.append((number, entity.trajectory.x[rows], entity.trajectory.y[rows]))
    if paths:
        _, x, y = max(paths, key=lambda path: float(np.ptp(path[1]) + np.ptp(path[2])))
        view = view_along(x, y)
        for number, *path in paths:
            color = color_of(number) if enriched.entities[number].is_enriched else MUTED
            x, y = view.turn(*path)
            panel.line(x, y, color)
            panel.dots(x[:1], y[:1], color, size=5.0)
    return figure.svg()


# ---- over time ----
def offsets_over_time(enriched: Enriched, entities: Sequence[EntityResult]) -> Figure:
    """What was added to each entity's nominal offset, road-following segments shaded."""
    figure = Figure(len(entities), height=54.0, share_x="all", share_y="all")
    reach = max(0.5, 1.1 * max(float(np.abs(entity.deviation).max()) for entity in entities))
    for panel, entity in zip(figure.panels, entities, strict=True):
        rows = shown_rows(entity.motion)
        for span in entity.spans:
            if span.is_road_following:
                panel.across(span.start, span.end, SHADE)
        panel.level(color=NOMINAL, dashes=DASHED)
        number = [each.name for each in enriched.entities].index(entity.name)
        name = label_of(entity.name)
        panel.line(entity.motion.time[rows], entity.deviation[rows], color_of(number), label=name)
        panel.title, panel.x.label, panel.y.limits = name, "time [s]", (-reach, reach)
    figure.panels[len(entities) // 2].y.label = "offset [m]"
    return figure


def speeds_over_time(motion: NominalMotion, entities: Sequence[EntityResult] = ()) -> Figure:
    """Speed of every entity, enriched and nominal where there are results."""
    motions = [entity.motion for entity in entities] or motion.entities
    figure = Figure(height=160.0, legend=0 < len(motions) <= MOST_NAMED)
    (panel,) = figure.panels
    for number, one in enumerate(motions):
        rows = shown_rows(one)
        absent = (one.activity[rows] & Activity.ACTIVE) == 0
        speed = entities[number].trajectory.speed if entities else one.speed
        panel.line(one.time[rows], broken(speed[rows], absent), color_of(number), label=label_of(one.name))
        if entities:
            panel.line(one.time[rows], broken(one.speed[rows], absent), NOMINAL, dashes=DASHED, label="nominal")
    panel.y.holds = (0.0,)
    panel.x.label, panel.y.label = "time [s]", "speed [m/s]"
    return figure


def dynamics_over_time(entities: Sequence[EntityResult]) -> Figure:
    """Lateral acceleration and jerk of nominal and enriched path; the band is 0.5 m/s2 to both sides of nominal."""
    figure = Figure(len(entities), 2, height=72.0, share_x="all", share_y="column", legend=True)
    for number, entity in enumerate(entities):
        left, right = figure.row(number)
        nominal = lateral_dynamics(entity.motion, entity.motion)
        made = lateral_dynamics(entity.motion, entity.trajectory)
        low, high = nominal.acceleration - COMFORTABLE, nominal.acceleration + COMFORTABLE
        left.band(nominal.time, low, high, SHADE, label=f"{COMFORTABLE} m/s² from nominal")
        for panel, name in ((left, "acceleration"), (right, "jerk")):
            panel.line(made.time, getattr(made, name), ENRICHED, width=1.2, label="enriched")
            panel.line(nominal.time, getattr(nominal, name), NOMINAL, width=1.0, dashes=DASHED, label="nominal")
            panel.x.label = "time [s]"
        left.title = f"{label_of(entity.name)}: lateral acceleration [m/s²]"
        right.title = "lateral jerk [m/s³]"
    return figure


def timeline(enriched: Enriched) -> Figure:
    """When each entity follows its road, and when not."""
    count = len(enriched.entities)
    figure = Figure(height=20.0 * count)
    (panel,) = figure.panels
    for number, entity in enumerate(enriched.entities):
        for span in entity.spans:
            follows = span.is_road_following
            color = color_of(number) if follows else GRID
            panel.line((span.start, span.end), (number, number), color, width=11.0, label=span.kind.value)
            if not follows and span.end - span.start > 0.08 * enriched.motion.end_time:  # long enough to read
                panel.note(0.5 * (span.start + span.end), number, span.kind.value)
    panel.y.ticks = [(number, label_of(entity.name)) for number, entity in enumerate(enriched.entities)]
    panel.y.limits, panel.y.grid = (count - 0.5, -0.5), False
    panel.x.label = "time [s]"
    return figure


def gaps_before_and_after(pairs: Sequence[tuple[Gap | None, Gap | None]]) -> Figure:
    """Smallest gap of each pair, nominal and enriched."""
    figure = Figure(height=18.0 * len(pairs), legend=True)
    (panel,) = figure.panels
    names = []
    for number, pair in enumerate(pairs):
        gaps = [gap for gap in pair if gap is not None]
        names.append((float(number), " and ".join(map(label_of, gaps[0].names))))
        for one, other in pairwise(gaps):
            panel.line((one.distance, other.distance), (number, number), GRID, width=3.0)
        for gap, color, label in zip(pair, (NOMINAL, ENRICHED), ("nominal", "enriched"), strict=True):
            if gap is not None:
                panel.dots(gap.distance, number, color, size=7.0, label=label)
    panel.y.ticks, panel.y.limits = names, (len(pairs) - 0.5, -0.5)
    panel.x.holds, panel.x.label = (0.0,), "smallest free space [m]"
    return figure
