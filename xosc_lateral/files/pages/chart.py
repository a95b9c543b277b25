"""A panel of a figure: lines, areas and dots over linear or logarithmic axes, and how they become SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from xosc_lateral.base.arrays import FloatArray, true_slices

Ticks = list[tuple[float, str]]

# Okabe and Ito, "Color universal design" (2008), and six more. Each of these was chosen as the colour farthest from all
# before it (CIEDE2000, the smallest over normal vision and the three kinds of colour blindness as simulated by Machado,
# Oliveira and Fernandes, IEEE TVCG 15(6), 2009). `tests/files/pages/test_palette.py` measures all twelve, both ways.
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"
PALETTE = (
    *(BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY),
    *("#781e4b", "#a50000", "#2d1ec3", "#5a694b", "#846078", "#b4b4a8"),
)
INK, MUTED, GRID, SHADE, PAPER = "#1b2126", "#646d75", "#dde1e4", "#eef1f3", "#ffffff"

# The same thing has the same colour in every report.
MEASURED, SAMPLED = BLUE, VERMILLION
NOMINAL, ENRICHED = MUTED, BLUE

TICK_SPACING = {"x": 62.0, "y": 20.0}  # Between two ticks, at least. [pt]
DASHED = "3 2"  # Strokes and gaps of a dashed line. [pt]

LONGEST_NAME = 40
"""Longer names are cut in figures, which they would leave no room for; the page's tables have them whole."""


def label_of(name: str) -> str:
    """An entity's name as figures have it."""
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


def color_of(number: int) -> str:
    """Colour of the entity, or profile, of that number."""
    return PALETTE[number % len(PALETTE)]


@dataclass(slots=True)
class Axis:
    """One direction of a panel: what it is called, what it shows."""

    label: str = ""
    log: bool = False
    limits: tuple[float, float] | None = None  # From the data if None; may run from high to low.
    holds: tuple[float, ...] = ()  # Values that limits from the data include at least.
    ticks: Sequence[tuple[float, str]] | None = None  # Places and names; numbers if None.
    grid: bool = True

    @property
    def ends(self) -> tuple[float, float]:
        """The limits of an axis that has them."""
        assert self.limits is not None, "`Figure.settle` gives every axis its limits"
        return self.limits

    def share(self, values: ArrayLike) -> FloatArray:
        """Where values lie between both limits, 0 to 1. [-]"""
        scaled = np.log10 if self.log else np.asarray
        with np.errstate(invalid="ignore", divide="ignore"):
            low, high, places = (scaled(np.asarray(each, dtype=np.float64)) for each in (*self.ends, values))
            return np.asarray((places - low) / (high - low))


@dataclass(slots=True)
class Mark:
    """Something drawn in a panel; infinite places are the panel's edges."""

    kind: Literal["line", "area", "dots"]
    x: FloatArray
    y: FloatArray
    color: str
    width: float = 1.5  # Of a line, diameter of a dot. [pt]
    dashes: str = ""
    opacity: float = 1.0
    label: str = ""  # Shown in the legend, and when somebody points at it.


@dataclass(slots=True)
class Panel:
    """A pair of axes and what is drawn in it, from the bottom up."""

    title: str = ""
    x: Axis = field(default_factory=Axis)
    y: Axis = field(default_factory=Axis)
    marks: list[Mark] = field(default_factory=list)

    def line(self, x: ArrayLike, y: ArrayLike, color: str, **style: Any) -> None:
        """Draw a line, broken where a value is NaN; `width`, `dashes`, `label` as in `Mark`."""
        self._add("line", x, y, color, **style)

    def dots(self, x: ArrayLike, y: ArrayLike, color: str, *, size: float = 4.0, label: str = "") -> None:
        """Draw a dot at each place."""
        self._add("dots", x, y, color, width=size, label=label)

    def area(self, x: ArrayLike, y: ArrayLike, color: str, *, opacity: float = 1.0, label: str = "") -> None:
        """Fill a polygon."""
        self._add("area", x, y, color, opacity=opacity, label=label)

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str, **style: Any) -> None:
        """Fill between two curves over x, but where one of them is NaN."""
        x, low, high = np.broadcast_arrays(*(np.asarray(each, dtype=np.float64) for each in (x, low, high)))
        for part in true_slices(np.isfinite(low) & np.isfinite(high)):
            self.area(np.r_[x[part], x[part][::-1]], np.r_[low[part], high[part][::-1]], color, **style)

    def across(self, first: float, last: float, color: str, **style: Any) -> None:
        """Fill from one x to another, over the whole height."""
        self.area((first, last, last, first), (-np.inf, -np.inf, np.inf, np.inf), color, **style)

    def level(self, y: float = 0.0, color: str = GRID, *, dashes: str = "") -> None:
        """Draw a thin line over the whole width."""
        self._add("line", (-np.inf, np.inf), (y, y), color, width=0.8, dashes=dashes)

    def steps(self, edges: FloatArray, heights: FloatArray, color: str, *, label: str = "") -> None:
        """Draw a histogram: heights, shape (n,), between edges, shape (n + 1,)."""
        x, y = np.repeat(edges, 2), np.r_[0.0, np.repeat(heights, 2), 0.0]
        self.area(x, y, color, opacity=0.5)
        self._add("line", x, y, color, width=1.0, label=label)

    def curves(self, label: str = "") -> list[Mark]:
        """What is drawn as a line or as dots, under that label or any."""
        return [mark for mark in self.marks if mark.kind in ("line", "dots") and label in ("", mark.label)]

    def _add(self, kind: Literal["line", "area", "dots"], x: ArrayLike, y: ArrayLike, color: str, **style: Any) -> None:
        places = [np.atleast_1d(np.asarray(each, dtype=np.float64)) for each in (x, y)]
        self.marks.append(Mark(kind, places[0], places[1], color, **style))


# ---- ticks ----
def ticks_of(panel: Panel, name: str, length: float) -> Ticks:
    """Where ticks stand, 0 to 1, and what is written there."""
    axis: Axis = getattr(panel, name)
    if axis.ticks is not None:
        ticks = [(float(axis.share(value)), text) for value, text in axis.ticks]
    else:
        values = (
            _log_places(*axis.ends) if axis.log else _linear_places(*axis.ends, max(2.0, length / TICK_SPACING[name]))
        )
        texts = [_power(value) for value in values.tolist()] if axis.log else _numbers(values)
        ticks = list(zip(axis.share(values).tolist(), texts, strict=True))
    return [(at, text) for at, text in ticks if -1e-6 <= at <= 1.0 + 1e-6]


def _linear_places(first: float, last: float, count: float) -> FloatArray:
    """Multiples of 1, 2 or 5 times a power of ten, at most so many; a finer step where one alone would be there."""
    low, high = min(first, last), max(first, last)
    rough = (high - low) / count
    steps = 10.0 ** np.floor(np.log10(rough)) * np.array([0.5, 1.0, 2.0, 5.0, 10.0])
    enough = 1 + int(np.argmax(steps[1:] >= rough * (1.0 - 1e-9)))
    for step in steps[[enough, enough - 1]]:
        places = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) + 0.0
        if len(places) > 1:
            break
    return np.asarray(places)


def _log_places(first: float, last: float) -> FloatArray:
    """Powers of ten, every second or more if there are many; 1, 2 and 5 times these if there are few."""
    low, high = min(first, last), max(first, last)
    begin, end = np.log10(low), np.log10(high)
    every = max(1.0, np.ceil((end - begin) / 8.0))
    powers = 10.0 ** np.arange(np.ceil(begin / every - 1e-9) * every, end + 1e-9, every)
    if len(powers) > 2:
        return np.asarray(powers)
    fine = np.outer(10.0 ** np.arange(np.floor(begin), np.ceil(end) + 1.0), (1.0, 2.0, 5.0)).ravel()
    return np.asarray(fine[(fine >= low) & (fine <= high)])


def _numbers(values: FloatArray) -> list[str]:
    """With as many digits as the steps between them ask for."""
    largest = float(np.abs(values).max(initial=0.0))
    if largest >= 1e6 or 0.0 < largest < 1e-3:
        return [f"{value:.3g}" for value in values.tolist()]
    step = float(np.diff(values).min()) if len(values) > 1 else largest
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9))) if step else 0
    return [f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}") for value in values.tolist()]


def _power(value: float) -> str:
    """``0.01``, ``100``, ``10⁻⁵``."""
    exponent = int(np.floor(np.log10(value) + 1e-9))
    if -4 < exponent < 5:
        return f"{value:g}"
    raised = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    factor = round(value / 10.0**exponent)
    return f"10{raised}" if factor == 1 else f"{factor}·10{raised}"


# ---- marks ----
def panel_svg(panel: Panel, left: float, top: float, width: float, height: float) -> str:
    """What is drawn in a panel, in coordinates of its own, with what the page's script has to know to read values."""
    about = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    for name, axis in (("x", panel.x), ("y", panel.y)):
        low, high = axis.ends
        about += f' data-{name}="{low:.9g} {high:.9g}{" log" if axis.log else ""}"'
        about += f' data-{name}-label="{escape(axis.label)}"' if axis.label else ""
    about += f' data-title="{escape(panel.title)}"' if panel.title else ""
    return f'<svg class="panel" {about}>{"".join(_mark(panel, mark, width, height) for mark in panel.marks)}</svg>'


def _mark(panel: Panel, mark: Mark, width: float, height: float) -> str:
    far = 1e4  # beyond any edge, where infinite places are drawn [pt]
    x = np.clip(width * panel.x.share(mark.x), -far, far)
    y = np.clip(height * (1.0 - panel.y.share(mark.y)), -far, far)
    label = f' data-label="{escape(mark.label)}"' if mark.label else ""
    if mark.kind == "area":
        return f'<path d="{_path(x, y)} Z" {fill_of(mark)}/>'
    seen = np.isfinite(x) & np.isfinite(y)
    if mark.kind == "dots":
        places = zip(x[seen].tolist(), y[seen].tolist(), strict=True)
        dots = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{0.5 * mark.width:g}"/>' for a, b in places)
        return f'<g fill="{mark.color}"{label}>{dots}</g>'
    line = " ".join(_path(*_thinned(x[part], y[part])) for part in true_slices(seen))
    return f'<path d="{line}" {stroke_of(mark)}{label}/>'


def stroke_of(mark: Mark) -> str:
    """Attributes of a line."""
    dashes = f' stroke-dasharray="{mark.dashes}"' if mark.dashes else ""
    return f'fill="none" stroke="{mark.color}" stroke-width="{mark.width:g}" stroke-linejoin="round"{dashes}'


def fill_of(mark: Mark) -> str:
    """Attributes of an area."""
    return f'fill="{mark.color}"' + (f' fill-opacity="{mark.opacity:g}"' if mark.opacity < 1.0 else "")


def _path(x: FloatArray, y: FloatArray) -> str:
    """A line through the points, to a tenth of a point, without those that look the same."""
    places = np.round(np.column_stack([x, y]), 1) + 0.0
    kept = np.append(True, np.any(np.diff(places, axis=0) != 0.0, axis=1))
    return "M " + " L ".join(f"{a:g} {b:g}" for a, b in places[kept].tolist())


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of more than four points in half a point's width, the first, the last, the lowest and the highest."""
    column = np.floor(2.0 * x)
    if len(x) < 8 or len(np.unique(column)) * 4 > len(x) or np.any(np.diff(x) < 0.0):
        return x, y
    starts = np.flatnonzero(np.append(True, np.diff(column) != 0.0))
    ends = np.append(starts[1:], len(x)) - 1
    order = np.lexsort((y, column))
    kept = np.unique(np.concatenate([starts, ends, order[starts], order[ends]]))
    return x[kept], y[kept]
