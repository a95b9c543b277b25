"""Figures: panels in rows and columns, written as SVG without a plotting package. Same figure, same bytes.

Texts are laid out by an estimate of their width, which is what a browser's own font leaves open anyway.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Literal

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.pages.chart import (
    GRID,
    INK,
    MUTED,
    PALETTE,
    PAPER,
    SHADE,
    Axis,
    Panel,
    fill_of,
    panel_svg,
    stroke_of,
    ticks_of,
)

CSS_VARIABLES: Mapping[str, str] = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    SHADE: "--shade",
    PAPER: "--paper",
    **{color: f"--series-{number}" for number, color in enumerate(PALETTE, start=1)},
}
"""A colour of the light theme -> what `page.css` calls it."""

FONT = "system-ui, sans-serif"

# Size of texts; heights of a title, an axis' label, a row of the legend, the numbers below a panel. [pt]
TEXT_SIZE, TITLE_HEIGHT, LABEL_HEIGHT, LEGEND_HEIGHT, NUMBERS_HEIGHT = 9.0, 17.0, 14.0, 17.0, 12.0

PANEL_SPACING = 9.0  # Free space between panels, and around them. [pt]
AXIS_PADDING = 0.04  # Share of an axis that is left free on either side of the data. [-]
FIGURE_WIDTH = 660.0  # Width of a figure that fills the text column. [pt]


def text_width(text: str) -> float:
    """Of a text in a sans-serif font, estimated: 0.56 of its size a letter, wide scripts its size. [pt]"""
    return TEXT_SIZE * sum(1.0 if unicodedata.east_asian_width(letter) in "WF" else 0.56 for letter in text)


@dataclass(slots=True, repr=False)
class Figure:
    """Panels in rows and columns."""

    rows: int = 1
    columns: int = 1
    height: float = 150.0  # Of one panel without its title and labels. [pt]
    width: float = FIGURE_WIDTH  # Of the whole figure. [pt]
    share_x: Literal["", "all"] = ""
    share_y: Literal["", "all"] = ""
    """Whether all panels have the same limits; tick labels stand once then, below each column or beside each row."""
    legend: bool = False  # Whether labels are explained above the panels.
    axes: bool = True  # Whether there are ticks, labels and a frame.
    panels: list[Panel] = field(init=False)

    def __post_init__(self) -> None:
        self.panels = [Panel() for _ in range(self.rows * self.columns)]

    def row(self, number: int) -> list[Panel]:
        """Panels beside one another."""
        return self.panels[number * self.columns : (number + 1) * self.columns]

    def svg(self) -> str:
        """The figure as SVG document, on white."""
        return svg_of(self)

    def __repr__(self) -> str:
        return f"<Figure {'; '.join(panel.title or panel.y.label for panel in self.panels)}>"

    def _repr_svg_(self) -> str:
        return self.svg()

    def save(self, path: str | Path) -> Path:
        """Write an SVG file."""
        from xosc_lateral.files.atomic import write_atomically

        return write_atomically(Path(path), self.svg())

    def settle(self) -> None:
        """Give every axis its limits."""
        for name, shared in (("x", self.share_x), ("y", self.share_y)):
            for group in [self.panels] if shared else [[panel] for panel in self.panels]:
                axes: list[Axis] = [getattr(panel, name) for panel in group]
                drawn = [getattr(mark, name) for panel in group for mark in panel.marks]
                held = [value for axis in axes for value in axis.holds]
                fixed = next((axis.limits for axis in axes if axis.limits is not None), None)
                limits = fixed or _limits(np.concatenate([*drawn, held]), axes[0].log)
                for axis in axes:
                    axis.limits = axis.limits or limits


def _limits(values: FloatArray, log: bool) -> tuple[float, float]:
    """What holds all finite values, with some space around."""
    seen = values[np.isfinite(values) & (values > 0.0)] if log else values[np.isfinite(values)]
    if not len(seen):
        return (1.0, 10.0) if log else (0.0, 1.0)
    low, high = float(seen.min()), float(seen.max())
    if log:
        room = (high / low) ** AXIS_PADDING if high > low else 2.0
        return low / room, high * room
    room = AXIS_PADDING * (high - low) or max(abs(high), 1.0) * AXIS_PADDING
    return low - room, high + room


# ---- layout ----
def svg_of(figure: Figure, alt: str = "", *, themed: bool = False) -> str:
    """The SVG element, with words for those who can't see it; `themed`: colours and font are the page's."""
    figure.settle()
    left, right = _margins(figure)
    inner = (figure.width - sum(left) - right - (figure.columns - 1) * PANEL_SPACING) / figure.columns
    body, height = _body(figure, left, inner)
    head = f'viewBox="0 0 {figure.width:g} {height:g}" role="img" aria-label="{escape(alt)}" font-size="{TEXT_SIZE:g}"'
    title = f"<title>{escape(alt)}</title>" if alt else ""
    if themed:
        body = re.sub(r'"(#[0-9a-f]{6})"', lambda m: f'"var({CSS_VARIABLES[m[1]]})"', body)
        return f'<svg {head} font-family="var(--sans)">{title}{body}</svg>'
    size = f'width="{figure.width:g}pt" height="{height:g}pt" font-family="{FONT}"'
    back = f'<rect width="100%" height="100%" fill="{PAPER}"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {head} {size}>{title}{back}{body}</svg>'


def _margins(figure: Figure) -> tuple[list[float], float]:
    """Room for numbers and names to the left of each column, and to the right of all. [pt]"""
    if not figure.axes:
        return [4.0] * figure.columns, 4.0
    left = []
    for column in range(figure.columns):
        panels = [panel for panel in figure.panels[column :: figure.columns] if panel.marks]
        widths = [text_width(name) for panel in panels for _, name in ticks_of(panel, "y", figure.height)]
        numbers = max(widths, default=0.0) + 7.0 if column == 0 or not figure.share_y else 2.0
        left.append(numbers + (16.0 if any(panel.y.label for panel in panels) else 0.0))
    return left, PANEL_SPACING + 3.0


def _body(figure: Figure, left: list[float], inner: float) -> tuple[str, float]:
    """All panels and the legend; the height that they take. [pt]"""
    legend, top = _legend(figure, left[0]) if figure.legend else ("", 0.0)
    parts = [legend]
    edge = PANEL_SPACING if figure.axes else 4.0
    top += edge
    for number in range(figure.rows):
        panels = figure.row(number)
        below = [
            figure.panels[(number + 1) * figure.columns + column :: figure.columns] for column in range(len(panels))
        ]
        numbered = [not figure.share_x or not any(each.marks for each in others) for others in below]
        top += TITLE_HEIGHT if any(panel.title for panel in panels) else 0.0
        at = 0.0
        for column, panel in enumerate(panels):
            at += left[column]
            if panel.marks:
                room = left[column] if column == 0 or not figure.share_y else 0.0
                parts += _frame(panel, at, top, inner, figure.height, room, numbered[column]) if figure.axes else []
                parts.append(panel_svg(panel, at, top, inner, figure.height))
            at += inner + PANEL_SPACING
        top += figure.height + edge
        if figure.axes and any(numbered):
            top += NUMBERS_HEIGHT + (LABEL_HEIGHT if any(panel.x.label for panel in panels) else 0.0)
    return "".join(parts), round(top, 1)


def _text(x: float, y: float, text: str, anchor: str = "middle", more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{INK}"{more}>{escape(text)}</text>'


def _legend(figure: Figure, left: float) -> tuple[str, float]:
    """A key for each label, in rows, and their height. [pt]"""
    keys = {mark.label: mark for panel in figure.panels for mark in panel.marks if mark.label}
    parts, x, y = [], left, LEGEND_HEIGHT
    for label, mark in keys.items():
        needed = text_width(label) + 34.0
        if x + needed > figure.width and x > left:
            x, y = left, y + LEGEND_HEIGHT
        if mark.kind == "dots":
            parts.append(f'<circle cx="{x + 8:.1f}" cy="{y - 3:.1f}" r="{0.5 * mark.width:g}" fill="{mark.color}"/>')
        elif mark.kind == "area":
            parts.append(f'<path d="M {x:.1f} {y - 7:.1f} h 16 v 8 h -16 Z" {fill_of(mark)}/>')
        else:
            parts.append(f'<path d="M {x:.1f} {y - 3:.1f} h 16" {stroke_of(mark)}/>')
        parts.append(_text(x + 20.0, y, label, "start"))
        x += needed
    return "".join(parts), y if keys else 0.0


def _frame(
    panel: Panel, left: float, top: float, width: float, height: float, room: float, numbered: bool
) -> list[str]:
    """Grid, axes, numbers and names; `room`: for those of y; `numbered`: whether numbers of x stand below."""
    bottom = top + height
    x_ticks, y_ticks = ticks_of(panel, "x", width), ticks_of(panel, "y", height)
    lines = [f"M {left + width * at:.1f} {top:.1f} v {height:.1f}" for at, _ in x_ticks if panel.x.grid]
    lines += [f"M {left:.1f} {bottom - height * at:.1f} h {width:.1f}" for at, _ in y_ticks if panel.y.grid]
    axes = f"M {left:.1f} {top:.1f} v {height:.1f} h {width:.1f}"
    parts = [
        f'<path d="{line}" fill="none" stroke="{color}" stroke-width="0.8"/>'
        for line, color in ((" ".join(lines), GRID), (axes, MUTED))
        if line
    ]
    if panel.title:
        parts.append(_text(left, top - 5.0, panel.title, "start", ' font-weight="600"'))
    if numbered:
        parts += [_text(left + width * at, bottom + 11.0, name) for at, name in x_ticks]
        parts.append(_text(left + 0.5 * width, bottom + 24.0, panel.x.label) if panel.x.label else "")
    if room:
        parts += [_text(left - 5.0, bottom - height * at + 3.0, name, "end") for at, name in y_ticks]
    if panel.y.label:
        turned = f' transform="translate({left - room + 11:.1f} {top + 0.5 * height:.1f}) rotate(-90)"'
        parts.append(_text(0.0, 0.0, panel.y.label, more=turned))
    return parts
