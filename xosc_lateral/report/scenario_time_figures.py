"""Figures of the convert report over time: offsets, speeds, lateral dynamics, segments, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.enrich.result import Enriched, EntityResult
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.motion.segments import SegmentSpan
from xosc_lateral.report.figures import (
    AFTER,
    BEFORE,
    ENRICHED,
    GRID,
    NOMINAL,
    SHADE,
    figure_style,
    label_of,
    new_figure,
    new_panels,
)
from xosc_lateral.report.path_dynamics import COMFORTABLE, lateral_dynamics
from xosc_lateral.report.scenario_figures import broken, color_of, shown_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@figure_style()
def offsets_over_time(enriched: Enriched, entities: Sequence[EntityResult]) -> Figure:
    """What was added to each entity's nominal offset, road-following segments shaded."""
    figure, axes = new_panels(len(entities), sharex=True, sharey=True)
    for ax, entity in zip(axes[:, 0], entities, strict=True):
        rows = shown_rows(entity.motion)
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
        shown += _draw_speed(ax, entity, number)
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    ax.set_xlabel("time [s]")
    ax.set_ylabel("speed [m/s]")
    if len(enriched.entities) <= 12:
        figure.legend(handles=shown, ncols=min(6, len(enriched.entities)), loc="outside upper right")
    return figure


def _draw_speed(ax: Axes, entity: EntityResult, number: int) -> list[Any]:
    """Nominal and enriched; the line of the latter."""
    rows = shown_rows(entity.motion)
    absent = (entity.motion.activity[rows] & Activity.ACTIVE) == 0
    time = entity.motion.time[rows]
    speed = broken(entity.trajectory.speed[rows], absent)
    nominal = broken(entity.motion.speed[rows], absent)
    line: list[Any] = ax.plot(time, speed, color=color_of(number), label=label_of(entity.name))
    label = f"{label_of(entity.name)}, nominal"
    ax.plot(time, nominal, color=NOMINAL, linewidth=0.9, dashes=(3, 2), label=label)
    return line


@figure_style()
def dynamics_over_time(entities: Sequence[EntityResult]) -> Figure:
    """Lateral acceleration and jerk of nominal and enriched path; the band is 0.5 m/s2 to both sides of nominal."""
    figure, axes = new_panels(len(entities), 2, panel_height=1.0, sharex=True, sharey="col")
    for row, entity in zip(axes, entities, strict=True):
        _draw_dynamics(row, entity)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    return figure


def _draw_dynamics(row: Sequence[Axes], entity: EntityResult) -> None:
    """One entity's acceleration and jerk, beside each other."""
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
            _draw_span(ax, span, number, 0.08 * enriched.motion.end_time)
    ax.set_yticks(range(n), [label_of(entity.name) for entity in enriched.entities])
    ax.set_ylim(n - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("time [s]")
    return figure


def _draw_span(ax: Axes, span: SegmentSpan, number: int, long: float) -> None:
    """A bar, and why it is none of road-following, if it is `long` enough to read. [s]"""
    ax.plot(
        [span.start, span.end],
        [number, number],
        color=color_of(number) if span.is_road_following else GRID,
        linewidth=9,
        solid_capstyle="butt",
        label=span.kind.value,
    )
    if not span.is_road_following and span.end - span.start > long:
        middle = 0.5 * (span.start + span.end)
        ax.text(middle, number, span.kind.value, ha="center", va="center", fontsize=7.5)


@figure_style()
def gaps_before_and_after(pairs: Sequence[tuple[Gap | None, Gap | None]]) -> Figure:
    """Smallest gap of each pair, nominal and enriched."""
    figure, axes = new_figure(1, 1, height=0.9 + 0.3 * len(pairs))
    ax = axes[0, 0]
    names = []
    drawn: dict[str, Any] = {}
    for number, (before, after) in enumerate(pairs):
        names.append(" and ".join(map(label_of, (before or after).names)))  # type: ignore[union-attr]
        drawn |= _draw_gaps(ax, before, after, number)
    ax.set_yticks(range(len(pairs)), names)
    ax.set_ylim(len(pairs) - 0.4, -0.6)
    left, right = min(0.0, ax.get_xlim()[0]), ax.get_xlim()[1]
    ax.set_xlim(left, right + 0.02 * (right - left))  # room for the last marker, however close all gaps are
    ax.set_xlabel("smallest free space [m]")
    figure.legend(drawn.values(), drawn.keys(), ncols=2, loc="outside upper right")
    return figure


def _draw_gaps(ax: Axes, before: Gap | None, after: Gap | None, number: int) -> dict[str, Any]:
    """One pair's, joined by a line; the markers by what they are."""
    ends = [gap.distance for gap in (before, after) if gap is not None]
    for a, b in pairwise(ends):
        ax.plot([a, b], [number, number], color=GRID, linewidth=3, zorder=1)
    drawn: dict[str, Any] = {}
    for gap, color, label in ((before, BEFORE, "nominal"), (after, AFTER, "enriched")):
        if gap is not None:
            text = f"{label} {gap.distance:.2f} m at {gap.time:.1f} s"
            (drawn[label],) = ax.plot(gap.distance, number, "o", color=color, label=text, zorder=2)
    return drawn
