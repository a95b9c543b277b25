"""A detection as a page: the table, the curves, and the worst cases in the player."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.files.pages.chart import ENRICHED, INK, color_of
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Html, Page
from xosc_lateral.workflows.detection.clip import clip_scene
from xosc_lateral.workflows.detection.scoring import Case, Curve
from xosc_lateral.workflows.detection.text import HEADINGS, cells, notes

if TYPE_CHECKING:
    from xosc_lateral.workflows.detection.detected import Detected

LEAST_RATE = 0.1
"""False alarms below this are drawn there: the axis is logarithmic. [1/h]"""
AROUND = 6.0
"""Of a case, before and after its moment. [s]"""


def detection_page(result: Detected) -> str:
    """HTML page, self-contained; same input, same bytes."""
    page = Page("Cut-in detectors")
    page.lead(f"{result.headline()}.", *notes(result))
    page.section("Table")
    rows = [dict(zip(HEADINGS, cells(row), strict=True)) for row in result.rows()]
    page.table(rows, "At the thresholds that are set; in brackets 95 % intervals")
    page.section(
        "Curves", "From left to right, thresholds become more sensitive. The dot is the threshold that is set."
    )
    page.figure(curves_figure(result.curves), "Cut-ins seen before the marking is crossed, and how long before")
    page.section("Worst cases")
    cases = result.worst()
    found = [_case_row(number, *case) for number, case in enumerate(cases, 1)]
    page.table(found, "Cut-ins that were missed or seen late, then false alarms farthest above their threshold")
    for number, (_, detector, case) in enumerate(cases, 1):
        title = f"{number}: {case.kind}, {case.view.track.name} at {case.time:.1f} s"
        page.heading(title, anchor=f"case-{number}")
        scene = clip_scene(case, AROUND)
        if scene is not None:
            page.player(scene, f"Case {number} from above", anchor=f"scene-{number}")
        page.figure(_case_figure(case), f"Towards the neighbouring lane; shaded: alarm of {detector}")
    return page.html(result.provenance())


def _case_row(number: int, source: str, detector: str, case: Case) -> dict[str, object]:
    link = Html(f'<a href="#case-{number}">{number}</a>')
    return {
        "case": link, "kind": case.kind, "source": source, "detector": detector, "scene": case.scene.name,
        "vehicle": case.view.track.name, "time [s]": f"{case.time:.1f}",
    }  # fmt: skip


def curves_figure(curves: Sequence[Curve]) -> Figure:
    """A row for each detector, a colour for each source."""
    detectors = list(dict.fromkeys(curve.detector.label() for curve in curves))
    sources = list(dict.fromkeys(curve.source for curve in curves))
    figure = Figure(len(detectors), 2, height=120.0, legend=True)
    for row, name in enumerate(detectors):
        left, right = figure.row(row)
        left.title = name if len(name) < 46 else f"{name[:45]}…"
        left.y.label, right.y.label = "seen before the marking [%]", "median time before it [s]"
        left.y.limits = (0.0, 105.0)
        for panel in (left, right):
            panel.x.log, panel.x.label = True, "false alarms an hour"
            panel.x.holds = (LEAST_RATE, 10.0)
        for curve in curves:
            if curve.detector.label() == name and len(curve.leads) and len(curve.hours):
                color, chosen = color_of(sources.index(curve.source)), curve.detector.chosen
                rate = np.maximum(curve.sensitive_rate(), LEAST_RATE)
                for panel, values in ((left, 100.0 * curve.in_time), (right, curve.lead(0.5))):
                    panel.line(rate, values, color, label=curve.source)
                    panel.dots(rate[[chosen]], values[[chosen]], color)
    return figure


def _case_figure(case: Case) -> Figure:
    """Offset towards the lane over time, with the alarm."""
    track = case.view.track
    rows = np.flatnonzero(np.abs(track.time - case.time) <= AROUND)
    time, base = track.time[rows], track.base[rows[0]]
    figure = Figure(1, 1, height=90.0)
    panel = figure.row(0)[0]
    alarm = case.score[rows] > case.limit
    edges = np.flatnonzero(np.diff(np.r_[False, alarm, False].astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        panel.across(float(time[first]), float(time[last - 1]), ENRICHED, opacity=0.15)
    side = case.view.side
    panel.line(time, side * (track.lateral[rows] - base), INK, label="offset towards the lane [m]")
    panel.level(0.5 * float(track.rows.lane_width[rows[0]]) - 0.5 * track.size.width, dashes="3 2")
    panel.x.label, panel.y.label = "time [s]", "offset [m]"
    return figure
