"""Figures of a closed loop: residual by context, effect curves, spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect
from xosc_lateral.loop.close import LoopResult
from xosc_lateral.loop.findings import Finding
from xosc_lateral.report.figures import AFTER, BEFORE, MEASURED, MUTED, figure_style, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

SPECTRUM_ROWS = 512
"""Samples per segment of a spectrum: 102 s."""


@figure_style()
def residual_figure(result: LoopResult, what: str) -> Figure:
    """Measured minus expected by every column's fifths, before and after; `what` is "mean" or "spread"."""
    names = [
        name for name in result.cells.labels if f"{what} by {name}" in result.real and not name.startswith("effect: ")
    ]
    columns = 4
    rows = -(-len(names) // columns)
    figure, axes = new_figure(rows, columns, height=1.55 * rows + 0.3)
    for axis, name in zip(axes.ravel(), names, strict=False):
        group = f"{what} by {name}"
        middle = result.cells.middles[name]
        for cells, color, label in ((result.before, BEFORE, "before"), (result.after, AFTER, "after")):
            axis.plot(middle, 100.0 * (result.real[group] - cells[group]), "o-", color=color, markersize=3, label=label)
        axis.axhline(0.0, color=MUTED, linewidth=0.6)
        axis.set_title(name)
    for axis in axes.ravel()[len(names) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("residual [cm]")
    axes[0, 0].legend()
    return figure


@figure_style()
def effect_figure(result: LoopResult, finding: Finding) -> Figure:
    """An effect's curve over its driving quantity, with two standard errors, beside what held-out blocks show."""
    effect = finding.effects[0]
    assert isinstance(effect, ColumnEffect)
    figure, axes = new_figure(1, 2, height=3.0)
    quantity, strength, error = _curve(result, effect)
    axis = axes[0, 0]
    middle, low, high = (_in_unit(effect, values) for values in (strength, strength - 2 * error, strength + 2 * error))
    axis.fill_between(quantity, low, high, color=AFTER, alpha=0.2, linewidth=0, label="two standard errors")
    axis.plot(quantity, middle, color=AFTER, label="fitted")
    axis.set_xlabel(_quantity_label(effect))
    axis.set_ylabel("shift of the mean [m]" if effect.acts is Acts.LOCATION else "factor [-]")
    axis.legend()
    axis = axes[0, 1]
    name = finding.cell.split(" by ", 1)[1]
    bins = _in_unit(effect, result.cells.middles[name])
    for cells, color, label in (
        (result.real, MEASURED, "measured"),
        (result.before, BEFORE, "profile before"),
        (result.after, "#d55e00", "profile after"),
    ):
        axis.plot(bins, cells[finding.cell], "o-", color=color, markersize=3.5, label=label)
    axis.set_xlabel("shift by the effect [m]" if effect.acts is Acts.LOCATION else "factor by the effect [-]")
    axis.set_ylabel(f"{finding.cell.split(' by ')[0]} of the offset, held out [m]")
    axis.legend()
    return figure


@figure_style()
def cells_figure(result: LoopResult, cell: str) -> Figure:
    """One group of cells: measured, before, after."""
    figure, axes = new_figure(1, 1, height=2.6, width=5.5)
    axis = axes[0, 0]
    index = np.arange(1, len(result.real[cell]) + 1)
    for cells, color, label in (
        (result.real, MEASURED, "measured"),
        (result.before, BEFORE, "profile before"),
        (result.after, "#d55e00", "profile after"),
    ):
        axis.plot(index, cells[cell], "o-", color=color, label=label)
    axis.set_xticks(index)
    axis.set_xlabel(cell)
    axis.set_ylabel("[m]")
    axis.legend()
    return figure


@figure_style()
def spectrum_figure(result: LoopResult) -> Figure:
    """Power density of measured offsets and of both profiles' held-out runs."""
    timeline = result.trace.coarse.timeline
    figure, axes = new_figure(1, 1, height=3.2)
    axis = axes[0, 0]
    for series, color, label in (
        (timeline.offset, MEASURED, "measured"),
        (result.runs_before[0], BEFORE, "profile before"),
        (result.runs_after[0], "#d55e00", "profile after"),
    ):
        frequency, density = _spectrum(series, timeline.valid, timeline.step)
        axis.loglog(frequency[1:], density[1:], color=color, label=label)
    axis.set_xlabel("frequency [Hz]")
    axis.set_ylabel("power density [m²/Hz]")
    axis.legend()
    return figure


def _spectrum(values: FloatArray, valid: NDArray[np.bool_], step: float) -> tuple[FloatArray, FloatArray]:
    """Welch's estimate over segments that are mostly valid, gaps at the mean."""
    centred = np.where(valid, values - values[valid].mean(), 0.0)
    window = np.hanning(SPECTRUM_ROWS)
    powers = []
    for first in range(0, len(values) - SPECTRUM_ROWS, SPECTRUM_ROWS // 2):
        rows = slice(first, first + SPECTRUM_ROWS)
        share = float(valid[rows].mean())
        if share > 0.8:
            powers.append(np.abs(np.fft.rfft(centred[rows] * window)) ** 2 / share)
    frequency = np.asarray(np.fft.rfftfreq(SPECTRUM_ROWS, step), dtype=np.float64)
    if not powers:
        return frequency, np.full(len(frequency), np.nan)
    density = 2.0 * step * np.mean(powers, axis=0) / float(np.sum(window**2))
    return frequency, np.asarray(density, dtype=np.float64)


def _curve(result: LoopResult, effect: ColumnEffect) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Strength over the driving quantity (one column: over the column itself) and its standard error."""
    coarse = result.trace.coarse
    context = {column: coarse.context[column][coarse.timeline.valid] for column in effect.columns}
    if len(effect.columns) == 1:
        seen = context[effect.columns[0]]
        seen = seen[np.isfinite(seen)]
        over = np.linspace(float(np.quantile(seen, 0.01)), float(np.quantile(seen, 0.99)), 200)
        quantity = effect.quantity({effect.columns[0]: over})
    else:
        values = effect.quantity(context)[:, 0]
        over = np.linspace(float(np.nanquantile(values, 0.01)), float(np.nanquantile(values, 0.99)), 200)
        quantity = over[:, None]
    about = quantity - np.asarray(effect.reference)
    return over, about @ np.asarray(effect.coefficients), np.sqrt(about**2 @ np.square(effect.errors))


def _in_unit(effect: ColumnEffect, strength: FloatArray) -> FloatArray:
    return strength if effect.acts is Acts.LOCATION else np.exp(strength)


def _quantity_label(effect: ColumnEffect) -> str:
    return effect.columns[0] if len(effect.columns) == 1 else effect.shape
