"""Draw what a viewer finds in an OSI trace: boundaries, lanes by their ids, boxes, and where they go.

    python docs/figures/osi.py [TRACE] [SECONDS]

Without a trace that of a converted cut-in. Across is drawn four times as large as along.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral import convert, write_template
from xosc_lateral.extras.recordings.osi_trace import Trace

ALONG, ACROSS, REACH, MARGIN = 5.0, 20.0, 75.0, 16.0  # [px/m], [px/m], [m], [px]
FONT = "font-family='sans-serif' font-size='12'"


def drawing(messages: list[Any], seconds: float) -> str:
    """One moment, around its host vehicle (without one, its first), and everybody's way in the five seconds before."""
    times = np.array([one.timestamp.seconds + 1e-9 * one.timestamp.nanos for one in messages])
    row = int(np.searchsorted(times, times[0] + seconds))
    now, road = messages[row], messages[0]
    there = {one.id.value: one for one in now.moving_object}
    host = there.get(road.host_vehicle_id.value, now.moving_object[0]).base
    yaw, middle = host.orientation.yaw, np.array([host.position.x, host.position.y])
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])

    def line(points: Any, style: str) -> str:
        local = (np.array([(p.x, p.y) for p in points]) - middle) @ turn.T
        local = local[np.argsort(local[:, 0])]
        at = np.linspace(max(-REACH, local[0, 0]), min(REACH, local[-1, 0]), 31)
        across = np.interp(at, *local.T)
        words = " ".join(f"{ALONG * (x + REACH):.1f},{-ACROSS * y:.1f}" for x, y in zip(at, across, strict=True))
        return f"<polyline points='{words}' fill='none' {style}/>"

    parts, dashed = [], "stroke-dasharray='15 30'"
    for edge in road.lane_boundary:
        is_dashed = edge.classification.type == edge.classification.TYPE_DASHED_LINE
        points = [point.position for point in edge.boundary_line]
        parts.append(line(points, f"stroke='#888' stroke-width='2' {dashed if is_dashed else ''}"))
    parts += [line(one.classification.centerline, "stroke='#cde' stroke-dasharray='2 6'") for one in road.lane]
    heights = [float(word.split(",")[1]) for part in parts for word in part.split("'")[1].split()]
    for number, one in there.items():
        base = one.base
        x, y = turn @ (np.array([base.position.x, base.position.y]) - middle)
        if abs(x) > REACH:
            continue
        before = [a for m in messages[max(0, row - 500) : row : 10] for a in m.moving_object if a.id.value == number]
        parts.append(line([a.base.position for a in before], "stroke='#c40'"))
        wide, high = ALONG * base.dimension.length, ACROSS * base.dimension.width
        left, top = ALONG * (x + REACH) - 0.5 * wide, -ACROSS * y - 0.5 * high
        name = one.source_reference[0].identifier[-1]
        lanes = ", ".join(str(lane.value) for lane in one.assigned_lane_id)
        parts.append(
            f"<rect x='{left:.1f}' y='{top:.1f}' width='{wide:.1f}' height='{high:.1f}' fill='#048' opacity='0.8'/>"
            f"<text x='{left:.1f}' y='{top - 4:.1f}' {FONT}>{number} {name}, lane {lanes}</text>"
        )
    top, high = min(heights) - 2 * MARGIN, max(heights) - min(heights) + 4 * MARGIN
    size = f"viewBox='0 {top:.0f} {2 * REACH * ALONG:.0f} {high:.0f}'"
    return f"<svg xmlns='http://www.w3.org/2000/svg' {size}>\n" + "\n".join(parts) + "\n</svg>\n"


def main() -> None:
    """Write the picture beside this file."""
    parser = argparse.ArgumentParser()
    parser.add_argument("trace", nargs="?", type=Path)
    parser.add_argument("seconds", nargs="?", type=float, default=12.5)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        trace = asked.trace
        if trace is None:
            scenario = write_template("cut-in", folder)[0]
            trace = convert(scenario, Path(folder) / "out.xosc", seed=1).write_osi(Path(folder) / "out_gt.mcap")[0]
        with Trace(trace) as messages:
            made = drawing(list(messages), asked.seconds)
    Path(__file__).with_suffix(".svg").write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
