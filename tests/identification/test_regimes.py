"""Regimes against a movement whose loudness comes in clusters of seconds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from xosc_lateral.identification.terms.regimes import CLUSTER_S, fit_clusters, probability_of_clusters

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


def test_variance_and_memory_of_loudness_are_found() -> None:
    fits = [fit_clusters(clusters(0.3, 3.0, seed), np.ones(N, dtype=np.bool_)) for seed in range(20)]
    variance, memory = np.mean(fits, axis=0)
    assert variance == pytest.approx(0.3, rel=0.15)
    assert memory == pytest.approx(3.0, rel=0.25)


def test_loudness_that_stays_the_same_has_no_variance() -> None:
    variances = [
        fit_clusters(np.random.default_rng(seed).normal(size=N), np.ones(N, dtype=np.bool_))[0] for seed in range(10)
    ]
    assert max(variances) < 0.1


def test_seconds_that_are_cut_out_do_not_count() -> None:
    rows = clusters(0.3, 3.0, 5, 2 * N)
    valid = np.arange(2 * N) % 400 < 250
    spoilt = np.where(valid, rows, 1e6)
    assert fit_clusters(spoilt, valid) == pytest.approx(fit_clusters(np.where(valid, rows, 0.0), valid))


def test_memory_is_bounded_where_loudness_lasts_for_a_minute() -> None:
    assert fit_clusters(regimes(2.5, 60.0, 120.0, 1), np.ones(N, dtype=np.bool_))[1] == pytest.approx(CLUSTER_S)


@pytest.mark.parametrize("memory", [1.0, 3.0, 6.0])
def test_clusters_of_seconds_are_no_regimes(memory: float) -> None:
    valid = np.ones(N, dtype=np.bool_)
    p_values = [
        probability_of_clusters(clusters(0.25, memory, seed), valid, np.zeros((N, 0)), np.random.default_rng(seed))
        for seed in range(12)
    ]
    assert np.mean(np.less(p_values, 0.05)) <= 0.25
    assert np.median(p_values) > 0.1


def test_regimes_of_a_minute_are_no_clusters() -> None:
    valid = np.ones(N, dtype=np.bool_)
    for seed in range(4):
        rows = regimes(2.5, 60.0, 120.0, seed)
        p_value = probability_of_clusters(rows, valid, np.zeros((N, 0)), np.random.default_rng(seed))
        assert p_value < 0.002
