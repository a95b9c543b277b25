"""The picture of docs/design/offset_chains.md: a sampled path and the ring of moves that follows it."""

from __future__ import annotations

import sys

import numpy as np

import xosc_lateral as xl
from xosc_lateral.files.pages.chart import MUTED, ORANGE
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.world.motion.offset_chain import GRID, REST_TIME, closed, ring_along

SHOWN_S = 40.0


def picture(path: str) -> None:
    """Path and ring from the first turn on; joints as dots."""
    sampled = xl.sample("motorway", duration=90.0, seed=4).to_frame()
    time, offset = sampled["time"].to_numpy(), sampled["offset"].to_numpy()
    turn = closed(np.interp(np.arange(time[0], time[-1], GRID), time, offset))
    ring = ring_along(time, offset, from_middle=False)
    start = int(np.argmin(np.abs(np.roll(turn, 0) - ring.origin)))
    turns = np.flatnonzero(np.gradient(turn) * np.roll(np.gradient(turn), 1) <= 0.0)
    start = int(turns[np.argmin(np.abs(turn[turns] - ring.origin))]) if len(turns) else start
    figure = Figure(1, height=80.0, legend=True)
    panel = figure.panels[0]
    shown = np.arange(0.0, SHOWN_S, GRID)
    panel.line(shown, np.roll(turn, -start)[: len(shown)], MUTED, width=3.0, label="sampled")
    moments, places = [0.0], [ring.origin]
    for move in ring.moves:
        share = np.linspace(0.0, 1.0, 40)
        moments += (moments[-1] + move.wait + REST_TIME + share * move.duration).tolist()
        places += (places[-1] + move.change * 0.5 * (1.0 - np.cos(np.pi * share))).tolist()
    until = int(np.searchsorted(moments, SHOWN_S))
    panel.line(moments[:until], places[:until], ORANGE, label="moves")
    panel.x.label, panel.y.label = "time [s]", "offset [m]"
    figure.save(path)


if __name__ == "__main__":
    picture(sys.argv[1])
