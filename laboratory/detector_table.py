"""Tables and the figure of `laboratory.detectors`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.extras.detect.detectors import Detector
from xosc_lateral.extras.detect.observation import View
from xosc_lateral.extras.detect.scoring import Curve, Tally
from xosc_lateral.extras.detect.tracks import Scene
from xosc_lateral.files.pages.chart import BLUE, DASHED, GREEN, MUTED, VERMILLION
from xosc_lateral.files.pages.figure import Figure

FloatArray = NDArray[np.float64]
Views = list[tuple[Scene, list[View]]]


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
        cells = [f"{min(rates):.1f}-{max(rates):.1f}" for rates in zip(*runs, strict=True)]
        lines.append(f"| real: {len(runs)} GNSS runs singly | {hours:.2f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _rate(curve: Curve) -> str:
    k = curve.detector.chosen
    low, high = curve.rate_interval()[:, k]
    return f"{curve.rate[k]:.1f}" + ("" if np.isnan(low) else f" ({low:.1f}-{high:.1f})")


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
            lambda name: name.startswith("lifelike") and "paper" not in name,
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
