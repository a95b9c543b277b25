"""Does the place predict how large the slope jumps of tracks are, for vehicles that were not used?

    python -m benchmarks.slope_jumps_by_place tasi-0.15.4-py3-none-any.whl [--write PAGE.md]

The logarithm of the squared jumps of the slope, averaged in pieces of the road over the vehicles of one half: how these
means correlate with the other half's, and how much of that half's variance they explain.
`python -m benchmarks.slope_jumps` says by how much the level varies in all.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.dlr_stretches import along_road
from benchmarks.markers import show
from xosc_lateral.driver.sensor.slope_jumps_fit import jumps_of
from xosc_lateral.formats.importers.dlr_ht import STEP, read_tracks

FloatArray = NDArray[np.float64]
EVERY = 1.0
"""From one slope jump to the next; `python -m benchmarks.slope_jumps` finds it. [s]"""
PIECES = (50.0, 100.0, 200.0, 500.0)
"""[m]"""
LARGEST = 0.15
"""Larger jumps are at gaps of the tracks. [m/s]"""
FAINT = 3e-4
"""Below it a jump is the rows' rounding. [m/s]"""
LEAST = 8
"""Jumps in a piece, of either half. [-]"""


def jumps_and_places(source: Path) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.int64]]:
    """Log squared jump [-], place [m], direction (True: north) and vehicle of every slope jump."""
    tracks = read_tracks(source)
    vehicle = tracks["vehicle"].to_numpy()
    forward, place, aside = along_road(tracks)
    size, parts = round(EVERY / STEP), []
    for name in np.unique(vehicle):
        rows = np.flatnonzero(vehicle == name)
        even = np.ptp(np.diff(tracks["time"].to_numpy()[rows])) < 0.1 * STEP
        if even and len(rows) >= 20 * size:
            jumps, first = jumps_of(aside[rows], size, 1.0 / STEP)
            at = rows[first + size * np.arange(len(jumps))]
            parts.append((np.log(jumps**2 + FAINT**2), place[at], forward[at], vehicle[at]))
    logs, where, north, whose = (np.concatenate(column) for column in zip(*parts, strict=True))
    usual = logs < 2.0 * np.log(LARGEST)
    return logs[usual], where[usual], north[usual], whose[usual].astype(np.int64)


def told_by_place(logs: FloatArray, piece: NDArray[np.int64], half: NDArray[np.bool_]) -> tuple[int, float, float]:
    """Pieces, correlation of both halves' means, and variance of the other half that one half's tell. [-]"""
    count = [np.bincount(piece[mine], minlength=piece.max() + 1) for mine in (half, ~half)]
    sums = [np.bincount(piece[mine], logs[mine], minlength=piece.max() + 1) for mine in (half, ~half)]
    known = np.minimum(*count) >= LEAST
    mean = [np.divide(a, b, out=np.zeros(len(a)), where=b > 0) for a, b in zip(sums, count, strict=True)]
    seen = ~half & known[piece]
    left = np.mean((logs[seen] - mean[0][piece[seen]]) ** 2)
    correlation = np.corrcoef(mean[0][known], mean[1][known])[0, 1]
    return int(known.sum()), float(correlation), float(logs[seen].var() - left)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    logs, place, north, vehicle = jumps_and_places(args.source)
    half = vehicle % 2 == 0
    lines = ["| pieces of | pieces | correlation of the halves | variance told |", "|---|---|---|---|"]
    for length in PIECES:
        count, correlation, told = told_by_place(logs, (place // length).astype(np.int64) * 2 + north, half)
        lines.append(f"| {length:g} m | {count} | {correlation:.2f} | {told:.2f} |")
    lines += ["", f"{len(logs)} jumps of {len(np.unique(vehicle))} vehicles, both carriageways apart."]
    show("\n".join(lines), args.write, "slope-jumps-by-place")


if __name__ == "__main__":
    main()
