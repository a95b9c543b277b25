"""Regimes against a movement whose loudness comes in clusters of seconds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from xosc_lateral.extras.loop.terms.hidden import probability_of_persistence
from xosc_lateral.extras.loop.terms.spread import Squares

N = 3000


def clusters(variance: float, memory: float, seed: int, n: int = N) -> np.ndarray:
    """White rows times a log-normal loudness that remembers for `memory` seconds."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-1.0 / memory)
    loudness = lfilter([np.sqrt(variance * (1.0 - keep**2))], [1.0, -keep], rng.normal(size=n + 200))[200:]
    return np.exp(loudness) * rng.normal(size=n)


def regimes(factor: float, on_s: float, off_s: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    loud, on, out = rng.random(N), False, np.empty(N)
    for t in range(N):
        on = on if loud[t] > 1.0 / (on_s if on else off_s) else not on
        out[t] = factor if on else 1.0
    return out * rng.normal(size=N)


def probability(rows: np.ndarray, valid: np.ndarray, seed: int) -> float:
    squares = Squares(rows**2, valid).standardised
    return probability_of_persistence(squares, valid, np.zeros((len(rows), 0)), np.random.default_rng(seed))


def test_seconds_that_are_cut_out_do_not_count() -> None:
    rows = clusters(0.3, 3.0, 5, 2 * N)
    valid = np.arange(2 * N) % 400 < 250
    spoilt = np.where(valid, rows, 1e6)
    assert probability(spoilt, valid, 1) == probability(np.where(valid, rows, 0.0), valid, 1)


def test_regimes_that_are_known_are_not_found_again() -> None:
    rows, valid = regimes(2.5, 60.0, 120.0, 3), np.ones(N, dtype=np.bool_)
    loud = (np.convolve(rows**2, np.ones(15) / 15, "same") > 2.5).astype(float)[:, None]
    squares = Squares(rows**2, valid).standardised
    alone = probability_of_persistence(squares, valid, np.zeros((N, 0)), np.random.default_rng(1))
    beside = probability_of_persistence(squares, valid, loud, np.random.default_rng(1))
    assert alone < 1e-3 < 0.01 < beside


@pytest.mark.pages
@pytest.mark.parametrize("memory", [1.0, 3.0, 6.0])
def test_clusters_of_seconds_are_no_regimes(memory: float) -> None:
    valid = np.ones(N, dtype=np.bool_)
    p_values = [probability(clusters(0.25, memory, seed), valid, seed) for seed in range(12)]
    assert np.mean(np.less(p_values, 0.05)) <= 0.25
    assert np.median(p_values) > 0.1


def test_regimes_of_a_minute_are_no_clusters() -> None:
    valid = np.ones(N, dtype=np.bool_)
    for seed in range(4):
        rows = regimes(2.5, 60.0, 120.0, seed)
        assert probability(rows, valid, seed) < 0.002
