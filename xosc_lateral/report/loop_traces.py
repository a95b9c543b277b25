"""Offsets over time as they were measured, beside held-out runs of the profile before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.close import LoopResult
from xosc_lateral.identification.cross_validation import hold_out_blocks
from xosc_lateral.identification.timeline import Timeline
from xosc_lateral.report.figures import GRID, figure_style, new_panels
from xosc_lateral.report.loop_figures import AFTER, BEFORE, DRIVES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN_DRIVES, SHOWN_S = 3, 120.0
"""Drives that are drawn, and the longest stretch of each. [-], [s]"""

TICK_M = 0.5
"""Between the ticks of offsets. [m]"""


@figure_style()
def traces_figure(result: LoopResult) -> Figure:
    """The longest uninterrupted stretches of a few drives: measured, profile before, profile after, on one scale."""
    from matplotlib.ticker import MultipleLocator

    timeline = result.coarse.timeline
    parts = longest_parts(result)
    columns = (
        ("measured", timeline.offset, DRIVES),
        ("profile before", result.scored.runs_before[0], BEFORE),
        ("profile after", result.scored.runs_after[0], AFTER),
    )
    figure, axes = new_panels(len(parts), len(columns), panel_height=0.75, sharex=True, sharey=True)
    for row, rows in zip(axes, parts, strict=True):
        _draw_part(row, timeline, rows, columns)
    axes[0, 0].yaxis.set_major_locator(MultipleLocator(TICK_M))
    axes[len(parts) // 2, 0].set_ylabel("offset [m]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure


def _draw_part(
    row: Sequence[Axes], timeline: Timeline, rows: slice, columns: Sequence[tuple[str, NDArray[np.float64], str]]
) -> None:
    """One stretch: measured, before and after beside each other."""
    name = timeline.names[timeline.drive[rows.start]]
    for axis, (label, offset, color) in zip(row, columns, strict=True):
        axis.plot(timeline.time[rows] - timeline.time[rows.start], offset[rows], color=color, label=label)
        axis.axhline(0.0, color=GRID, linewidth=0.8)
        axis.set_title(f"{name}, {label}")


def longest_parts(result: LoopResult) -> list[slice]:
    """Rows of the longest stretch within one held-out block, of the drives that have the longest; drives in order."""
    timeline = result.coarse.timeline
    block = np.where(timeline.valid, hold_out_blocks(timeline), -1)
    edges = np.flatnonzero(np.diff(block, prepend=-2, append=-2))
    starts, stops = edges[:-1], edges[1:]
    longest: dict[int, slice] = {}
    for start, stop in zip(starts, stops, strict=True):
        drive = int(timeline.drive[start])
        known = longest.get(drive, slice(0, 0))
        if block[start] >= 0 and stop - start > known.stop - known.start:
            longest[drive] = slice(int(start), int(stop))
    chosen = sorted(longest, key=lambda drive: longest[drive].start - longest[drive].stop)[:SHOWN_DRIVES]
    shown = round(SHOWN_S / timeline.step) + 1
    return [slice(longest[k].start, min(longest[k].stop, longest[k].start + shown)) for k in sorted(chosen)]
