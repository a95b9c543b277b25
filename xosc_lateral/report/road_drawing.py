"""Roads in figures: lane edges and markings, from above and stretched along s."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.report.figures import GRID, MUTED, SHADE
from xosc_lateral.road import RoadNetwork

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

STEP = 4.0
"""Between two points of a drawn line. [m]"""


class View(NamedTuple):
    """A turned look from above: `x`, `y` of the middle go to 0, and `angle` [rad] to the horizontal."""

    x: float
    y: float
    angle: float

    def turn(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """World to figure. [m]"""
        turned = (np.asarray(x) - self.x + 1j * (np.asarray(y) - self.y)) * np.exp(-1j * self.angle)
        return turned.real, turned.imag


class EdgeLine(NamedTuple):
    """Edge of a lane along a road: `t` [m] over `s` [m], and how it is drawn."""

    s: FloatArray
    t: FloatArray
    style: dict[str, Any]


def view_along(x: FloatArray, y: FloatArray) -> View:
    """The view in which the points stretch from left to right; the first of them on the left."""
    points = np.column_stack([x, y])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    if len(points) < 2 or not np.ptp(points, axis=0).any():
        return View(float(middle[0]), float(middle[1]), 0.0)
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    along = axes[0] * np.sign((points[-1] - points[0]) @ axes[0] or 1.0)
    return View(float(middle[0]), float(middle[1]), float(np.arctan2(along[1], along[0])))


def edge_lines(network: RoadNetwork, road: int, first: float, last: float) -> Iterator[EdgeLine]:
    """Edges of the driving lanes, and markings, of one road between two s."""
    for s, right, left in _lane_surfaces(network, road, first, last):
        for t in (right, left):
            yield EdgeLine(s, t, {"color": GRID, "linewidth": 0.8, "zorder": 1})
    for mark in network.road_marks(road):
        s = _grid(max(first, mark.s_start), min(last, mark.s_end))
        if len(s):
            outer = 0.5 * np.sign(mark.lane) * network.lane_width(road, mark.lane, s) if mark.lane else 0.0
            dashes = {"dashes": (4, 3)} if "broken" in mark.type else {}
            style = {"color": MUTED, "linewidth": 0.9, "zorder": 2, **dashes}
            yield EdgeLine(s, network.lane_centre_t(road, mark.lane, s) + outer, style)


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


def draw_from_above(axes: Axes, network: RoadNetwork, road: int, first: float, last: float, view: View) -> None:
    """Lane edges and markings of a stretch of a road, in the view's frame."""
    for line in edge_lines(network, road, first, last):
        poses = network.road_to_world(road, line.s, line.t)
        axes.plot(*view.turn(poses.x, poses.y), **line.style)


def draw_stretched(axes: Axes, network: RoadNetwork, road: int, first: float, last: float) -> None:
    """Lanes and markings as t over s."""
    for s, right, left in _lane_surfaces(network, road, first, last):
        axes.fill_between(s, right, left, color=SHADE, linewidth=0, zorder=0)
    for line in edge_lines(network, road, first, last):
        axes.plot(line.s, line.t, **line.style)
