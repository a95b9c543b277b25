"""Pictures of the board: ranking, windows of every model, spectra and memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.report.figures import INK, MEASURED, MUTED, PALETTE, SAMPLED, figure_style, new_figure, new_panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from xosc_lateral.board.result import Board

STEP = 0.2
COLUMNS = 4
TICKS = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
COLOURED = 5
"""Models with a colour of their own, from the first place on."""

QUIETEST = 1e-7
"""Power densities below are not drawn. [m2/Hz]"""


@figure_style()
def ranking_figure(board: Board) -> Figure:
    """Score of every model with its interval, on a logarithmic axis, and the floor."""
    from matplotlib.ticker import FormatStrFormatter, NullFormatter

    figure, axes = new_figure(height=0.6 + 0.28 * len(board.rows))
    axis = axes[0, 0]
    for place, row in enumerate(board.rows):
        axis.plot([row.low, row.high], [place, place], color=SAMPLED, linewidth=2.0, solid_capstyle="butt")
        axis.plot(row.score, place, "o", color=SAMPLED, markersize=5)
        axis.plot(row.scores_by_half, [place, place], "|", color=INK, markersize=8)
    axis.axvline(1.0, color=MEASURED)
    axis.annotate(
        "other real drivers",
        (1.0, -0.6),
        color=MEASURED,
        ha="left",
        va="bottom",
        xytext=(3, 0),
        textcoords="offset points",
    )
    axis.set_xscale("log")
    low, high = axis.get_xlim()
    axis.set_xticks([tick for tick in TICKS if low <= tick <= high], minor=False)
    axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_yticks(range(len(board.rows)), [row.title for row in board.rows])
    axis.set_ylim(len(board.rows) - 0.4, -0.7)
    axis.set_xlabel("distance from measured driving / floor [-]")
    return figure


@figure_style()
def windows_figure(board: Board) -> Figure:
    """Ten seconds of every model beside the measured ones that begin at the same offset."""
    shown = [("measured", board.real_example), *((row.key, row.example) for row in board.rows)]
    lines = -(-len(shown) // COLUMNS)
    figure, axes = new_panels(lines, COLUMNS, panel_height=1.1, sharex=True, sharey=True)
    time = STEP * np.arange(board.real_example.shape[1])
    reach = 1.15 * float(np.abs(board.real_example).max())
    for number, axis in enumerate(axes.flat):
        if number >= len(shown):
            axis.set_axis_off()
            continue
        _draw_window(axis, *shown[number], time, reach, MEASURED if number == 0 else SAMPLED)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    for axis in axes[:, 0]:
        axis.set_ylabel("offset [m]")
    return figure


def _draw_window(
    axis: Axes, title: str, paths: NDArray[np.float64], time: NDArray[np.floating[Any]], reach: float, color: str
) -> None:
    """Paths of one model, shape (k, n), as far as `reach` to either side. [m]"""
    axis.plot(time, paths.T, color=color, linewidth=1.0)
    axis.set_title(title, fontsize=8.5)
    if reach > 0.0:
        axis.set_ylim(-reach, reach)


@figure_style()
def dynamics_figure(board: Board) -> Figure:
    """Spectrum and autocorrelation of free runs, the first models and the measured runs in colour."""
    from matplotlib.ticker import NullFormatter

    figure, axes = new_figure(1, 2, height=3.4)
    left, right = axes[0]
    for place, row in reversed(list(enumerate(board.rows))):
        color, width = (PALETTE[place], 1.4) if place < COLOURED else (MUTED, 0.6)
        label = row.title if place < COLOURED else None
        left.loglog(board.frequency, np.maximum(row.spectrum, QUIETEST), color=color, linewidth=width, label=label)
        right.plot(board.lags, row.autocorrelation, color=color, linewidth=width)
    left.loglog(board.frequency, board.real_spectrum, color=INK, linewidth=2.2, label="measured")
    right.plot(board.lags, board.real_autocorrelation, color=INK, linewidth=2.2)
    left.set(xlabel="frequency [Hz]", ylabel="power density [m²/Hz]", ylim=(QUIETEST, None))
    right.set(xlabel="lag [s]", ylabel="autocorrelation [-]")
    left.xaxis.set_minor_formatter(NullFormatter())
    left.legend(fontsize=7.5)
    return figure
