"""Figures of effects that no column explains: each shows where in the data the effect can be seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Cycle, Regimes, Step, TimeSmooth
from xosc_lateral.identification.close import Finding, LoopResult
from xosc_lateral.report.figures import MUTED, ORANGE, figure_style, new_figure
from xosc_lateral.report.loop_courses import (
    MovingStatistic,
    hidden_mean,
    moving_mean,
    moving_spread,
    regime_probability,
)
from xosc_lateral.report.loop_figures import AFTER, BEFORE, DRIVES, TWO_ERRORS, draw_spectra, spectrum_figure
from xosc_lateral.report.loop_words import SPREAD

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

CYCLE_ROWS = 4096
"""Samples per segment of a cycle's spectrum at most: 14 min, or a line would be smeared. [-]"""

SURROUNDINGS_HZ = 0.07
"""To either side of a cycle's line. [Hz]"""

MEAN_S, SPREAD_S, REGIME_S = 120.0, 240.0, 20.0
"""Averaging times of the paths of the mean, of the spread, and of the spread with regimes. [s]"""

GAP_S = 5.0
"""Longer gaps in a drive interrupt a line. [s]"""

QUANTILES_CAPTION = "Distribution of the local spread of the movement on held-out blocks."

QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""As `loop.residual.LOCAL_QUANTILES`."""


@figure_style()
def cycle_figure(result: LoopResult, finding: Finding) -> Figure:
    """Spectrum about the cycle's frequency, the line marked."""
    effect = finding.effects[0]
    assert isinstance(effect, Cycle)
    figure, axes = new_figure(height=3.3)
    axis = axes[0, 0]
    longest = int(np.bincount(result.scored.statistics.timeline.drive).max())
    segment = min(CYCLE_ROWS, 2 ** int(np.log2(longest)))
    draw_spectra(axis, result, segment, within_blocks=False)
    line = 1.0 / effect.period_s
    axis.set_yscale("log")
    low, high = max(0.0, line - SURROUNDINGS_HZ), line + SURROUNDINGS_HZ
    axis.set_xlim(low, high)
    _fit_height(axis, low, high)
    label = f"fitted oscillation: {line:.3f} Hz, once in {effect.period_s:.1f} s"
    axis.axvline(line, color=ORANGE, linewidth=6.0, alpha=0.4, zorder=0, label=label)
    axis.legend()
    return figure


@figure_style()
def spread_figure(result: LoopResult, finding: Finding) -> Figure:
    """Spread over time, with the fitted curve."""
    effect = finding.effects[0]
    assert isinstance(effect, TimeSmooth)
    moving = moving_spread(result, SPREAD_S)
    curve = effect.path(effect.spread, moving.time)
    waves = [effect.path(tuple(row), moving.time) for row in np.eye(len(effect.spread))]
    error = np.sqrt(sum(np.square(wave * own) for wave, own in zip(waves, effect.spread_errors, strict=True)))

    def fitted(times: float) -> FloatArray:
        level = float(np.mean(np.log(moving.measured) - curve))
        return np.asarray(np.exp(level + curve + times * error))

    figure, axes = new_figure(height=3.2)
    axis = axes[0, 0]
    _draw_statistic(axis, moving)
    low, high = (fitted(sign * TWO_ERRORS) for sign in (-1.0, 1.0))
    axis.fill_between(moving.time, low, high, color=ORANGE, alpha=0.25, linewidth=0)
    axis.plot(moving.time, fitted(0.0), color=ORANGE, label=f"fitted: factor {finding.size_m:.2f}")
    axis.set_ylim(bottom=0.0)
    axis.set_ylabel(f"spread over {SPREAD_S / 60:.0f} min [m]")
    axis.legend()
    return figure


@figure_style()
def regime_figure(result: LoopResult, finding: Finding) -> Figure:
    """Local spread over time with the probability of the loud regime, and how often which spread occurs."""
    figure, axes = new_figure(2, 1, height=4.8, sharex=True, height_ratios=[2.2, 1.0])
    moving, on = moving_spread(result, REGIME_S), regime_probability(result)
    axis = axes[0, 0]
    axis.plot(moving.time, _gapped(moving, moving.measured), color=DRIVES, linewidth=0.8, label="measured")
    loud = on > 0.5
    top = float(moving.measured.max()) * 1.05
    axis.fill_between(
        moving.time,
        0.0,
        top,
        where=list(loud),
        color=ORANGE,
        alpha=0.3,
        linewidth=0,
        label="large spread more likely than not",
    )
    axis.set_ylim(0.0, top)
    axis.set_ylabel(f"spread within {REGIME_S:.0f} s [m]")
    axis.legend(loc="upper right")
    axis = axes[1, 0]
    axis.plot(moving.time, _gapped(moving, on), color=ORANGE, linewidth=0.8)
    axis.set_ylim(-0.03, 1.03)
    axis.set_ylabel("probability of large spread [-]")
    axis.set_xlabel("time [s]")
    return figure


@figure_style()
def mean_figure(result: LoopResult, finding: Finding) -> Figure:
    """Moving mean with the fitted step or drift."""
    moving = moving_mean(result, MEAN_S)
    hidden = hidden_mean(result)
    figure, axes = new_figure(height=3.2)
    axis = axes[0, 0]
    _draw_statistic(axis, moving)
    word = "step" if isinstance(finding.effects[0], Step) else "smooth change"
    axis.plot(moving.time, hidden + moving.measured.mean(), color=ORANGE, linewidth=2.0, label=f"fitted {word}")
    axis.set_ylabel(f"mean over {MEAN_S / 60:.0f} min [m], positive to the left")
    axis.legend()
    return figure


def time_figure(result: LoopResult, finding: Finding) -> Figure:
    """Mean or spread over time, with the fitted curve."""
    effect = finding.effects[0]
    assert isinstance(effect, TimeSmooth)
    return mean_figure(result, finding) if effect.location else spread_figure(result, finding)


@figure_style()
def quantiles_figure(result: LoopResult, finding: Finding | None = None) -> Figure:
    """Quantiles of the local spread, measured and of both profiles."""
    figure, axes = new_figure(height=2.8)
    axis = axes[0, 0]
    for values, color, label in (
        (result.scored.real, DRIVES, "measured"),
        (result.scored.before, BEFORE, "profile before"),
        (result.scored.after, AFTER, "profile after"),
    ):
        axis.plot(100.0 * np.asarray(QUANTILES), values["quantiles of local spread"], "o-", color=color, label=label)
    axis.set_xlabel("share of the time with less spread [%]")
    axis.set_ylabel(f"{SPREAD} [m]")
    axis.set_ylim(bottom=0.0)
    axis.legend()
    return figure


DRAWINGS: Mapping[str, tuple[Callable[[LoopResult, Finding], Figure], str]] = MappingProxyType(
    {
        Cycle.kind: (
            cycle_figure,
            "Power spectral density about the fitted oscillation, a peak that the profile before does not have.",
        ),
        TimeSmooth.kind: (time_figure, "What changes with time, over the drive; orange: the fitted curve."),
        Regimes.kind: (
            regime_figure,
            "Local spread over the drive; shaded: the regime of large spread is more likely than not.",
        ),
        Step.kind: (mean_figure, "Mean position over the drive; orange: the fitted step."),
        "memory": (
            spectrum_figure,
            "Power spectral density of the movement, measured and of both profiles.",
        ),
        "population": (quantiles_figure, QUANTILES_CAPTION),
    }
)
"""By kind of effect, or of finding: what draws it, and the caption."""


def _draw_statistic(axis: Axes, moving: MovingStatistic) -> None:
    for values, color, style, label in (
        (moving.measured, DRIVES, "-", "measured"),
        (moving.before, BEFORE, "-", "profile before, all runs"),
        (moving.after, AFTER, "--", "profile after, all runs"),
    ):
        axis.plot(moving.time, _gapped(moving, values), color=color, linestyle=style, linewidth=1.2, label=label)
    axis.axhline(0.0, color=MUTED, linewidth=0.4)
    axis.set_xlabel("time [s]")


def _gapped(moving: MovingStatistic, values: FloatArray) -> FloatArray:
    """NaN at the first second after a gap, so that no line is drawn across it."""
    return np.where(np.diff(moving.time, prepend=moving.time[:1]) > GAP_S, np.nan, values)


def _fit_height(axis: Axes, low: float, high: float) -> None:
    """Height of what lies within the shown frequencies."""
    shown = []
    for curve in axis.get_lines():
        frequency, density = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
        inside = (frequency > low) & (frequency < high) & np.isfinite(density)
        shown += [float(density[inside].min()), float(density[inside].max())] if inside.any() else []
    if shown:
        axis.set_ylim(min(shown) / 1.5, max(shown) * 2.0)
