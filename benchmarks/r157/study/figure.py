"""The one figure: how sure a verdict is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.r157.study.verdicts import MODELS, Verdicts
from xosc_lateral.report.figures import ENRICHED, NOMINAL, figure_style, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@figure_style()
def verdict_figure(verdicts: Mapping[str, Verdicts], gaps: NDArray[np.float64]) -> Figure:
    """Share of runs with the verdict "preventable" over the gap at the cut-in: a step, and what becomes of it."""
    figure, axes = new_figure(len(verdicts), len(MODELS), height=2.4 * len(verdicts), sharex=True, sharey=True)
    for line, (scenario, one) in zip(axes, verdicts.items(), strict=True):
        for axis, name in zip(line, MODELS, strict=True):
            nominal, lifelike = one.prevented[name][:, 0], one.prevented[name][:, 1:].mean(axis=1)
            axis.step(gaps, 100 * nominal, where="mid", color=NOMINAL, label="nominal (lane centre)")
            axis.plot(gaps, 100 * lifelike, color=ENRICHED, linewidth=2.2, label="lifelike")
            unsure = (lifelike > 0.02) & (lifelike < 0.98)
            axis.fill_between(gaps, 0, 100, where=unsure, color=ENRICHED, alpha=0.12, step="mid", linewidth=0)
            axis.set_title(name)
        title = scenario.removeprefix("alks_scenario_").replace("_template", "").replace("_", " ")
        line[0].set_ylabel(f"{title}\npreventable [% of runs]", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("gap when the cut-in begins [m]")
    axes[0, 0].legend(loc="center right", fontsize=7.5)
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """As SVG, the same bytes each time: ids are salted hashes, which matplotlib salts by chance."""
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path, metadata={"Date": None})
