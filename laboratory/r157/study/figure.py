"""The one figure: how sure a verdict is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.study.verdicts import MODELS, Verdicts
from xosc_lateral.files.pages.chart import ENRICHED, NOMINAL
from xosc_lateral.files.pages.figure import Figure


def verdict_figure(verdicts: Mapping[str, Verdicts], gaps: NDArray[np.float64]) -> Figure:
    """Share of runs with the verdict "preventable" over the gap at the cut-in: a step, and what becomes of it."""
    figure = Figure(len(verdicts), len(MODELS), height=110.0, share_x="all", share_y="all", legend=True)
    between = 0.5 * (gaps[1:] + gaps[:-1])
    edges = np.repeat(np.r_[gaps[0], between, gaps[-1]], 2)[1:-1]
    for number, (scenario, one) in enumerate(verdicts.items()):
        for panel, name in zip(figure.row(number), MODELS, strict=True):
            nominal, lifelike = one.prevented[name][:, 0], one.prevented[name][:, 1:].mean(axis=1)
            unsure = np.where((lifelike > 0.02) & (lifelike < 0.98), 100.0, np.nan)
            panel.band(edges, 0.0, np.repeat(unsure, 2), ENRICHED, opacity=0.12)
            panel.line(edges, np.repeat(100.0 * nominal, 2), NOMINAL, label="nominal (lane centre)")
            panel.line(gaps, 100.0 * lifelike, ENRICHED, width=2.2, label="lifelike")
            panel.title, panel.x.label = name, "gap when the cut-in begins [m]"
        title = scenario.removeprefix("alks_scenario_").replace("_template", "").replace("_", " ")
        figure.row(number)[0].title = f"{title}: {MODELS[0]}"
        figure.row(number)[0].y.label = "preventable [% of runs]"
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """As SVG, the same bytes each time."""
    figure.save(path)
