"""Figures of a closed loop: residual by context, effect curves, spectra, violins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect, Product
from xosc_lateral.evaluation.metrics import METRICS
from xosc_lateral.evaluation.spectra import gapped_spectrum
from xosc_lateral.identification.close import Finding, LoopResult
from xosc_lateral.identification.cross_validation import hold_out_blocks
from xosc_lateral.identification.held_out import Scorecard
from xosc_lateral.report.figures import BLUE, GRID, MUTED, VERMILLION, figure_style, new_figure, new_panels
from xosc_lateral.report.loop_curves import Curve, curve_of
from xosc_lateral.report.loop_words import SPREAD, column_label, product_label
from xosc_lateral.report.violins import LABELS, density_over
from xosc_lateral.rows import true_slices

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

DRIVES, BEFORE, AFTER = BLUE, MUTED, VERMILLION
"""Measured drives, the profile before and the profile after, in every figure of the loop."""

SPECTRUM_ROWS = 512
"""Samples per segment of a spectrum: 102 s."""

TWO_ERRORS = 2.0
"""Half width of bands, in standard errors: chance leaves them 1 time in 20. [-]"""

FLAT_AXIS_CM = 1.0
"""A residual's axis reaches at least so far to both sides, lest noise look large. [cm]"""

NEGLIGIBLE = 1e-2
"""Share of a column's range that is written as 0. [-]"""

PANELS = 4
"""Residual panels side by side."""


@figure_style()
def residual_figure(result: LoopResult, what: str) -> Figure:
    """Measured minus expected by every column's fifths, before and after; `what` is "mean" or "spread"."""
    names = _shown(result, what)
    rows = -(-len(names) // PANELS)
    figure, axes = new_panels(rows, PANELS, panel_height=0.95, between=0.55, sharey=True)
    for axis, name in zip(axes.ravel(), names, strict=False):
        _draw_residual(axis, result, what, name)
    for axis in axes.ravel()[len(names) :]:
        axis.set_visible(False)
    low, high = axes[0, 0].get_ylim()
    axes[0, 0].set_ylim(min(low, -FLAT_AXIS_CM), max(high, FLAT_AXIS_CM))
    for axis in axes[:, 0]:
        axis.set_ylabel("residual [cm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="lower right", ncols=3, borderaxespad=0.1)
    return figure


def _draw_residual(axis: Axes, result: LoopResult, what: str, name: str) -> None:
    """One column's fifths, over what chance gives."""
    group = f"{what} by {name}"
    place = np.arange(len(result.scored.real[group]))
    floor = 100.0 * TWO_ERRORS * result.lack_of_fit.floors[group]
    axis.fill_between(place, -floor, floor, color=MUTED, alpha=0.2, linewidth=0, label="sampling error")
    axis.axhline(0.0, color=MUTED, linewidth=0.6)
    for values, color, label in ((result.scored.before, BEFORE, "before"), (result.scored.after, AFTER, "after")):
        axis.plot(
            place, 100.0 * (result.scored.real[group] - values[group]), "o-", color=color, markersize=3, label=label
        )
    _name_bins(axis, result.scored.statistics.middles[name], name)
    axis.set_title(column_label(name, hint=False))


@figure_style()
def effect_figure(result: LoopResult, finding: Finding) -> Figure:
    """An effect's curve with its uncertainty over measured points, beside what held-out blocks show."""
    effect = finding.effects[0]
    assert isinstance(effect, ColumnEffect)
    figure, axes = new_figure(1, 2, height=3.3)
    _draw_curve(axes[0, 0], result, effect)
    _draw_held_out(axes[0, 1], result, finding, effect)
    return figure


def _draw_held_out(axis: Axes, result: LoopResult, finding: Finding, effect: ColumnEffect) -> None:
    """The statistics that show an effect best, on blocks that it was not fitted on."""
    name = finding.statistic.split(" by ", 1)[1]
    bins = _in_unit(effect, result.scored.statistics.middles[name])
    for values, color, label in (
        (result.scored.real, DRIVES, "measured"),
        (result.scored.before, BEFORE, "profile before"),
        (result.scored.after, AFTER, "profile after"),
    ):
        axis.plot(bins, values[finding.statistic], "o-", color=color, markersize=3.5, label=label)
    on_mean = effect.acts is Acts.LOCATION
    axis.set_title("Held-out blocks")
    axis.set_xlabel("shift by the effect [m]" if on_mean else "factor by the effect [-]")
    axis.set_ylabel("mean offset [m]" if on_mean else f"{SPREAD} [m]")
    axis.legend()


@figure_style()
def spectrum_figure(result: LoopResult, finding: Finding | None = None) -> Figure:
    """Power density of measured offsets and of both profiles' held-out runs."""
    figure, axes = new_figure(height=3.4)
    axis = axes[0, 0]
    draw_spectra(axis, result, SPECTRUM_ROWS)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.legend()
    return figure


def draw_spectra(axis: Axes, result: LoopResult, segment: int, *, within_blocks: bool = True) -> None:
    """Measured spectrum with its uncertainty, and the mean of either profile's runs; `segment` in samples."""
    timeline = result.coarse.timeline
    seams = hold_out_blocks(timeline) if within_blocks else timeline.drive
    together = timeline.valid & np.r_[True, seams[1:] == seams[:-1]]
    segment = min(segment, max(part.stop - part.start for part in true_slices(together)))  # runs may all be shorter
    frequency, density, number = gapped_spectrum(timeline.offset[None], timeline.valid, seams, timeline.step, segment)
    _draw_measured(axis, frequency, density, number)
    for runs, color, label, style in (
        (result.scored.runs_before, BEFORE, "profile before", "-"),
        (result.scored.runs_after, AFTER, "profile after", "--"),
    ):
        frequency, density, _ = gapped_spectrum(runs, timeline.valid, seams, timeline.step, segment)
        axis.plot(frequency, density, color=color, label=label, linestyle=style)
    axis.set_xlabel("frequency [Hz]")
    axis.set_ylabel("power density [m²/Hz]")


def _draw_measured(axis: Axes, frequency: FloatArray, density: FloatArray, number: float) -> None:
    """With what so many periodograms leave open."""
    # the mean of so many independent periodograms, which overlap by half
    about = TWO_ERRORS / np.sqrt(max(0.75 * number, 1.0))
    low, high = density * np.exp(-about), density * np.exp(about)
    axis.fill_between(frequency, low, high, color=DRIVES, alpha=0.2, linewidth=0)
    axis.plot(frequency, density, color=DRIVES, label="measured (band: two standard errors)")


@figure_style()
def violins_figure(result: LoopResult) -> Figure:
    """The ten metrics: measured to the left, the profile after to the right, the profile before as an outline."""
    scores = result.scores
    figure, axes = new_figure(2, 5, height=5.2)
    for k, (axis, name) in enumerate(zip(axes.ravel(), METRICS, strict=True)):
        _draw_violins(axis, scores, k)
        axis.set_title(LABELS[name])
        axis.grid(False, axis="x")
    for axis in axes[:, 0]:
        axis.set_ylabel("[m]")
    return figure


def _draw_violins(axis: Axes, scores: Scorecard, k: int) -> None:
    """One metric: measured, after and before."""
    for values, side, color, filled in (
        (scores.real[:, k], -1.0, DRIVES, True),
        (scores.sampled_after[:, k], 1.0, AFTER, True),
        (scores.sampled_before[:, k], 1.0, BEFORE, False),
    ):
        grid, density = density_over(values)
        width = side * 0.95 * density / density.max()
        if filled:
            axis.fill_betweenx(grid, 0.0, width, color=color, alpha=0.35, linewidth=0)
        axis.plot(width, grid, color=color, linewidth=0.9, linestyle="-" if filled else "--")
        axis.plot([0.0, 0.8 * side], [values.mean()] * 2, color=color, linewidth=1.6 if filled else 1.0)
    axis.axvline(0.0, color=GRID, linewidth=0.8)
    axis.set_xticks([-0.5, 0.5], ["measured", "profile"], fontsize=8.0)
    axis.set_xlim(-1.15, 1.15)


def _draw_curve(axis: Axes, result: LoopResult, effect: ColumnEffect) -> None:
    curve = curve_of(result, effect)
    middle, low, high = (
        _in_unit(effect, curve.strength + share * curve.error) for share in (0.0, -TWO_ERRORS, TWO_ERRORS)
    )
    axis.fill_between(curve.over, low, high, color=AFTER, alpha=0.2, linewidth=0, label="two standard errors")
    axis.plot(curve.over, middle, color=AFTER, label="fitted effect")
    if len(curve.seen):
        _draw_points(axis, curve, effect)
    axis.set_title("The effect")
    axis.set_xlabel(_quantity_label(effect))
    axis.set_ylabel("shift of the mean [m], positive to the left" if effect.acts is Acts.LOCATION else "factor [-]")
    axis.locator_params(axis="x", nbins=6)
    axis.legend()


def _draw_points(axis: Axes, curve: Curve, effect: ColumnEffect) -> None:
    points, bottom, top = (
        _in_unit(effect, curve.measured + share * curve.measured_error) for share in (0.0, -TWO_ERRORS, TWO_ERRORS)
    )
    axis.errorbar(
        curve.seen, points, np.stack([points - bottom, top - points]),
        color=DRIVES, fmt="o", markersize=3.5, elinewidth=1.0, label="measured",
    )  # fmt: skip


def _in_unit(effect: ColumnEffect, strength: FloatArray) -> FloatArray:
    return strength if effect.acts is Acts.LOCATION else np.exp(strength)


def _quantity_label(effect: ColumnEffect) -> str:
    if isinstance(effect, Product):
        return product_label(effect)
    return column_label(effect.columns[0])


def _shown(result: LoopResult, what: str) -> list[str]:
    """Columns with a panel, those of the findings first."""
    names = [
        name
        for name in result.scored.statistics.labels
        if f"{what} by {name}" in result.scored.real and not name.startswith("effect: ")
    ]
    acting = {column for finding in result.findings for column in finding.columns}
    return sorted(names, key=lambda name: not any(column == name or f"({column})" in name for column in acting))


def _name_bins(axis: Axes, middles: FloatArray, name: str) -> None:
    """Bins stand side by side; the outer ones and the middle one say what the column is there."""
    last = len(middles) - 1
    marked: Sequence[int] = sorted({0, last // 2, last})
    # what a smoothed switch decays to is as good as 0
    shown = np.where(np.abs(middles) < NEGLIGIBLE * np.nanmax(np.abs(middles)), 0.0, middles)
    labels = [f"{100 * shown[k]:.0f} %" if name == "time" else _short(shown[k]) for k in marked]
    axis.set_xticks(list(marked), labels, fontsize=8.0)
    axis.set_xlim(-0.3, last + 0.3)


def _short(value: float) -> str:
    """Two digits, without an exponent up to thousands; a bin of NaN is where there is none."""
    if np.isnan(value):
        return "none"
    return f"{value:.0f}" if 10.0 <= abs(value) < 1e4 else f"{value:.2g}"
