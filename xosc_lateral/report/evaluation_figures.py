"""Figures of an evaluation: violins, spectrum, autocorrelation, traces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.scores import ProfileScores
from xosc_lateral.report.figures import GRID, INK, MEASURED, SAMPLED, figure_style, new_figure, new_panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]


@figure_style()
def trace_figure(scores: ProfileScores) -> Figure:
    """Measured offsets on the left, sampled ones of the same drives on the right, on one scale."""
    figure, axes = new_panels(len(scores.traces), 2, panel_height=0.7, sharex=True, sharey=True)
    for row, trace in zip(axes, scores.traces, strict=True):
        for axis, values, color, label in (
            (row[0], trace.real, MEASURED, "measured"),
            (row[1], trace.sampled, SAMPLED, "sampled"),
        ):
            axis.plot(trace.step * np.arange(len(values)), values, color=color, label=f"{trace.drive}, {label}")
            axis.axhline(0.0, color=GRID, linewidth=0.8)
            axis.set_title(f"{trace.drive}, {label}")
    axes[len(scores.traces) // 2, 0].set_ylabel("offset [m]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure


@figure_style()
def spectrum_figure(scores: ProfileScores) -> Figure:
    """Power density, measured and sampled."""
    figure, axes = new_figure(height=3.4)
    axis = axes[0, 0]
    for one, label, color in (
        (scores.spectrum_real, "measured", MEASURED),
        (scores.spectrum_sampled, "sampled", SAMPLED),
    ):
        axis.loglog(one.frequency, one.density, color=color, marker="o", markersize=3, label=label)
    axis.set_xlabel("frequency [Hz]")
    axis.set_ylabel("power density [m²/Hz]")
    axis.legend()
    return figure


@figure_style()
def memory_figure(scores: ProfileScores) -> Figure:
    """Autocorrelation, measured and sampled."""
    figure, axes = new_figure(height=3.0)
    axis = axes[0, 0]
    axis.semilogx(scores.lags, scores.autocorrelation_real, color=MEASURED, marker="o", markersize=3, label="measured")
    axis.semilogx(scores.lags, scores.autocorrelation_sampled, color=SAMPLED, marker="o", markersize=3, label="sampled")
    axis.axhline(0.0, color=INK, linewidth=0.8)
    axis.set_xlabel("lag [s]")
    axis.set_ylabel("correlation [-]")
    axis.legend()
    return figure
