"""Figures of the convert report: paths from above and stretched, offsets, speeds, dynamics, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.enrich.result import Enriched, EntityResult
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.motion.nominal import Activity, EntityMotion
from xosc_lateral.report.figures import (
    AFTER,
    BEFORE,
    ENRICHED,
    GRID,
    INK,
    NOMINAL,
    PALETTE,
    SHADE,
    figure_style,
    label_of,
    new_figure,
    new_panels,
)
from xosc_lateral.report.path_dynamics import COMFORTABLE, lateral_dynamics
from xosc_lateral.report.road_drawing import View, draw_from_above, draw_stretched, view_along

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

ROW_STEP = 0.1
"""Rows that are drawn. [s]"""

MARGIN = 30.0
"""Road that is drawn before and after the paths. [m]"""


def _rows(motion: EntityMotion) -> NDArray[np.int64]:
    step = motion.time[1] - motion.time[0] if len(motion.time) > 1 else ROW_STEP
    return np.arange(0, len(motion.time), max(1, round(ROW_STEP / step)))


def _pieces(motion: EntityMotion, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Rows at which a line has to break: the entity is absent, or was placed anew since the row before."""
    bad = ((motion.activity & Activity.ACTIVE) == 0) | ((motion.activity & Activity.TELEPORTED) != 0)
    bad[0] = (motion.activity[0] & Activity.ACTIVE) == 0
    counted = np.cumsum(bad)
    return np.diff(counted[rows], prepend=int(bad[0])) > 0 if len(rows) else np.zeros(0, dtype=bool)


def _broken(values: FloatArray, breaks: NDArray[np.bool_]) -> FloatArray:
    return np.where(breaks, np.nan, values)


def color_of(number: int) -> str:
    """Colour of the entity of that number."""
    return PALETTE[number % len(PALETTE)]


@figure_style()
def paths_from_above(enriched: Enriched) -> Figure | None:
    """Nominal and enriched paths with the lanes, true to scale, turned so that they stretch from left to right.

    None when no entity is on a road.
    """
    on_road = [entity for entity in enriched.entities if (entity.motion.road >= 0).any()]
    if not on_road:
        return None
    moving = max(on_road, key=lambda each: float(np.ptp(each.motion.x) + np.ptp(each.motion.y)))
    view = view_along(moving.motion.x, moving.motion.y)
    figure, axes = new_figure(1, 1, height=2.0)
    ax = axes[0, 0]
    for road, (first, last) in _extents_on_roads(enriched).items():
        draw_from_above(ax, enriched.network, road, first - MARGIN, last + MARGIN, view)
    extent = _draw_paths(ax, enriched, view)
    ax.set_aspect("equal", adjustable="datalim")
    figure.set_figheight(float(np.clip(9.2 * extent + 0.9, 1.8, 8.0)))
    ax.set_xlabel("along the drive [m]")
    ax.set_ylabel("across [m]")
    return figure


def _draw_paths(ax: Any, enriched: Enriched, view: View) -> float:
    """Draw all paths; height over width of what they take."""
    seen_x, seen_y = [], []
    for number, entity in enumerate(enriched.entities):
        rows = _rows(entity.motion)
        breaks = _pieces(entity.motion, rows)
        x, y = view.turn(entity.motion.x[rows], entity.motion.y[rows])
        label = f"{label_of(entity.name)}, nominal"
        ax.plot(
            _broken(x, breaks), _broken(y, breaks), color=NOMINAL, linewidth=0.8, dashes=(3, 2), zorder=3, label=label
        )
        if entity.is_enriched:
            x, y = view.turn(entity.trajectory.x[rows], entity.trajectory.y[rows])
            color = color_of(number)
            ax.plot(
                _broken(x, breaks),
                _broken(y, breaks),
                color=color,
                linewidth=1.3,
                zorder=4,
                label=label_of(entity.name),
            )
        ax.plot(x[0], y[0], "o", color=color_of(number), markersize=3.5, zorder=5)
        seen_x += [x.min(), x.max()]
        seen_y += [y.min(), y.max()]
    return float(np.ptp(seen_y) / max(float(np.ptp(seen_x)), 1.0))


def _extents_on_roads(enriched: Enriched) -> dict[int, tuple[float, float]]:
    """Road -> the s that vehicles cover on it; most time spent first."""
    covered: dict[int, tuple[float, float]] = {}
    spent: dict[int, int] = {}
    for entity in enriched.entities:
        present = (entity.motion.activity & Activity.ACTIVE) != 0
        for road in np.unique(entity.motion.road[present & (entity.motion.road >= 0)]).tolist():
            s = entity.motion.s[present & (entity.motion.road == road)]
            low, high = covered.get(road, (np.inf, -np.inf))
            covered[road] = (min(low, float(s.min())), max(high, float(s.max())))
            spent[road] = spent.get(road, 0) + len(s)
    return {road: covered[road] for road in sorted(covered, key=lambda each: -spent[each])}


@figure_style()
def paths_stretched(enriched: Enriched, *, most_roads: int = 3) -> Figure | None:
    """Paths as t over s on the roads on which most time is spent; across is drawn far larger than along."""
    roads = list(_extents_on_roads(enriched).items())[:most_roads]
    if not roads:
        return None
    figure, axes = new_figure(len(roads), 1, height=3.1 * len(roads))
    for ax, (road, (first, last)) in zip(axes[:, 0], roads, strict=True):
        draw_stretched(ax, enriched.network, road, first - MARGIN, last + MARGIN)
        places = [
            place
            for number, entity in enumerate(enriched.entities)
            if (place := _draw_on_road(ax, enriched, entity, number, road)) is not None
        ]
        low, high = _shown_t(enriched, road)
        ax.set_ylim(low, high)
        ax.set_xlim(first - MARGIN, last + MARGIN)
        _label_starts(ax, places)
        ax.grid(visible=False)
        ax.set_title(f"Road {enriched.network.road_ids[road]}")
        ax.set_ylabel("t [m]")
    axes[-1, 0].set_xlabel("s along the road [m]")
    return figure


def _draw_on_road(
    ax: Any, enriched: Enriched, entity: EntityResult, number: int, road: int
) -> tuple[float, float, str, str] | None:
    """Draw one entity's way on a road; where it begins, its name and colour, if this is the road that it starts on."""
    motion = entity.motion
    rows = _rows(motion)
    here = (motion.road[rows] == road) & ((motion.activity[rows] & Activity.ACTIVE) != 0)
    if not here.any():
        return None
    kept = rows[here]
    breaks = _pieces(motion, rows)[here] | (np.diff(kept, prepend=kept[0] - 1) > 2 * (rows[-1] - rows[0]) / len(rows))
    breaks[0] = False
    nominal = enriched.network.offset_to_t(road, motion.lane[kept], motion.s[kept], motion.offset[kept])
    label = f"{label_of(entity.name)}, nominal"
    style = {"color": NOMINAL, "linewidth": 0.9, "dashes": (3, 2), "zorder": 3, "label": label}
    ax.plot(motion.s[kept], _broken(nominal, breaks), **style)
    sign = np.where(np.cos(motion.heading_relative[kept]) >= 0.0, 1.0, -1.0)
    offset = motion.offset[kept] + sign * entity.deviation[kept]
    shifted = enriched.network.offset_to_t(road, motion.lane[kept], motion.s[kept], offset)
    color = color_of(number) if entity.is_enriched else INK
    ax.plot(motion.s[kept], _broken(shifted, breaks), color=color, linewidth=1.4, zorder=4, label=label_of(entity.name))
    ax.plot(motion.s[kept[0]], shifted[0], "o", color=color, markersize=4, zorder=5)
    is_first_road = road == motion.road[np.argmax(motion.road >= 0)]
    return (float(motion.s[kept[0]]), float(shifted[0]), label_of(motion.name), color) if is_first_road else None


def _label_starts(ax: Any, places: Sequence[tuple[float, float, str, str]]) -> None:
    """Names beside the starts, each a line higher or lower where it would cover another one."""
    scale_s, scale_t = _points_per_unit(ax)
    taken: list[tuple[float, float, float]] = []
    for s, t, name, color in sorted(places):
        left, width = s * scale_s, 5.0 * len(name) + 6.0
        for lift in (5, -12, 15, -22, 25, -32):
            base = t * scale_t + lift
            if all(left > right or left + width < begin or abs(base - other) > 9.0 for begin, right, other in taken):
                break
        taken.append((left, left + width, base))
        ax.annotate(name, (s, t), (4, lift), textcoords="offset points", fontsize=8, color=color, zorder=6)


def _points_per_unit(ax: Any) -> tuple[float, float]:
    """How many points a metre takes along and across, roughly: margins are not laid out yet."""
    width, height = (72.0 * part for part in ax.figure.get_size_inches())
    n_rows = ax.get_subplotspec().get_gridspec().nrows
    return 0.9 * width / float(np.ptp(ax.get_xlim())), 0.75 * height / n_rows / float(np.ptp(ax.get_ylim()))


def _shown_t(enriched: Enriched, road: int) -> tuple[float, float]:
    """Range of t that holds the vehicles' lanes with a metre to spare."""
    low, high = np.inf, -np.inf
    for entity in enriched.entities:
        motion = entity.motion
        here = np.flatnonzero(motion.road == road)[::25]
        if len(here):
            centre = enriched.network.lane_centre_t(road, motion.lane[here], motion.s[here])
            half = 0.5 * enriched.network.lane_width(road, motion.lane[here], motion.s[here])
            low, high = min(low, float((centre - half).min())), max(high, float((centre + half).max()))
    return low - 1.0, high + 1.0


@figure_style()
def offsets_over_time(enriched: Enriched, entities: Sequence[EntityResult]) -> Figure:
    """What was added to each entity's nominal offset, road-following segments shaded."""
    figure, axes = new_panels(len(entities), sharex=True, sharey=True)
    for ax, entity in zip(axes[:, 0], entities, strict=True):
        rows = _rows(entity.motion)
        for span in entity.spans:
            if span.is_road_following:
                ax.axvspan(span.start, span.end, color=SHADE, linewidth=0, zorder=0)
        ax.axhline(0.0, color=NOMINAL, linewidth=0.9, dashes=(3, 2))
        number = [each.name for each in enriched.entities].index(entity.name)
        ax.plot(entity.motion.time[rows], entity.deviation[rows], color=color_of(number), label=label_of(entity.name))
        ax.set_title(label_of(entity.name))
    reach = max(0.5, 1.1 * max(float(np.abs(entity.deviation).max()) for entity in entities))
    axes[0, 0].set_ylim(-reach, reach)
    axes[len(entities) // 2, 0].set_ylabel("offset [m]")
    axes[-1, 0].set_xlabel("time [s]")
    return figure


@figure_style()
def speeds_over_time(enriched: Enriched) -> Figure:
    """Nominal and enriched speed."""
    figure, axes = new_figure(1, 1, height=3.0)
    ax = axes[0, 0]
    shown: list[Any] = []
    for number, entity in enumerate(enriched.entities):
        rows = _rows(entity.motion)
        absent = (entity.motion.activity[rows] & Activity.ACTIVE) == 0
        time = entity.motion.time[rows]
        speed = _broken(entity.trajectory.speed[rows], absent)
        nominal = _broken(entity.motion.speed[rows], absent)
        shown += ax.plot(time, speed, color=color_of(number), label=label_of(entity.name))
        label = f"{label_of(entity.name)}, nominal"
        ax.plot(time, nominal, color=NOMINAL, linewidth=0.9, dashes=(3, 2), label=label)
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    ax.set_xlabel("time [s]")
    ax.set_ylabel("speed [m/s]")
    if len(enriched.entities) <= 12:
        figure.legend(handles=shown, ncols=min(6, len(enriched.entities)), loc="outside upper right")
    return figure


@figure_style()
def dynamics_over_time(entities: Sequence[EntityResult]) -> Figure:
    """Lateral acceleration and jerk of nominal and enriched path; the band is 0.5 m/s2 to both sides of nominal."""
    figure, axes = new_panels(len(entities), 2, panel_height=1.0, sharex=True, sharey="col")
    for row, entity in zip(axes, entities, strict=True):
        nominal = lateral_dynamics(entity.motion, _nominal_path(entity))
        made = lateral_dynamics(entity.motion, entity.trajectory)
        low, high = nominal.acceleration - COMFORTABLE, nominal.acceleration + COMFORTABLE
        row[0].fill_between(nominal.time, low, high, color=SHADE, linewidth=0)
        for edge in (low, high):
            row[0].plot(nominal.time, edge, color=GRID, linewidth=0.8, label=f"{COMFORTABLE} m/s² from nominal")
        for ax, before, after in (
            (row[0], nominal.acceleration, made.acceleration),
            (row[1], nominal.jerk, made.jerk),
        ):
            ax.plot(made.time, after, color=ENRICHED, linewidth=1.0, label="enriched")
            ax.plot(nominal.time, before, color=NOMINAL, linewidth=1.0, dashes=(3, 2), label="nominal")
        row[0].set_title(f"{label_of(entity.name)}: lateral acceleration [m/s²]")
        row[1].set_title("lateral jerk [m/s³]")
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    return figure


def _nominal_path(entity: EntityResult) -> Any:
    """The nominal motion has the fields of a trajectory that dynamics are read from."""
    return entity.motion


@figure_style()
def timeline(enriched: Enriched) -> Figure:
    """When each entity follows its road, and when not."""
    n = len(enriched.entities)
    figure, axes = new_figure(1, 1, height=0.8 + 0.32 * n)
    ax = axes[0, 0]
    for number, entity in enumerate(enriched.entities):
        for span in entity.spans:
            ax.plot(
                [span.start, span.end],
                [number, number],
                color=color_of(number) if span.is_road_following else GRID,
                linewidth=9,
                solid_capstyle="butt",
                label=span.kind.value,
            )
            if not span.is_road_following and span.end - span.start > 0.08 * enriched.motion.end_time:
                middle = 0.5 * (span.start + span.end)
                ax.text(middle, number, span.kind.value, ha="center", va="center", fontsize=7.5)
    ax.set_yticks(range(n), [label_of(entity.name) for entity in enriched.entities])
    ax.set_ylim(n - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("time [s]")
    return figure


@figure_style()
def gaps_before_and_after(pairs: Sequence[tuple[Gap | None, Gap | None]]) -> Figure:
    """Smallest gap of each pair, nominal and enriched."""
    figure, axes = new_figure(1, 1, height=0.9 + 0.3 * len(pairs))
    ax = axes[0, 0]
    names = []
    drawn: dict[str, Any] = {}
    for number, (before, after) in enumerate(pairs):
        names.append(" and ".join(map(label_of, (before or after).names)))  # type: ignore[union-attr]
        ends = [gap.distance for gap in (before, after) if gap is not None]
        for a, b in pairwise(ends):
            ax.plot([a, b], [number, number], color=GRID, linewidth=3, zorder=1)
        for gap, color, label in ((before, BEFORE, "nominal"), (after, AFTER, "enriched")):
            if gap is not None:
                text = f"{label} {gap.distance:.2f} m at {gap.time:.1f} s"
                (drawn[label],) = ax.plot(gap.distance, number, "o", color=color, label=text, zorder=2)
    ax.set_yticks(range(len(pairs)), names)
    ax.set_ylim(len(pairs) - 0.4, -0.6)
    left, right = min(0.0, ax.get_xlim()[0]), ax.get_xlim()[1]
    ax.set_xlim(left, right + 0.02 * (right - left))  # room for the last marker, however close all gaps are
    ax.set_xlabel("smallest free space [m]")
    figure.legend(drawn.values(), drawn.keys(), ncols=2, loc="outside upper right")
    return figure
