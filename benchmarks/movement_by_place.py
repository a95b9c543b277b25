"""How much of a recording's movement belongs to the place? One half of the vehicles tells for the other, band by band.

    python -m benchmarks.movement_by_place tasi-0.15.4-py3-none-any.whl [--write PAGE.md]

"The same path": mean of the offset's movement over one half of the vehicles in every 10 m of a lane, and how much of
the other half's variance it tells. "The same level": mean log power in every 100 m of a carriageway, likewise. Speed
stands beside the offset: who steers briskly at one place has no need to show an uneven speed there.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.dlr_stretches import Recording
from benchmarks.markers import show
from xosc_lateral.formats.importers.dlr_ht import STEP

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BANDS = ((0.1, 0.2), (0.2, 0.3), (0.3, 0.5), (0.6, 0.95))  # [Hz]
COLUMNS = ("offset", "speed")
EDGE, LEAST = 2.0, 20.0  # [s]; left out at the ends of a stretch, where filters settle; shorter stretches are left out
SHORT, LONG = 10.0, 100.0  # pieces of the road for the path and for the level [m]
ROWS = 60  # of either half in a piece: three vehicles or so [-]
PASSAGES, PASSAGE_ROWS = 8, 20  # of either half in a piece, and rows of one [-]
FAINTEST = 1e-12  # [m2] or [m2/s2]


class Movement:
    """Filtered columns, shape (n, columns * bands), and where and whose each row is."""

    def __init__(self, source: Path) -> None:
        from scipy.signal import butter, sosfiltfilt

        recording = Recording.read(source)
        columns = [recording.table[name].to_numpy() for name in COLUMNS]
        filters = [butter(2, band, "bandpass", fs=1.0 / STEP, output="sos") for band in BANDS]
        edge, rows, parts = round(EDGE / STEP), [], []
        for part in recording.stretches(LEAST):
            rows.append(np.arange(part.start + edge, part.stop - edge))
            moved = [sosfiltfilt(one, values[part])[edge:-edge] for values in columns for one in filters]
            parts.append(np.column_stack(moved))
        at = np.concatenate(rows)
        self.values = np.concatenate(parts)
        self.vehicle = recording.vehicle[at]
        self.first_half = self.vehicle % 2 == 0
        place, north = recording.place, recording.north
        lane = recording.table["lane_index"].to_numpy()[at].astype(np.int64)
        self.short = (place[at] // SHORT).astype(np.int64) * 4 + north[at] * 2 + lane
        self.long = (place[at] // LONG).astype(np.int64) * 2 + north[at]

    def same_path(self, column: int) -> float:
        """Share of the second half's variance that the first half's mean path tells. [-]"""
        values, size = self.values[:, column], self.short.max() + 1
        counts = [np.bincount(self.short[mine], minlength=size) for mine in (self.first_half, ~self.first_half)]
        sums = np.bincount(self.short[self.first_half], values[self.first_half], minlength=size)
        told = sums / np.maximum(counts[0], 1)
        rows = ~self.first_half & (np.minimum(*counts) >= ROWS)[self.short]
        left = values[rows] - told[self.short[rows]]
        return float(1.0 - (left**2).mean() / (values[rows] ** 2).mean())

    def same_level(self, column: int) -> tuple[FloatArray, float]:
        """Mean log power in each long piece, NaN where too few passed, and the share of the variance that it tells."""
        size = self.long.max() + 1
        means, passages = [], []
        for mine in (self.first_half, ~self.first_half):
            key, place = np.unique(self.long[mine] * (self.vehicle.max() + 1) + self.vehicle[mine], return_inverse=True)
            rows = np.bincount(place)
            power = np.log(np.bincount(place, self.values[mine, column] ** 2) / rows + FAINTEST)
            enough = rows >= PASSAGE_ROWS
            piece, power = key[enough] // (self.vehicle.max() + 1), power[enough]
            count = np.bincount(piece, minlength=size)
            mean = np.bincount(piece, power, minlength=size) / np.maximum(count, 1)
            means.append(np.where(count >= PASSAGES, mean, np.nan))
            passages.append((piece, power))
        both = 0.5 * (means[0] + means[1])
        piece, power = passages[1]
        known = np.isfinite(both[piece])
        left = power[known] - means[0][piece[known]]
        return both, float(1.0 - (left**2).mean() / power[known].var())


def table(movement: Movement) -> list[str]:
    lines = [
        "| movement of | band [Hz] | the same path tells | the same level tells | correlation with the speed's level |",
        "|---|---|---|---|---|",
    ]
    speed = [movement.same_level(len(BANDS) + k)[0] for k in range(len(BANDS))]
    for number, name in enumerate(COLUMNS):
        for k, (low, high) in enumerate(BANDS):
            column = number * len(BANDS) + k
            level, told = movement.same_level(column)
            known = np.isfinite(level) & np.isfinite(speed[k])
            together = "" if number else f"{np.corrcoef(level[known], speed[k][known])[0, 1]:.2f}"
            path = movement.same_path(column)
            lines.append(f"| {name} | {low:g} to {high:g} | {100 * path:.0f} % | {100 * told:.0f} % | {together} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    show("\n".join(table(Movement(args.source))), args.write, "movement-by-place")


if __name__ == "__main__":
    main()
