"""Figures of an evaluation: violins (the ten metrics, measured beside sampled), traces, spectra, the verdict."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.evaluation import spectra
from xosc_lateral.drivers.evaluation.metrics import METRICS
from xosc_lateral.drivers.evaluation.scores import ProfileScores
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


def trace_figure(scores: ProfileScores) -> Figure:
    """Measured offsets on the left, sampled ones of the same drives on the right, on one scale."""
    figure = Figure(len(scores.traces), 2, height=50.0, share_x="all", share_y="all")
    for number, trace in enumerate(scores.traces):
        sides = ((trace.real, MEASURED, "measured"), (trace.sampled, SAMPLED, "sampled"))
        for panel, (values, color, label) in zip(figure.row(number), sides, strict=True):
            panel.level()
            panel.line(trace.step * np.arange(len(values)), values, color, label=label)
            panel.title, panel.x.label = f"{trace.drive}, {label}", "time [s]"
    figure.row(len(scores.traces) // 2)[0].y.label = "offset [m]"
    return figure


def spectrum_figure(scores: ProfileScores) -> Figure:
    """Power density and autocorrelation, measured and sampled."""
    figure = Figure(1, 2, height=180.0, legend=True)
    power, memory = figure.panels
    memory.level()
    for each, correlation, color, label in (
        (scores.spectrum_real, scores.autocorrelation_real, MEASURED, "measured"),
        (scores.spectrum_sampled, scores.autocorrelation_sampled, SAMPLED, "sampled"),
    ):
        power.line(each.frequency, each.density, color, label=label)
        memory.line(scores.lags, correlation, color, label=label)
    power.x.log = power.y.log = memory.x.log = True
    power.title, power.x.label, power.y.label = "Spectrum", "frequency [Hz]", "power density [m²/Hz]"
    memory.title, memory.x.label, memory.y.label = "Autocorrelation", "lag [s]", "correlation [-]"
    return figure


def verdict_figure(verdict: spectra.Verdict) -> Figure:
    """Ratios of powers over frequency, with intervals: of the driver, and of the recording."""
    figure = Figure(1, 2, height=130.0, share_x="all", share_y="all")
    powers = [ratio for ratio in verdict.ratios if ratio.high]
    ends = min(ratio.low for ratio in powers), max(ratio.high for ratio in powers)
    for panel, of, color in zip(figure.panels, spectra.BOTH, (SAMPLED, MEASURED), strict=True):
        panel.title, panel.x.label, panel.x.log, panel.y.log = of, "frequency [Hz]", True, True
        panel.x.limits = ends
        panel.area((*ends, *ends[::-1]), (1.0 / spectra.TOLERANCE,) * 2 + (spectra.TOLERANCE,) * 2, color, opacity=0.12)
        panel.line(ends, (1.0, 1.0), color, width=0.8, dashes="3 2")
        for each in (ratio for ratio in powers if ratio.of == of):
            middle = (each.low * each.high) ** 0.5
            panel.line((middle, middle), each.interval, color)
            panel.dots((middle,), (each.ratio,), color, size=6.0, label=f"{each.name}, {each.judged}")
    figure.panels[0].y.label = "sampled over measured"
    return figure
