"""Figures of a closed loop: residual by context, effect curves, hidden effects over time, spectra, violins."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from xosc_lateral.base.arrays import FloatArray, true_slices
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Cycle, Product, Regimes, Step, TimeSmooth
from xosc_lateral.extras.loop import loop_curves
from xosc_lateral.extras.loop.close import Finding, LoopResult
from xosc_lateral.extras.loop.identify import hold_out_blocks
from xosc_lateral.extras.loop.loop_curves import gapped_spectrum
from xosc_lateral.extras.loop.loop_words import SPREAD, column_label, product_label
from xosc_lateral.extras.loop.passage import Passage
from xosc_lateral.extras.loop.residual import LOCAL_QUANTILES
from xosc_lateral.extras.loop.timeline import coarse_mean
from xosc_lateral.files.pages.chart import BLUE, DASHED, MUTED, ORANGE, VERMILLION, Panel
from xosc_lateral.files.pages.figure import Figure

# Measured drives, the profile before and the profile after, in every figure of the loop.
DRIVES_COLOR, BEFORE_COLOR, AFTER_COLOR = BLUE, MUTED, VERMILLION
# Samples per segment of a spectrum: 102 s; of that about a cycle, at most: 14 min, or a line would be smeared.
SPECTRUM_ROWS, CYCLE_ROWS = 512, 4096
SURROUNDINGS_HZ = 0.07  # To either side of a cycle's line. [Hz]
TWO_ERRORS = 2.0  # Half width of bands, in standard errors: chance leaves them 1 time in 20. [-]
FLAT_AXIS = 10.0  # A residual's axis reaches at least so far to both sides, lest noise look large. [mm]
ZERO_SHARE = 1e-2  # Share of a column's range that is written as 0. [-]
PANELS = 4  # Residual panels side by side.
WHOLE_NUMBERED = frozenset(["lane_index", "lane_count"])  # No reader takes the mean of a quantile group for a lane.
# Averaging times of the paths of the mean, of the spread, and of the spread with regimes. [s]
MEAN_S, SPREAD_S, REGIME_S = 120.0, 240.0, 20.0
GAP_S = 5.0  # Longer gaps in a drive interrupt a line. [s]


def _three(result: LoopResult) -> tuple[tuple[Mapping[str, FloatArray], str, str], ...]:
    """Statistics by group of cells, colour and name: measured, and of both profiles."""
    scored = result.scored
    return (
        (scored.real, DRIVES_COLOR, "measured"),
        (scored.before, BEFORE_COLOR, "profile before"),
        (scored.after, AFTER_COLOR, "profile after"),
    )


# ---- columns ----
def residual_figure(result: LoopResult, what: str) -> Figure:
    """Measured minus expected by fifths of every column, those of findings first; `what` is "mean" or "spread"."""
    names = [name for name in result.scored.statistics.labels if f"{what} by {name}" in result.scored.real]
    acting = {column for finding in result.findings for column in finding.columns}
    names = sorted(
        (name for name in names if not name.startswith("effect: ")),
        key=lambda name: not any(column == name or f"({column})" in name for column in acting),
    )
    figure = Figure(-(-len(names) // PANELS), PANELS, height=66.0, share_y="all", legend=True)
    for number, (panel, name) in enumerate(zip(figure.panels, names, strict=False)):
        _draw_residual(panel, result, f"{what} by {name}", name)
        panel.y.label = "residual [mm]" if number % PANELS == 0 else ""
    return figure


def _draw_residual(panel: Panel, result: LoopResult, group: str, name: str) -> None:
    """One column's fifths side by side, over what chance gives; the outer ones and the middle one say their value."""
    scored, middles = result.scored, result.scored.statistics.middles[name]
    place = np.arange(len(scored.real[group]))
    floor = 1000.0 * TWO_ERRORS * result.lack_of_fit.floors[group]
    panel.band(place, -floor, floor, MUTED, opacity=0.2, label="sampling error")
    panel.level(color=MUTED)
    for values, color, label in ((scored.before, BEFORE_COLOR, "before"), (scored.after, AFTER_COLOR, "after")):
        residual = 1000.0 * (scored.real[group] - values[group])
        panel.line(place, residual, color, label=label)
        panel.dots(place, residual, color)
    # what a smoothed switch decays to is as good as 0
    shown = np.where(np.abs(middles) < ZERO_SHARE * np.nanmax(np.abs(middles)), 0.0, middles)
    if name in WHOLE_NUMBERED:
        shown = np.round(shown)
    last = len(middles) - 1
    panel.x.ticks = [
        (k, f"{100 * shown[k]:.0f} %" if name == "time" else _short(shown[k])) for k in sorted({0, last // 2, last})
    ]
    panel.x.limits, panel.y.holds = (-0.3, last + 0.3), (-FLAT_AXIS, FLAT_AXIS)
    panel.title = column_label(name, hint=False)


def _short(value: float) -> str:
    """Two digits, without an exponent up to thousands; a bin of NaN is where there is none."""
    if np.isnan(value):
        return "none"
    return f"{value:.0f}" if 10.0 <= abs(value) < 1e4 else f"{value:.2g}"


def effect_figure(result: LoopResult, finding: Finding) -> Figure:
    """A course's path in a typical passage, or an effect's curve over measured points; what held-out blocks show."""
    effect = finding.effects[0]
    assert isinstance(effect, ColumnEffect)
    figure = Figure(1, 2, height=180.0, legend=True)
    shown, held_out = figure.panels
    if finding.passage is not None:  # a course has no gain that a curve would show
        _draw_passage(shown, finding.passage, effect.columns[0])
    else:
        _draw_curve(shown, result, effect)
    on_mean = effect.acts is Acts.LOCATION
    bins = result.scored.statistics.middles[finding.statistic.split(" by ", 1)[1]]
    bins = bins if on_mean else np.exp(bins)
    for values, color, label in _three(result):
        held_out.line(bins, values[finding.statistic], color, label=label)
        held_out.dots(bins, values[finding.statistic], color)
    held_out.title = "Held-out blocks"
    held_out.x.label = "shift by the effect [m]" if on_mean else "factor by the effect [-]"
    held_out.y.label = "mean offset [m]" if on_mean else f"{SPREAD} [m]"
    return figure


def _draw_passage(panel: Panel, passage: Passage, column: str) -> None:
    """Where the car is, and, from 0 to the path's height, what the column does."""
    about = TWO_ERRORS * passage.error
    there = coarse_mean(np.nan_to_num((passage.column - np.nan_to_num(passage.usual)) / (passage.high or 1.0)))
    scale = passage.largest_shift[0] / max(float(np.abs(there).max()), 1e-300)
    panel.line(passage.time, scale * there, BEFORE_COLOR, label=f"{column} (scaled)")
    panel.band(passage.time, passage.path - about, passage.path + about, AFTER_COLOR, opacity=0.2)
    panel.line(passage.time, passage.path, AFTER_COLOR)
    panel.title = "Path in a typical passage"
    panel.x.label, panel.y.label = "time from its beginning [s]", "shift, positive to the left [m]"


def _draw_curve(panel: Panel, result: LoopResult, effect: ColumnEffect) -> None:
    on_mean, curve = effect.acts is Acts.LOCATION, loop_curves.curve_of(result, effect)

    def shown(strength: FloatArray) -> FloatArray:
        return strength if on_mean else np.exp(strength)

    about, errors = TWO_ERRORS * curve.error, TWO_ERRORS * curve.measured_error
    low, high = shown(curve.strength - about), shown(curve.strength + about)
    panel.band(curve.over, low, high, AFTER_COLOR, opacity=0.2, label="two standard errors")
    panel.line(curve.over, shown(curve.strength), AFTER_COLOR, label="fitted effect")
    for place, value, error in zip(curve.seen, curve.measured, errors, strict=True):
        panel.line((place, place), shown(np.array([value - error, value + error])), DRIVES_COLOR, width=1.0)
    if len(curve.seen):
        panel.dots(curve.seen, shown(curve.measured), DRIVES_COLOR, label="measured")
    panel.title = "The effect"
    panel.x.label = product_label(effect) if isinstance(effect, Product) else column_label(effect.columns[0])
    panel.y.label = "shift, positive to the left [m]" if on_mean else "factor [-]"


# ---- movement ----
def spectrum_figure(result: LoopResult, finding: Finding | None = None) -> Figure:
    """Power density of measured offsets and of both profiles' held-out runs."""
    figure = Figure(height=170.0, legend=True)
    (panel,) = figure.panels
    draw_spectra(panel, result, SPECTRUM_ROWS)
    panel.x.log = True
    return figure


def draw_spectra(panel: Panel, result: LoopResult, segment: int, *, within_blocks: bool = True) -> None:
    """Measured spectrum with its uncertainty, and the mean of either profile's runs; `segment` in samples."""
    timeline = result.coarse.timeline
    seams = hold_out_blocks(timeline) if within_blocks else timeline.drive
    together = timeline.valid & np.r_[True, seams[1:] == seams[:-1]]
    segment = min(segment, max(part.stop - part.start for part in true_slices(together)))  # runs may all be shorter
    for runs, color, label, dashes in (
        (timeline.offset[None], DRIVES_COLOR, "measured (band: two standard errors)", ""),
        (result.scored.runs_before, BEFORE_COLOR, "profile before", ""),
        (result.scored.runs_after, AFTER_COLOR, "profile after", DASHED),
    ):
        frequency, density, number = gapped_spectrum(runs, timeline.valid, seams, timeline.step, segment)
        if color == DRIVES_COLOR:
            # the mean of so many independent periodograms, which overlap by half
            about = TWO_ERRORS / np.sqrt(max(0.75 * number, 1.0))
            inner = slice(1, None)  # frequency 0 has no place on a logarithmic axis
            low, high = density[inner] * np.exp(-about), density[inner] * np.exp(about)
            panel.band(frequency[inner], low, high, DRIVES_COLOR, opacity=0.2)
        panel.line(frequency[1:], density[1:], color, dashes=dashes, label=label)
    panel.y.log = True
    panel.x.label, panel.y.label = "frequency [Hz]", "power density [m²/Hz]"


# ---- hidden effects ----
def _cycle(result: LoopResult, finding: Finding) -> Figure:
    """Spectrum about the cycle's frequency, the line marked."""
    effect = finding.effects[0]
    assert isinstance(effect, Cycle)
    figure = Figure(height=165.0, legend=True)
    (panel,) = figure.panels
    line = 1.0 / effect.period_s
    low, high = max(0.0, line - SURROUNDINGS_HZ), line + SURROUNDINGS_HZ
    panel.across(
        line - 0.002, line + 0.002, ORANGE, opacity=0.4, label=f"fitted: {line:.3f} Hz, once in {effect.period_s:.1f} s"
    )
    longest = int(np.bincount(result.coarse.timeline.drive).max())
    draw_spectra(panel, result, min(CYCLE_ROWS, 2 ** int(np.log2(longest))), within_blocks=False)
    curves = [curve.y[(curve.x > low) & (curve.x < high)] for curve in panel.curves()]
    seen = np.concatenate([each[np.isfinite(each) & (each > 0.0)] for each in curves])
    panel.x.limits = low, high
    panel.y.limits = (float(seen.min()) / 1.5, float(seen.max()) * 2.0) if len(seen) else None
    return figure


def _time(result: LoopResult, finding: Finding) -> Figure:
    """Mean or spread over time, with the fitted step or curve."""
    effect = finding.effects[0]
    figure = Figure(height=165.0, legend=True)
    (panel,) = figure.panels
    if isinstance(effect, TimeSmooth) and not effect.location:
        moving = loop_curves.moving_spread(result, SPREAD_S)
        curve = effect.path(effect.spread, moving.time)
        waves = [effect.path(tuple(row), moving.time) for row in np.eye(len(effect.spread))]
        error = np.sqrt(sum(np.square(wave * own) for wave, own in zip(waves, effect.spread_errors, strict=True)))
        fitted = float(np.mean(np.log(moving.measured) - curve)) + curve
        low, high = (np.exp(fitted + sign * TWO_ERRORS * error) for sign in (-1.0, 1.0))
        panel.band(moving.time, low, high, ORANGE, opacity=0.25)
        _draw_statistic(panel, moving)
        panel.line(moving.time, np.exp(fitted), ORANGE, label=f"fitted: factor {finding.size_m:.2f}")
        panel.y.holds, panel.y.label = (0.0,), f"spread over {SPREAD_S / 60:.0f} min [m]"
        return figure
    moving = loop_curves.moving_mean(result, MEAN_S)
    _draw_statistic(panel, moving)
    word = "step" if isinstance(effect, Step) else "smooth change"
    fitted = loop_curves.hidden_mean(result) + moving.measured.mean()
    panel.line(moving.time, fitted, ORANGE, width=2.0, label=f"fitted {word}")
    panel.y.label = f"mean over {MEAN_S / 60:.0f} min, positive to the left [m]"
    return figure


def _draw_statistic(panel: Panel, moving: loop_curves.MovingStatistic) -> None:
    for values, color, dashes, label in (
        (moving.measured, DRIVES_COLOR, "", "measured"),
        (moving.before, BEFORE_COLOR, "", "profile before, all runs"),
        (moving.after, AFTER_COLOR, DASHED, "profile after, all runs"),
    ):
        panel.line(moving.time, _gapped(moving, values), color, width=1.2, dashes=dashes, label=label)
    panel.x.label = "time [s]"


def _regimes(result: LoopResult, finding: Finding) -> Figure:
    """Local spread over time where the regime of large spread is likely, and how often which spread occurs."""
    figure = Figure(1, 2, height=165.0, legend=True)
    over_time, quantiles = figure.panels
    moving = loop_curves.moving_spread(result, REGIME_S)
    top = 1.05 * float(moving.measured.max())
    loud = np.where(loop_curves.regime_probability(result) > 0.5, top, np.nan)
    over_time.band(moving.time, 0.0, loud, ORANGE, opacity=0.3, label="large spread more likely than not")
    over_time.line(moving.time, _gapped(moving, moving.measured), DRIVES_COLOR, width=0.8, label="measured")
    over_time.y.limits, over_time.y.label = (0.0, top), f"spread within {REGIME_S:.0f} s [m]"
    over_time.x.label = "time [s]"
    _draw_quantiles(quantiles, result)
    return figure


def _population(result: LoopResult, finding: Finding) -> Figure:
    """Quantiles of the local spread, measured and of both profiles."""
    figure = Figure(height=150.0, legend=True)
    _draw_quantiles(figure.panels[0], result)
    return figure


def _draw_quantiles(panel: Panel, result: LoopResult) -> None:
    for values, color, label in _three(result):
        place, spread = 100.0 * np.asarray(LOCAL_QUANTILES), values["quantiles of local spread"]
        panel.line(place, spread, color, label=label)
        panel.dots(place, spread, color)
    panel.y.holds, panel.y.label = (0.0,), f"{SPREAD} [m]"
    panel.x.label = "share of the time with less spread [%]"


def _gapped(moving: loop_curves.MovingStatistic, values: FloatArray) -> FloatArray:
    """NaN at the first second after a gap, so that no line is drawn across it."""
    return np.where(np.diff(moving.time, prepend=moving.time[:1]) > GAP_S, np.nan, values)


# By kind of effect, or of finding: what draws it, and the caption.
DRAWINGS: Mapping[str, tuple[Callable[[LoopResult, Finding], Figure], str]] = {
    Cycle.kind: (
        _cycle,
        "Power spectral density about the fitted oscillation, a peak that the profile before does not have.",
    ),
    TimeSmooth.kind: (_time, "What changes with time, over the drive; orange: the fitted curve."),
    Regimes.kind: (
        _regimes,
        "Left: local spread over the drive; shaded: the regime of large spread is more likely than not. Right: its "
        "distribution on held-out blocks.",
    ),
    Step.kind: (_time, "Mean position over the drive; orange: the fitted step."),
    "memory": (spectrum_figure, "Power spectral density of the movement, measured and of both profiles."),
    "population": (_population, "Distribution of the local spread of the movement on held-out blocks."),
}
