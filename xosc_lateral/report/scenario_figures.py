"""Figures of the convert report over the road: paths from above, and stretched."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.enrich.result import Enriched, EntityResult
from xosc_lateral.motion.nominal import Activity, EntityMotion
from xosc_lateral.report.figures import (
    INK,
    NOMINAL,
    PALETTE,
    figure_style,
    label_of,
    new_figure,
)
from xosc_lateral.report.road_drawing import View, draw_from_above, draw_stretched, view_along

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

ROW_STEP = 0.1
"""Rows that are drawn. [s]"""

MARGIN = 30.0
"""Road that is drawn before and after the paths. [m]"""


def shown_rows(motion: EntityMotion) -> NDArray[np.int64]:
    """Rows that are drawn, 0.1 s apart, shape (k,)."""
    step = motion.time[1] - motion.time[0] if len(motion.time) > 1 else ROW_STEP
    return np.arange(0, len(motion.time), max(1, round(ROW_STEP / step)))


def _pieces(motion: EntityMotion, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Rows at which a line has to break: the entity is absent, or was placed anew since the row before."""
    bad = ((motion.activity & Activity.ACTIVE) == 0) | ((motion.activity & Activity.TELEPORTED) != 0)
    bad[0] = (motion.activity[0] & Activity.ACTIVE) == 0
    counted = np.cumsum(bad)
    return np.diff(counted[rows], prepend=int(bad[0])) > 0 if len(rows) else np.zeros(0, dtype=bool)


def broken(values: FloatArray, breaks: NDArray[np.bool_]) -> FloatArray:
    """NaN where a line has to break, shape (k,). [unit of the values]"""
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
    _fit_to(figure, ax, extent)
    return figure


def _fit_to(figure: Figure, ax: Axes, extent: float) -> None:
    """True to scale, and as high as the paths take; `extent`: their height over their width."""
    ax.set_aspect("equal", adjustable="datalim")
    figure.set_figheight(float(np.clip(9.2 * extent + 0.9, 1.8, 8.0)))
    ax.set_xlabel("along the drive [m]")
    ax.set_ylabel("across [m]")


def _draw_paths(ax: Any, enriched: Enriched, view: View) -> float:
    """Draw all paths; height over width of what they take."""
    seen_x, seen_y = [], []
    for number, entity in enumerate(enriched.entities):
        x, y = _draw_path(ax, entity, number, view)
        seen_x += [x.min(), x.max()]
        seen_y += [y.min(), y.max()]
    return float(np.ptp(seen_y) / max(float(np.ptp(seen_x)), 1.0))


def _draw_path(ax: Any, entity: EntityResult, number: int, view: View) -> tuple[FloatArray, FloatArray]:
    """One entity, nominal and enriched; where it goes. [m]"""
    rows = shown_rows(entity.motion)
    breaks = _pieces(entity.motion, rows)
    x, y = view.turn(entity.motion.x[rows], entity.motion.y[rows])
    label = f"{label_of(entity.name)}, nominal"
    ax.plot(broken(x, breaks), broken(y, breaks), color=NOMINAL, linewidth=0.8, dashes=(3, 2), zorder=3, label=label)
    if entity.is_enriched:
        x, y = view.turn(entity.trajectory.x[rows], entity.trajectory.y[rows])
        style = {"color": color_of(number), "linewidth": 1.3, "zorder": 4, "label": label_of(entity.name)}
        ax.plot(broken(x, breaks), broken(y, breaks), **style)
    ax.plot(x[0], y[0], "o", color=color_of(number), markersize=3.5, zorder=5)
    return x, y


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
        _draw_road(ax, enriched, road, first, last)
    axes[-1, 0].set_xlabel("s along the road [m]")
    return figure


def _draw_road(ax: Axes, enriched: Enriched, road: int, first: float, last: float) -> None:
    """One road with all that drive on it, `first` to `last` along it. [m]"""
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


def _draw_on_road(
    ax: Any, enriched: Enriched, entity: EntityResult, number: int, road: int
) -> tuple[float, float, str, str] | None:
    """Draw one entity's way on a road; where it begins, its name and colour, if this is the road that it starts on."""
    motion = entity.motion
    rows = shown_rows(motion)
    here = (motion.road[rows] == road) & ((motion.activity[rows] & Activity.ACTIVE) != 0)
    if not here.any():
        return None
    kept = rows[here]
    breaks = _pieces(motion, rows)[here] | (np.diff(kept, prepend=kept[0] - 1) > 2 * (rows[-1] - rows[0]) / len(rows))
    breaks[0] = False
    nominal = enriched.network.offset_to_t(road, motion.lane[kept], motion.s[kept], motion.offset[kept])
    label = f"{label_of(entity.name)}, nominal"
    style = {"color": NOMINAL, "linewidth": 0.9, "dashes": (3, 2), "zorder": 3, "label": label}
    ax.plot(motion.s[kept], broken(nominal, breaks), **style)
    sign = np.where(np.cos(motion.heading_relative[kept]) >= 0.0, 1.0, -1.0)
    offset = motion.offset[kept] + sign * entity.deviation[kept]
    shifted = enriched.network.offset_to_t(road, motion.lane[kept], motion.s[kept], offset)
    color = color_of(number) if entity.is_enriched else INK
    ax.plot(motion.s[kept], broken(shifted, breaks), color=color, linewidth=1.4, zorder=4, label=label_of(entity.name))
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
