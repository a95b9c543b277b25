"""Violins: the ten metrics of measured snippets beside those of sampled ones."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.evaluation.metrics import METRICS
from xosc_lateral.files.pages.chart import DASHED, MEASURED, MUTED, SAMPLED
from xosc_lateral.files.pages.figure import Figure

METRIC_WORDS = {
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

SHOWN_QUANTILES = (0.001, 0.999)  # Violins are drawn within these; minimum and maximum are bars of their own.


def violin_figure(
    left: FloatArray,
    right: FloatArray,
    before: FloatArray | None = None,
    names: tuple[str, str] = ("measured", "sampled"),
) -> Figure:
    """Ten pairs of half violins with bars at minimum, mean and maximum, of metrics of shape (n, 10) [m].

    `before` is drawn on the right as an outline.
    """
    figure = Figure(2, 5, height=150.0, legend=True)
    for k, (panel, name) in enumerate(zip(figure.panels, METRICS, strict=True)):
        for values, side, color, label in ((left, -1.0, MEASURED, names[0]), (right, 1.0, SAMPLED, names[1])):
            x, y = _half(values[:, k], side)
            panel.area(x, y, color, opacity=0.35, label=label)
            panel.line(x, y, color, width=0.8)
            low, mean, high = (f(values[:, k]) for f in (np.min, np.mean, np.max))
            for bar, reach in ((low, 0.35), (mean, 0.8), (high, 0.35)):
                panel.line((0.0, side * reach), (bar, bar), color, width=1.6)
        if before is not None:
            panel.line(*_half(before[:, k], 1.0), MUTED, width=1.0, dashes=DASHED, label=f"{names[1]} before")
        panel.title, panel.x.limits, panel.x.ticks = METRIC_WORDS[name], (-1.15, 1.15), []
        panel.y.label = "[m]" if k % 5 == 0 else ""
    return figure


def _half(values: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Outline of one half, from the bottom to the top, closed along the middle."""
    grid, density = density_over(values)
    return np.r_[0.0, side * 0.95 * density / density.max(), 0.0], np.r_[grid[0], grid, grid[-1]]


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
    start = len(grid) - 1
    return np.convolve(counts, kernel)[start : start + len(grid)] + 1e-12
