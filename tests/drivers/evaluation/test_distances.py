"""Distances of samples against scipy, and how metrics are made comparable."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import wasserstein_distance

from tests.kit.snippet_distances import snippet_distances
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.evaluation.metrics import (
    METRICS,
    Distances,
    mean_distances,
    metric_distances,
    snippet_metrics,
    split_groups,
    wasserstein,
)

RNG = np.random.default_rng(1)
ROWS = 0.1 * RNG.normal(size=(60, 51)).cumsum(axis=1)
OTHER = 0.1 * RNG.normal(size=(45, 51)).cumsum(axis=1)


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 7), (50, 50), (50, 31)])
@pytest.mark.parametrize("ties", [False, True])
def test_the_earth_mover_s_distance_is_scipys(n: int, m: int, ties: bool) -> None:
    a, b = RNG.normal(size=n), 0.3 + 2.0 * RNG.normal(size=m)
    if ties:
        a, b = np.round(a), np.round(b)
    assert wasserstein(a, b) == pytest.approx(wasserstein_distance(a, b), abs=1e-12)


def test_it_is_the_shift_of_a_shifted_sample_and_symmetric() -> None:
    a = RNG.normal(size=40)
    assert wasserstein(a, a + 0.15) == pytest.approx(0.15)
    assert wasserstein(a, a - 0.15) == pytest.approx(0.15)
    assert wasserstein(a, a[::-1]) == 0.0


def test_metrics_are_told_in_standard_deviations_of_the_real_ones() -> None:
    real, other = snippet_metrics(ROWS), snippet_metrics(OTHER)
    found = metric_distances(real, other).by_metric
    for k, name in enumerate(METRICS):
        assert found[name] == pytest.approx(wasserstein_distance(real[:, k], other[:, k]) / real[:, k].std())


@pytest.mark.parametrize("factor", [100.0, -1.0])
def test_neither_unit_nor_mirror_changes_the_mean_distance(factor: float) -> None:
    one, other = snippet_distances(ROWS, OTHER), snippet_distances(factor * ROWS, factor * OTHER)
    assert other.mean == pytest.approx(one.mean, rel=1e-9)


def test_the_same_snippets_in_another_order_are_no_distance_apart() -> None:
    assert snippet_distances(ROWS, ROWS[::-1]).mean == pytest.approx(0.0, abs=1e-12)


def test_a_metric_that_never_varies_counts_in_its_own_unit() -> None:
    still = np.zeros((5, 51))
    assert snippet_distances(still, still + 0.1).by_metric["mean"] == pytest.approx(0.1)


def test_the_worst_metric_is_named() -> None:
    distances = Distances(dict.fromkeys(METRICS, 0.1) | {"range": 0.4})
    assert distances.worst == "range"
    assert distances.mean == pytest.approx(0.13)


def test_repeated_splits_are_averaged_metric_by_metric() -> None:
    both = mean_distances([Distances(dict.fromkeys(METRICS, 0.1)), Distances(dict.fromkeys(METRICS, 0.3))])
    assert both.by_metric == pytest.approx(dict.fromkeys(METRICS, 0.2))


@pytest.mark.parametrize(("n", "m"), [(1, 5), (5, 0)])
def test_too_few_snippets_are_counted(n: int, m: int) -> None:
    with pytest.raises(NotEnoughDataError, match=f"{n} real and {m} other snippets"):
        metric_distances(np.zeros((n, 10)), np.zeros((m, 10)))


@pytest.mark.parametrize(("count", "half"), [(2, 1), (5, 2), (8, 4)])
def test_drivers_go_to_one_half_as_a_whole(count: int, half: int) -> None:
    groups = np.repeat([f"d{k}" for k in range(count)], 7)
    first = split_groups(groups, np.random.default_rng(2))
    for name in np.unique(groups):
        assert len(np.unique(first[groups == name])) == 1
    assert len(np.unique(groups[first])) == half


def test_every_driver_is_in_either_half_at_times() -> None:
    groups = np.repeat(np.arange(6), 3)
    shares = np.mean([split_groups(groups, np.random.default_rng(seed)) for seed in range(400)], axis=0)
    np.testing.assert_allclose(shares, 0.5, atol=4.0 * 0.5 / np.sqrt(400))


def test_one_driver_has_no_other_half() -> None:
    with pytest.raises(NotEnoughDataError, match="1 group of snippets; two are needed"):
        split_groups(np.zeros(9), np.random.default_rng(0))
