"""What a plant did to a drive: the same drive with and without it, compared.

The simulator's road, traffic and noise don't depend on effects. A driver responds to his target only in part, and his
spread is not his tolerance: what a loop can find is what the plant did, not the number that it was given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from examples.driver_simulator.plants import Plant
from examples.driver_simulator.simulator import Driver, simulate_drive

BAND_S = (8.0, 80.0)
"""A driver who lets more pass moves more within such times; what shakes the car within a second stays. [s]"""

PARTS = 6
"""A column is cut at its quantiles into so many."""

STRAY = 1.5
"""Two drives are further apart than this where a lane change was begun in one of them only. [m]"""


@dataclass(frozen=True, eq=False)
class Pair:
    """A drive with and without a plant, row by row."""

    time: np.ndarray
    column: dict[str, np.ndarray]
    moved: np.ndarray
    """Offset with the plant less that without. [m]"""
    meant: np.ndarray
    """The same of the target. [m]"""
    squares: tuple[np.ndarray, np.ndarray]
    """Squared movement within `BAND_S`, with and without. [m2]"""


def paired(plant: Plant, seed: int, duration: float, driver: Driver | None = None) -> Pair:
    """Simulate both."""
    with_it, without = (simulate_drive(duration, seed, effects=e, driver=driver) for e in ([plant], []))
    first, second = with_it.truth, without.truth
    moved = first.offset - second.offset
    rate = 1.0 / float(np.median(np.diff(first.time)))
    kept = ~first.lane_change & (np.abs(moved) < STRAY)
    return Pair(
        first.time[kept],
        {name: with_it.table[name].to_numpy()[kept] for name in ("grade", "rain")},
        moved[kept],
        (first.target - second.target)[kept],
        (_squares(first.offset, rate)[kept], _squares(second.offset, rate)[kept]),
    )


def shift(pair: Pair) -> float:
    """Share of the target's change that the car follows. [-]"""
    meant = pair.meant - pair.meant.mean()
    return float(meant @ pair.moved / (meant @ meant))


def swing(pair: Pair, period: float) -> float:
    """Amplitude of a line in the car's movement. [m]"""
    phase = 2j * np.pi * pair.time / period
    return float(2.0 * np.abs(np.mean((pair.moved - pair.moved.mean()) * np.exp(phase))))


def spread_factor(pair: Pair, quantity: np.ndarray, low: float, high: float) -> float:
    """Spread where a quantity is `high` over that where it is `low`, as the plant has changed it: log-linear. [-]"""
    edges = np.quantile(quantity, np.linspace(0.0, 1.0, PARTS + 1))
    part = np.clip(np.digitize(quantity, edges) - 1, 0, PARTS - 1)
    middles = [quantity[part == k].mean() for k in range(PARTS)]
    ratios = [0.5 * np.log(pair.squares[0][part == k].mean() / pair.squares[1][part == k].mean()) for k in range(PARTS)]
    return float(np.exp(np.polyfit(middles, ratios, 1)[0] * (high - low)))


def _squares(offset: np.ndarray, rate: float) -> np.ndarray:
    smooth = _averaged(offset, round(BAND_S[0] * rate))
    return np.asarray((smooth - _averaged(smooth, round(BAND_S[1] * rate))) ** 2)


def _averaged(values: np.ndarray, length: int) -> np.ndarray:
    return np.convolve(values, np.ones(length) / length, mode="same")
