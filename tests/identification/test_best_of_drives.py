"""The best candidate between drives: planted ones are found, and chance as often as it says."""

from __future__ import annotations

import numpy as np

from xosc_lateral.identification.terms.between import best_of_drives

DRIVES = 300


def made(rng: np.random.Generator, sizes: dict[int, float], candidates: int = 12) -> tuple[int, float]:
    """Search among candidates; `sizes`: of what they do."""
    values = rng.normal(size=(DRIVES, candidates))
    quantities = values - values.mean(axis=0)
    quantities /= np.linalg.norm(quantities, axis=0)
    left = rng.normal(size=DRIVES) + sum(size * quantities[:, index] for index, size in sizes.items())
    left -= left.mean()
    costs = np.full(candidates, 2.0 * np.log(candidates))
    return best_of_drives(left / left.std(), np.ones(DRIVES, dtype=bool), quantities, costs, rng)


def test_a_strong_column_is_found_alone() -> None:
    for seed in range(5):
        found = made(np.random.default_rng(seed), {3: 8.0})
        assert found[0] == 3
        assert found[1] < 1e-4


def test_p_values_of_chance_are_uniform() -> None:
    p = np.array([made(np.random.default_rng(1000 + seed), {})[1] for seed in range(120)])
    # Kolmogorov-Smirnov at 1 in 1000: 1.95 / sqrt(n)
    assert np.max(np.abs(np.sort(p) - (np.arange(len(p)) + 0.5) / len(p))) < 1.95 / np.sqrt(len(p))


def test_drives_that_are_too_short_are_not_dealt() -> None:
    rng = np.random.default_rng(2)
    counted = np.arange(DRIVES) < 40
    values = np.where(counted, rng.normal(size=DRIVES), 0.0)
    values = (values / np.linalg.norm(values))[:, None]
    left = np.where(counted, rng.normal(size=DRIVES), 0.0) + 7.0 * values[:, 0]
    assert best_of_drives(left, counted, values, np.zeros(1), rng)[1] < 1e-3
