"""Violins: the ten metrics of measured snippets beside those of sampled ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.metrics import METRICS
from xosc_lateral.evaluation.parts import PartEvaluation
from xosc_lateral.report.figures import GRID, MEASURED, SAMPLED, figure_style, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

LABELS = {
    "max": "maximum",
    "min": "minimum",
    "mean": "mean",
    "std": "std. deviation",
    "median": "median",
    "q25": "25 % quantile",
    "q75": "75 % quantile",
    "range": "range",
    "diff_mean": "diff. mean × 10",
    "diff_std": "diff. std × 10",
}
"""The ten metrics, for readers."""

SHOWN_QUANTILES = (0.001, 0.999)
"""Violins are drawn within these; minimum and maximum are bars of their own."""


@figure_style()
def violin_figure(evaluation: PartEvaluation) -> Figure:
    """Ten pairs of half violins, measured beside sampled, with bars at minimum, mean and maximum."""
    figure, axes = new_figure(2, 5, height=5.0)
    for k, name in enumerate(METRICS):
        axis = axes[k // 5, k % 5]
        for values, side, color, name_ in (
            (evaluation.real[:, k], -1.0, MEASURED, "measured"),
            (evaluation.artificial[:, k], 1.0, SAMPLED, "sampled"),
        ):
            _half_violin(axis, values, side, color, name_)
        axis.set_title(LABELS[name])
        axis.set_xticks([-0.5, 0.5], ["measured", "sampled"], fontsize=8.0)
        axis.set_xlim(-1.15, 1.15)
        axis.grid(False, axis="x")
        if k % 5 == 0:
            axis.set_ylabel("[m]")
    return figure


def _half_violin(axis: Axes, values: FloatArray, side: float, color: str, name: str) -> None:
    grid, density = density_over(values)
    width = 0.95 * density / density.max()
    axis.fill_betweenx(grid, 0.0, side * width, color=color, alpha=0.35, linewidth=0)
    axis.plot(side * width, grid, color=color, linewidth=0.8, label=name)
    bars = (("minimum", values.min(), 0.35), ("mean", values.mean(), 0.8), ("maximum", values.max(), 0.35))
    for bar, value, reach in bars:
        axis.plot([0.0, side * reach], [value, value], color=color, linewidth=1.6, label=f"{name}, {bar}")
    axis.axvline(0.0, color=GRID, linewidth=0.8)


def density_over(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Grid over what violins show of the values, and their density on it (unscaled), shape (n,) each."""
    low, high = np.quantile(values, SHOWN_QUANTILES)
    grid = np.linspace(low, high, 120) if high > low else np.array([low - 1e-3, low, low + 1e-3])
    return grid, _density(values, grid)


def _density(values: FloatArray, grid: FloatArray) -> FloatArray:
    """Gaussian kernel density with Silverman's width, over a histogram: fast for any number of snippets."""
    step = grid[1] - grid[0]
    counts, _ = np.histogram(values, np.append(grid - 0.5 * step, grid[-1] + 0.5 * step))
    spread = min(values.std(), (np.quantile(values, 0.75) - np.quantile(values, 0.25)) / 1.349) or values.std()
    width = max(0.9 * spread * len(values) ** -0.2, step)
    kernel = np.exp(-0.5 * (np.arange(-len(grid) + 1, len(grid)) * step / width) ** 2)
    return np.asarray(np.convolve(counts, kernel, mode="valid") if len(grid) == 1 else _same(counts, kernel)) + 1e-12


def _same(counts: NDArray[np.int64], kernel: FloatArray) -> FloatArray:
    full = np.convolve(counts, kernel)
    start = (len(kernel) - 1) // 2
    return np.asarray(full[start : start + len(counts)], dtype=np.float64)
