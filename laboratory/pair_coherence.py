"""Do vehicles beside each other move together? Cross-coherence of pairs, beside that of swapped pairs.

    python -m laboratory.pair_coherence tasi-0.15.4-py3-none-any.whl [--write PAGE.md]

Pairs on neighbouring lanes of one carriageway, less than 20 m apart lengthwise. In a swapped pair the vehicle on the
left is another one of that lane, at the same place at another time: what both share then is the place, not each other.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.dlr_stretches import Recording
from laboratory.markers import show
from xosc_lateral.extras.recordings.importers.dlr_ht import STEP

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BANDS = ((0.04, 0.1), (0.1, 0.2), (0.2, 0.3), (0.3, 0.5))  # [Hz]
EDGE, LEAST = 1.0, 20.0  # [s]; left out at the ends of a stretch; shorter stretches are left out
EVERY = 4  # rows: 0.2 s
BESIDE = 20.0  # [m]
SAME_PLACE = 5.0  # [m]
SWAPS = 20


class Rows:
    """Rows of all stretches, five a second: analytic signal of the offset in every band, and who is where and when."""

    def __init__(self, source: Path) -> None:
        from scipy.signal import butter, hilbert, sosfiltfilt

        recording = Recording.read(source)
        offset = recording.table["offset"].to_numpy()
        filters = [butter(2, band, "bandpass", fs=1.0 / STEP, output="sos") for band in BANDS]
        edge, at, signals = round(EDGE / STEP), [], []
        for part in recording.stretches(LEAST):
            moved = [hilbert(sosfiltfilt(one, offset[part])) for one in filters]
            signals.append(np.column_stack(moved)[edge:-edge:EVERY])
            at.append(np.arange(part.start + edge, part.stop - edge)[::EVERY])
        rows = np.concatenate(at)
        self.signal = np.concatenate(signals)
        self.place, self.north = recording.place[rows], recording.north[rows]
        self.vehicle = recording.vehicle[rows].astype(np.int64)
        self.lane = recording.table["lane_index"].to_numpy()[rows]
        self.instant = (
            np.round(recording.table["time"].to_numpy()[rows] / (EVERY * STEP)).astype(np.int64) * 2 + self.north
        )

    def pairs(self) -> tuple[IntArray, IntArray]:
        """Rows of the vehicle on the right and of the one beside it on the left, shape (n,) each."""
        order = np.argsort(self.instant, kind="stable")
        right, left = [], []
        for together in np.split(order, np.flatnonzero(np.diff(self.instant[order])) + 1):
            slow, fast = together[self.lane[together] == 0], together[self.lane[together] == 1]
            near = np.abs(self.place[slow][:, None] - self.place[fast]) < BESIDE
            one, other = np.nonzero(near)
            right.append(slow[one])
            left.append(fast[other])
        return np.concatenate(right), np.concatenate(left)

    def coherence(self, one: IntArray, other: IntArray) -> FloatArray:
        """Of these rows, in every band. [-]"""
        a, b = self.signal[one], self.signal[other]
        return np.asarray(
            np.abs((a * b.conj()).mean(axis=0)) / np.sqrt((abs(a) ** 2).mean(axis=0) * (abs(b) ** 2).mean(axis=0))
        )

    def swapped(self, right: IntArray, left: IntArray, rng: np.random.Generator) -> tuple[IntArray, IntArray]:
        """Pairs with another vehicle on the left, where that passed the same place."""
        found_right, found_left = [], []
        pairs = self.vehicle[right] * (self.vehicle.max() + 1) + self.vehicle[left]
        for pair in np.unique(pairs):
            rows = np.flatnonzero(pairs == pair)
            mine = (self.lane == 1) & (self.north == self.north[right[rows[0]]])
            instead = np.flatnonzero(mine & (self.vehicle == rng.choice(np.unique(self.vehicle[mine]))))
            instead = instead[np.argsort(self.place[instead])]
            at = np.clip(np.searchsorted(self.place[instead], self.place[left[rows]]), 0, len(instead) - 1)
            near = np.abs(self.place[instead[at]] - self.place[left[rows]]) < SAME_PLACE
            found_right.append(right[rows][near])
            found_left.append(instead[at][near])
        return np.concatenate(found_right), np.concatenate(found_left)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    rows = Rows(args.source)
    right, left = rows.pairs()
    real = rows.coherence(right, left)
    rng = np.random.default_rng(0)
    null = np.array([rows.coherence(*rows.swapped(right, left, rng)) for _ in range(SWAPS)])
    low, high = np.quantile(null, [0.025, 0.975], axis=0)
    lines = ["| band [Hz] | side by side | swapped, 95 % |", "|---|---|---|"]
    for k, (first, last) in enumerate(BANDS):
        lines.append(f"| {first:g} to {last:g} | {real[k]:.2f} | {low[k]:.2f} to {high[k]:.2f} |")
    several = len(np.unique(rows.vehicle[right] * (rows.vehicle.max() + 1) + rows.vehicle[left]))
    lines += ["", f"{several} pairs, {len(right) * EVERY * STEP:.0f} s side by side, swapped {SWAPS} times."]
    show("\n".join(lines), args.write, "pair-coherence")


if __name__ == "__main__":
    main()
