"""Drivers that differ: one is drawn for a drive and stays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from xosc_lateral.drivers.model.effects import Population

N = 800


def drawn(effect: Population) -> np.ndarray:
    """Shift, spread and fine factor of many drivers, shape (N, 3)."""
    states = [effect.begin(np.random.default_rng(seed), 0.2) for seed in range(N)]
    return np.array([(state.shift, state.spread, state.fine) for state in states])


def test_shifts_are_normal_and_factors_log_normal_with_the_sizes_told() -> None:
    shift, spread, fine = drawn(Population(shift=0.15, log_spread=0.25, log_fine=0.1)).T
    for values, size in ((shift, 0.15), (np.log(spread), 0.25), (np.log(fine), 0.1)):
        assert stats.kstest(values / size, "norm").pvalue > 0.001
        assert values.std() == pytest.approx(size, rel=4.0 / np.sqrt(2 * N))


def test_what_a_driver_has_of_one_says_nothing_of_the_others() -> None:
    shift, spread, fine = drawn(Population(shift=0.15, log_spread=0.25, log_fine=0.1)).T
    related = np.corrcoef([shift, np.log(spread), np.log(fine)])[np.triu_indices(3, 1)]
    assert np.abs(related).max() < 4.0 / np.sqrt(N)


def test_drivers_who_are_alike_are_the_plain_movement() -> None:
    assert np.array_equal(drawn(Population(shift=0.0)), np.tile([0.0, 1.0, 1.0], (N, 1)))


def test_the_driver_stays_for_all_blocks() -> None:
    effect = Population(shift=0.2, log_spread=0.3, log_fine=0.2)
    state = effect.begin(np.random.default_rng(1), 0.2)
    first, later = effect.advance(state, np.arange(3.0), 1.0), effect.advance(state, np.arange(1000.0, 1005.0), 1.0)
    for part in ("location", "spread", "fine"):
        values = np.concatenate([getattr(first, part), getattr(later, part)])
        assert len(values) == 8
        assert np.ptp(values) == 0.0
    assert first.rate is None
