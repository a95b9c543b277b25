"""Where variance lies: between drivers, within them, inside windows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f_oneway

from xosc_lateral.drivers.evaluation.realism import variance_parts


def windows(
    rng: np.random.Generator, counts: list[int], between: float, within: float, inside: float
) -> tuple[np.ndarray, np.ndarray]:
    drivers = np.repeat(np.arange(len(counts)), counts)
    means = between * rng.normal(size=len(counts))[drivers] + within * rng.normal(size=len(drivers))
    return means[:, None] + inside * rng.normal(size=(len(drivers), 400)), drivers


def test_parts_that_were_planted_come_back_with_unequal_counts() -> None:
    rng = np.random.default_rng(1)
    found = [variance_parts(*windows(rng, [1, 2, 5, 20] * 15, 0.2, 0.1, 0.05)) for _ in range(20)]
    assert np.mean([one.between for one in found]) == pytest.approx(0.04, rel=0.15)
    assert np.mean([one.within for one in found]) == pytest.approx(0.01 + 0.05**2 / 400, rel=0.1)
    assert np.mean([one.inside for one in found]) == pytest.approx(0.0025, rel=0.02)


@given(st.lists(st.integers(2, 6), min_size=2, max_size=6), st.integers(0, 1000))
def test_both_mean_squares_are_those_of_an_analysis_of_variance(counts: list[int], seed: int) -> None:
    rows, drivers = windows(np.random.default_rng(seed), counts, 0.3, 0.1, 0.02)
    parts, means = variance_parts(rows, drivers), rows.mean(axis=1)
    n, sizes = len(means), np.array(counts)
    effective = (n - (sizes**2).sum() / n) / (len(counts) - 1)
    ratio = 1.0 + effective * parts.between / parts.within
    statistic = f_oneway(*(means[drivers == k] for k in range(len(counts)))).statistic
    assert ratio == pytest.approx(max(statistic, 1.0), rel=1e-9)


def test_who_is_alike_differs_by_nothing_and_never_by_less() -> None:
    rng = np.random.default_rng(3)
    every = [variance_parts(*windows(rng, [5] * 4, 0.0, 0.1, 0.05)).between for _ in range(40)]
    assert min(every) == 0.0
    assert np.mean(every) < 0.003


@pytest.mark.parametrize("drivers", [[0, 0, 0], [0, 1, 2]], ids=["one driver", "a window each"])
def test_what_cannot_be_told_apart_is_all_between(drivers: list[int]) -> None:
    rows = np.array([[0.0, 0.2], [1.0, 1.2], [2.0, 2.2]])
    parts = variance_parts(rows, np.array(drivers))
    assert parts.between == pytest.approx(np.var([0.1, 1.1, 2.1]))
    assert parts.within == 0.0
    assert parts.inside == pytest.approx(0.01)
