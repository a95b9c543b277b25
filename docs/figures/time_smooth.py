"""The picture of docs/design/identification.md: cosine coefficients of squares, with and without a change in time."""

from __future__ import annotations

import sys

import numpy as np
from scipy.fft import dct

from xosc_lateral.extras.loop.low_frequencies import SHORTEST_S, SPREAD_ORDERS
from xosc_lateral.files.pages.chart import MUTED, ORANGE
from xosc_lateral.files.pages.figure import Figure

SECONDS = 3000


def picture(path: str) -> None:
    """White rows of 50 min, loud in clusters of 15 s; in the second drive the spread dies away besides."""
    rng = np.random.default_rng(3)
    loud = np.repeat(np.exp(0.4 * rng.normal(size=SECONDS // 15)), 15)
    rows = loud * rng.normal(size=SECONDS)
    learning = np.exp(0.7 * np.exp(-np.arange(SECONDS) / 420.0))
    figure = Figure(1, 2, height=130.0, share_y="all", legend=True)
    last = round(2 * SECONDS / SHORTEST_S)
    orders = np.arange(1, last + 1)
    for panel, own, title in zip(
        figure.panels, (rows, rows * learning), ("nothing changes", "a driver learns"), strict=True
    ):
        squares = np.minimum(own**2 / np.mean(own**2), 9.0)
        power = np.square(dct(squares - squares.mean(), norm="ortho")[1 : last + 1])
        low = orders <= max(SPREAD_ORDERS)
        for part, color, label in ((low, ORANGE, "the lowest orders"), (~low, MUTED, "higher ones")):
            for order, height in zip(orders[part], power[part], strict=True):
                panel.line((order, order), (0.0, height), color, width=4.0, label=label)
        panel.title, panel.x.label = title, "half cosines in 50 min"
    figure.panels[0].y.label = "power of the squares [-]"
    figure.save(path)


if __name__ == "__main__":
    picture(sys.argv[1])
