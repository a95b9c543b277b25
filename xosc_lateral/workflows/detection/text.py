"""A detection in words: the table, and what it means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from xosc_lateral.workflows.detection.detection import Detection

HEADINGS = ("source", "detector", "false alarms / h", "seen", "before the marking", "time before it [s]")


def as_text(detection: Detection) -> str:
    """The table at the thresholds that are set, then notes."""
    rows = [HEADINGS, *(cells(row) for row in detection.rows())]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEADINGS))]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([detection.headline(), "", *lines, "", *notes(detection)])


def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Cells of a row, as texts; intervals of 95 %."""
    alarms = _with_interval(row, "false_alarms_per_hour", "false_alarms_low", "false_alarms_high", 1)
    seen = _share(row, "seen", "seen_low", "seen_high")
    in_time = _share(row, "seen_before_marking", "seen_before_marking_low", "seen_before_marking_high")
    lead = _with_interval(row, "lead_median", "lead_median_low", "lead_median_high", 2)
    return str(row["source"]), str(row["detector"]), alarms, seen, in_time, lead


def _share(row: Mapping[str, Any], name: str, low: str, high: str) -> str:
    """Percent of the cut-ins; none where there are none."""
    if not row["cut_ins"]:
        return "no cut-in"
    percent = {key: 100.0 * row[key] for key in (name, low, high)}
    return _with_interval(percent, name, low, high, 0, " %")


def _with_interval(row: Mapping[str, Any], name: str, low: str, high: str, digits: int, unit: str = "") -> str:
    value, ends = row[name], (row[low], row[high])
    if np.isnan(value):
        return "-"
    between = "" if np.isnan(ends).any() else f" ({ends[0]:.{digits}f} to {ends[1]:.{digits}f})"
    return f"{value:.{digits}f}{unit}{between}"


def notes(detection: Detection) -> Sequence[str]:
    """What the numbers count, and what can't be read from them."""
    lines = [
        "False alarms: alarms that begin while a vehicle keeps its lane, an hour, seen from one neighbouring lane. "
        "Seen: an alarm before the vehicle's reference point is in the other lane. Time: from the alarm to its side on "
        "the marking, median. Intervals: 95 %, by vehicles drawn anew."
    ]
    silent = sorted(detection.still)
    if silent:
        lines.append(
            f"{', '.join(silent)}: no vehicle moves inside its lane, so that there are no false alarms by "
            "construction: that says nothing about a detector."
        )
    alone = [curve for curve in detection.curves if curve.detector.needs_observer and not len(curve.hours)]
    left = sorted({f"{curve.detector.name} on {curve.source}" for curve in alone})
    if left:
        lines.append(f"Needs other vehicles, which are not there: {', '.join(left)}.")
    return lines
