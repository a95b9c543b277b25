"""A detection as a page: the table, the curves, and the worst cases in the player."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.texts import hours_in_words
from xosc_lateral.extras.detect.scoring import CASE_MARGIN, Case, Curve, alarms_in_words
from xosc_lateral.extras.detect.tracks import STEP, LaneTrack
from xosc_lateral.files.pages.chart import ENRICHED, color_of
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Html, Page
from xosc_lateral.workflows.playing.scene import scene_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, MovingTraffic

LEAST_RATE = 0.1
"""False alarms below this are drawn there: the axis is logarithmic. [1/h]"""
NEAR_DISTANCE = 120.0
"""Vehicles farther from the case's are left out. [m]"""


def detection_page(
    lead: Sequence[str],
    table: Sequence[Mapping[str, object]],
    curves: Sequence[Curve],
    worst: Sequence[tuple[str, str, Case]],
    provenance: Mapping[str, object],
) -> str:
    """HTML page, self-contained; same input, same bytes."""
    page = Page("Cut-in detectors")
    telling = _telling(curves)
    page.lead(*([finding(telling)] if telling else []), lead[0])
    if telling:
        page.figure(
            alarms_figure(telling),
            f"False alarms an hour over the threshold; none at all is drawn at {LEAST_RATE:g}. The dot is the one that "
            "is set.",
        )
    page.section("Table")
    page.table(table, "At the thresholds that are set; in brackets 95 % intervals")
    page.text(*lead[1:])
    page.section(
        "Curves",
        "From left to right, thresholds become more sensitive. The dot is the threshold that is set.",
        folded=True,
    )
    page.figure(curves_figure(curves), "Cut-ins seen before the marking is crossed, and how long before")
    page.section("Worst cases")
    case_rows = [
        {
            "case": Html(f'<a href="#case-{number}">{number}</a>'), "kind": case.kind, "source": source,
            "detector": detector, "scene": case.scene.name, "vehicle": case.view.track.name,
            "time [s]": f"{case.time:.1f}",
        }
        for number, (source, detector, case) in enumerate(worst, 1)
    ]  # fmt: skip
    page.table(case_rows, "Cut-ins that were missed or seen late, then false alarms farthest above their threshold")
    for number, (_, detector, case) in enumerate(worst, 1):
        title = f"{number}: {case.kind}, {case.view.track.name} at {case.time:.1f} s"
        page.heading(title, anchor=f"case-{number}")
        if (scene := clip_scene(case)) is not None:
            page.player(scene, f"Case {number} from above", anchor=f"scene-{number}")
        page.figure(_case_figure(case), f"Towards the neighbouring lane; shaded: alarm of {detector}")
    return page.html(provenance)


def _telling(curves: Sequence[Curve]) -> list[Curve]:
    """Of the detector whose false alarms differ most between sources, or are most of all where there is one source;
    one that sees cut-ins, if any does."""
    detectors = grouped((curve.detector.label(), curve) for curve in curves if curve.hours.sum() > 0.0)

    def spread(some: Sequence[Curve]) -> tuple[bool, float]:
        rates = [_rate(curve) for curve in some]
        sees = any(curve.seen(0.0)[curve.detector.chosen] > 0.0 for curve in some if len(curve.leads))
        return sees, max(rates) - (min(rates) if len(rates) > 1 else 0.0)

    return max(detectors.values(), key=spread, default=[])


def _rate(curve: Curve) -> float:
    """At the threshold that is set. [1/h]"""
    return float(curve.rate[curve.detector.chosen])


def finding(curves: Sequence[Curve]) -> str:
    """What one detector does on the sources where it alarms least and most, in a sentence."""
    fewest, most = min(curves, key=_rate), max(curves, key=_rate)
    rates = [f"{_alarms(curve)} on {curve.source}" for curve in dict.fromkeys((most, fewest))]
    alarms = f"raises false alarms: {', '.join(rates)}"
    if not _rate(most):
        hours = sum(float(curve.hours.sum()) for curve in curves)
        alarms = f"raises no false alarm in {hours_in_words(hours)} of lane keeping"
    shares = [100.0 * float(curve.seen(0.0)[curve.detector.chosen]) for curve in curves if len(curve.leads)]
    cut_ins = sum(len(curve.leads) for curve in curves)
    low, high = (f"{end(shares, default=0.0):.0f}" for end in (min, max))
    seen = f"{low} %" if low == high else f"{low} to {high} %, by source,"
    before = f"; it sees {seen} of {cut_ins} cut-ins before the marking" if shares else ""
    return f"{curves[0].detector.label()} {alarms}{before}."


def _alarms(curve: Curve) -> str:
    count = int(curve.counts[:, curve.detector.chosen].sum())
    return alarms_in_words(count, float(curve.hours.sum()), f"{_rate(curve):.1f}")


def alarms_figure(curves: Sequence[Curve]) -> Figure:
    """False alarms over the threshold of one detector, a colour for each source."""
    figure = Figure(height=150.0, legend=True)
    (panel,) = figure.panels
    for number, curve in enumerate(curves):
        thresholds, chosen = curve.detector.thresholds, curve.detector.chosen
        rates = np.maximum(curve.rate, LEAST_RATE)
        panel.line(thresholds, rates, color_of(number), label=curve.source)
        panel.dots(thresholds[[chosen]], rates[[chosen]], color_of(number))
    panel.y.log, panel.y.label, panel.y.holds = True, "false alarms an hour", (LEAST_RATE, 10.0)
    panel.x.label = curves[0].detector.quantity
    return figure


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
                for panel, values in ((left, 100.0 * curve.seen(0.0)), (right, curve.lead(0.5))):
                    panel.line(rate, values, color, label=curve.source)
                    panel.dots(rate[[chosen]], values[[chosen]], color)
    return figure


def _case_figure(case: Case) -> Figure:
    """Offset towards the lane over time, with the alarm."""
    track = case.view.track
    rows = np.flatnonzero(np.abs(track.time - case.time) <= CASE_MARGIN)
    time, base = track.time[rows], track.base[rows[0]]
    figure = Figure(1, 1, height=90.0)
    panel = figure.row(0)[0]
    alarm = case.score[rows] > case.limit
    edges = np.flatnonzero(np.diff(np.r_[False, alarm, False].astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        panel.across(float(time[first]), float(time[last - 1]), ENRICHED, opacity=0.15)
    side, color = case.view.side, color_of(_names(case).index(track.name))
    panel.line(time, side * (track.lateral[rows] - base), color, label="offset towards the lane [m]")
    panel.level(0.5 * float(track.lane_width[rows[0]]) - 0.5 * track.box.width, dashes="3 2")
    panel.x.label, panel.y.label = "time [s]", "offset [m]"
    return figure


# ---- the player's scene ----
def clip_scene(case: Case) -> str | None:
    """JSON for the player, the case's vehicle first; None: nobody knows where on a road it is."""
    network = case.scene.network
    if network is None:
        return None
    middle = round(case.time / STEP)
    half = round(CASE_MARGIN / STEP)
    instants = np.arange(max(0, middle - half), middle + half + 1)
    watched = case.view.track
    rows = (instants - watched.first).clip(0, len(watched) - 1)
    here = watched.x[rows], watched.y[rows]
    tracks = [
        watched,
        *(track for track in case.scene.tracks if track is not watched and _is_near(track, instants, here)),
    ]
    entities = tuple(_motion(track, instants) for track in tracks)
    return scene_of(MovingTraffic(STEP, entities), network, names=_names(case))


def _names(case: Case) -> Sequence[str]:
    """Of all vehicles, in the order of their colours."""
    return case.scene.names or list(dict.fromkeys(track.name for track in case.scene.tracks))


def _is_near(track: LaneTrack, instants: np.ndarray, here: tuple[np.ndarray, np.ndarray]) -> bool:
    rows = instants - track.first
    there = (rows >= 0) & (rows < len(track))
    away = np.hypot(track.x[rows[there]] - here[0][there], track.y[rows[there]] - here[1][there])
    return bool((away < NEAR_DISTANCE).any())


def _motion(track: LaneTrack, instants: np.ndarray) -> EntityMotion:
    rows = instants - track.first
    there = (rows >= 0) & (rows < len(track))
    activity = np.where(there, np.uint8(Activity.ACTIVE), np.uint8(0)).astype(np.uint8)
    held = track.at(rows.clip(0, len(track) - 1))
    return EntityMotion.of(track.entity, STEP * instants, **{**held.columns, "activity": activity})
