"""Tables and the figure of `laboratory.detectors`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.files.pages.chart import BLUE, DASHED, GREEN, MUTED, VERMILLION
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.workflows.detection.detectors import NO_DANGER, Detector
from xosc_lateral.workflows.detection.logistic import Logistic
from xosc_lateral.workflows.detection.observation import View
from xosc_lateral.workflows.detection.scoring import Curve, Tally, count_onsets
from xosc_lateral.workflows.detection.tracks import STEP, Scene

FloatArray = NDArray[np.float64]
Views = list[tuple[Scene, list[View]]]

TUNED_RATE = 5.0
"""False alarms that a detector is tuned to at most. [1/h]"""
TUNED = ("lateral-speed", "wandering-zone", "time-to-line")
ASIDE = ("paper", "single")
EQUAL_SHARE = 0.95
"""Cut-ins seen before the marking at which trained detectors are compared. [-]"""
DRAWS = 500


@dataclass(frozen=True, eq=False)
class Pool:
    """One kind of traffic and what detectors did on it."""

    name: str
    curves: Sequence[Curve]

    @property
    def is_single_run(self) -> bool:
        """Whether it is one of the runs with differential GNSS."""
        return self.name.startswith("real: RTK")

    @classmethod
    def of(cls, name: str, views: Views, detectors: Sequence[Detector]) -> Pool:
        """Run detectors on it."""
        tallies = [Tally(detector, name) for detector in detectors]
        for scene, several in views:
            for tally in tallies:
                tally.add(scene, several)
        return cls(name, [tally.curve() for tally in tallies])


def alarm_lines(pools: Sequence[Pool]) -> str:
    """False alarms by threshold of lateral speed; of single runs the range."""
    thresholds = [curve.detector.threshold for curve in pools[0].curves]
    heads = [f"{threshold:.2f} m/s" for threshold in thresholds]
    lines = ["| traffic | hours | " + " | ".join(heads) + " |", "|---" * (2 + len(heads)) + "|"]
    for pool in pools:
        if not pool.is_single_run:
            cells = [_rate(curve) for curve in pool.curves]
            lines.append(f"| {pool.name} | {pool.curves[0].hours.sum():.2f} | " + " | ".join(cells) + " |")
    runs = [[float(curve.rate[curve.detector.chosen]) for curve in pool.curves] for pool in pools if pool.is_single_run]
    if runs:
        hours = sum(float(pool.curves[0].hours.sum()) for pool in pools if pool.is_single_run)
        cells = [f"{min(rates):.1f} to {max(rates):.1f}" for rates in zip(*runs, strict=True)]
        lines.append(f"| real: {len(runs)} GNSS runs singly | {hours:.2f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def default_lines(pools: Sequence[Pool]) -> str:
    """Every rule at its default: false alarms an hour, and the median time before the marking."""
    shown = [pool for pool in _shown(pools) if pool.name not in ("nominal", "lifelike: rural")]
    lines = ["| detector | " + " | ".join(pool.name for pool in shown) + " |", "|---" * (1 + len(shown)) + "|"]
    for number, first in enumerate(pools[0].curves):
        curves = [pool.curves[number] for pool in shown]
        cells = [f"{_rate(curve)}, {_lead(curve, curve.detector.chosen)}" for curve in curves]
        lines.append(f"| {first.detector.label()} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def tuned_lines(pools: Sequence[Pool]) -> str:
    """Rules tuned on one kind of traffic, on the recording: threshold, false alarms, time before the marking."""
    real = next(pool for pool in pools if "recording" in pool.name)
    rules = [n for n, one in enumerate(pools[0].curves) if one.detector.name in TUNED]
    names = [f"`{pools[0].curves[n].detector.name}`, {pools[0].curves[n].detector.quantity}" for n in rules]
    lines = ["| tuned on | " + " | ".join(names) + " |", "|---" * (1 + len(rules)) + "|"]
    for pool in _shown(pools):
        cells = []
        for number in rules:
            k, curve = pool.curves[number].tuned(TUNED_RATE), real.curves[number]
            cells.append(f"{curve.detector.thresholds[k]:g}: {curve.rate[k]:.0f}, {_lead(curve, k)}")
        lines.append(f"| {pool.name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _shown(pools: Sequence[Pool]) -> list[Pool]:
    """Those with cut-ins, without profiles that are variants of another."""
    with_changes = [pool for pool in pools if len(pool.curves[0].leads)]
    return [pool for pool in with_changes if "refined" not in pool.name and "single" not in pool.name]


def _lead(curve: Curve, k: int) -> str:
    lead = curve.lead(0.5)[k]
    return "none seen" if np.isnan(lead) else f"{lead:.2f} s"


def _rate(curve: Curve) -> str:
    k = curve.detector.chosen
    low, high = curve.rate_interval()[:, k]
    return f"{curve.rate[k]:.1f}" + ("" if np.isnan(low) else f" ({low:.1f} to {high:.1f})")


# ---- trained ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Scored:
    """Scores of a trained detector: what each cut-in reaches before the marking, onsets by cluster over limits."""

    reached: FloatArray
    cluster: NDArray[np.int64]
    limits: FloatArray
    counts: NDArray[np.int64]
    hours: FloatArray


def scored(detector: Logistic, views: Views) -> Scored:
    names: dict[str, int] = {}
    reached, clusters, kept = [], [], []
    for scene, several in views:
        for view, score in zip(several, detector.scores(scene, several), strict=True):
            number = names.setdefault(view.track.cluster, len(names))
            score = np.where(view.watched, score, NO_DANGER)
            kept.append((number, score, view.truth.keeping & view.watched))
            for change in view.truth.changes:
                if change.side == view.side and view.watched[change.begin] and change.crossing > change.begin:
                    reached.append(float(score[change.begin : change.crossing].max()))
                    clusters.append(number)
    limits = np.unique(reached) if reached else np.zeros(0)
    counts, hours = np.zeros((len(names), len(limits)), dtype=np.int64), np.zeros(len(names))
    for number, score, keeping in kept:
        counts[number] += count_onsets(score, keeping, limits)
        hours[number] += keeping.sum() * STEP / 3600.0
    return Scored(np.array(reached), np.array(clusters, dtype=np.int64), limits, counts, hours)


def _limit(one: Scored, weights: NDArray[np.int64]) -> int:
    """Number of the limit that `EQUAL_SHARE` of the drawn cut-ins exceed."""
    values = np.sort(np.repeat(one.reached, weights[one.cluster]))
    value = values[int((1.0 - EQUAL_SHARE) * len(values))]
    return max(int(np.searchsorted(one.limits, value)) - 1, 0)


def trained_lines(rows: Mapping[str, Mapping[str, Sequence[str]]]) -> str:
    """Cells of `trained_cells` by sensor and training; of sensors other than the first the rate alone."""
    first, *others = rows
    heads = "trained on", "false alarms an hour", "fewer than trained on nominal", "on the GNSS runs"
    heads = *heads, *(f"sensor: {sensor}" for sensor in others)
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for name, cells in rows[first].items():
        lines.append(f"| {' | '.join([name, *cells, *(rows[sensor][name][0] for sensor in others)])} |")
    return "\n".join(lines)


def trained_cells(detectors: Mapping[str, Logistic], held: Views, runs: Views) -> dict[str, list[str]]:
    """False alarms at equal detection on held-out vehicles, how many fewer than trained on nominal, on the runs."""
    found = {name: scored(detector, held) for name, detector in detectors.items()}
    first = next(iter(found.values()))
    k = len(first.hours)
    draws = np.random.default_rng(1).multinomial(k, np.full(k, 1.0 / k), size=DRAWS)
    ones = np.ones(k, dtype=np.int64)

    def rate(one: Scored, weights: NDArray[np.int64]) -> float:
        return float(weights @ one.counts[:, _limit(one, weights)] / (weights @ one.hours))

    drawn = {name: np.array([rate(one, weights) for weights in draws]) for name, one in found.items()}
    base = next(iter(found))
    rows = dict[str, list[str]]()
    for name, one in found.items():
        low, high = np.quantile(drawn[name], [0.025, 0.975])
        fewer = drawn[base] - drawn[name]
        cells = [f"{rate(one, ones):.1f} ({low:.1f} to {high:.1f})"]
        less = np.quantile(fewer, [0.025, 0.975])
        cells.append(
            "" if name == base else f"{rate(found[base], ones) - rate(one, ones):.1f} ({less[0]:.1f} to {less[1]:.1f})"
        )
        limit = np.array([one.limits[_limit(one, ones)]])
        count, hours = 0, 0.0
        for scene, several in runs:
            for view, score in zip(several, detectors[name].scores(scene, several), strict=True):
                keeping = view.truth.keeping & view.watched
                count += int(count_onsets(score, keeping, limit)[0])
                hours += float(keeping.sum()) * STEP / 3600.0
        rows[name] = [*cells, f"{count / hours:.1f}"]
    return rows


# ---- figure ----------------------------------------------------------------------------------------------------------
def alarm_figure(pools: Sequence[Pool]) -> Figure:
    """False alarms by threshold of lateral speed: nominal, lifelike, real."""
    figure = Figure(1, 1, height=210.0, legend=True)
    panel = figure.row(0)[0]
    drawn = [
        ("real", MUTED, "", lambda name: name.startswith("real")),
        (
            "lifelike",
            BLUE,
            "",
            lambda name: name.startswith("lifelike") and "paper" not in name and "single" not in name,
        ),
        ("the paper's model", GREEN, DASHED, lambda name: "paper" in name),
    ]
    for kind, color, dashes, belongs in drawn:
        chosen = [pool for pool in pools if belongs(pool.name)]
        for pool in chosen:
            label = kind if pool is chosen[0] else ""
            panel.line(*_course(pool.curves[0]), color, label=label, width=1.6, dashes=dashes)
    nominal = next(pool for pool in pools if pool.name == "nominal").curves[0]
    panel.line(
        nominal.detector.thresholds, np.full(len(nominal.rate), LEAST), VERMILLION, label="nominal: none", width=2.4
    )
    panel.x.label, panel.y.label = "threshold of lateral speed, held for 0.4 s [m/s]", "false alarms an hour"
    panel.y.log, panel.x.limits, panel.y.limits = True, (0.06, 0.4), (LEAST, 1000.0)
    return figure


LEAST = 0.1
"""Where no alarm at all is drawn. [1/h]"""


def _course(curve: Curve) -> tuple[FloatArray, FloatArray]:
    return curve.detector.thresholds, np.where(curve.rate > 0.0, curve.rate, np.nan)
