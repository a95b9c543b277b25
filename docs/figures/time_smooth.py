"""The picture of docs/design/identification.md: cosine coefficients of squares, with and without a change in time."""

from __future__ import annotations

import sys

import numpy as np
from scipy.fft import dct

from xosc_lateral.identification.low_frequencies import SHORTEST_S, SPREAD_ORDERS
from xosc_lateral.report.figures import MUTED, ORANGE, figure_style, new_figure

SECONDS = 3000


@figure_style()
def picture(path: str) -> None:
    """White rows of 50 min, loud in clusters of 15 s; in the second drive the spread dies away besides."""
    rng = np.random.default_rng(3)
    loud = np.repeat(np.exp(0.4 * rng.normal(size=SECONDS // 15)), 15)
    rows = loud * rng.normal(size=SECONDS)
    learning = np.exp(0.7 * np.exp(-np.arange(SECONDS) / 420.0))
    figure, axes = new_figure(1, 2, height=2.6, sharey=True)
    last = round(2 * SECONDS / SHORTEST_S)
    for axis, own, title in ((axes[0, 0], rows, "nothing changes"), (axes[0, 1], rows * learning, "a driver learns")):
        squares = np.minimum(own**2 / np.mean(own**2), 9.0)
        power = np.square(dct(squares - squares.mean(), norm="ortho")[1 : last + 1])
        colours = [ORANGE if k < max(SPREAD_ORDERS) else MUTED for k in range(last)]
        axis.bar(np.arange(1, last + 1), power, color=colours)
        axis.set_title(title)
        axis.set_xlabel("half cosines in 50 min")
    axes[0, 0].set_ylabel("power of the squares [-]")
    figure.savefig(path, format="svg", metadata={"Date": None}, facecolor="white")


if __name__ == "__main__":
    picture(sys.argv[1])
