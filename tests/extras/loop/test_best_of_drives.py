"""The best candidate or pair between drives: planted ones are found, and chance as often as it says."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.extras.loop.significance import as_one_degree
from xosc_lateral.extras.loop.terms.between import best_of_drives

DRIVES = 300


def made(
    rng: np.random.Generator, sizes: dict[int, float], alike: float = 0.0, candidates: int = 12
) -> tuple[tuple[int, ...], float]:
    """Search among candidates, the first two of which go along with each other; `sizes`: of what they do."""
    values = rng.normal(size=(DRIVES, candidates))
    values[:, 1] = alike * values[:, 0] + np.sqrt(1.0 - alike**2) * values[:, 1]
    quantities = values - values.mean(axis=0)
    quantities /= np.linalg.norm(quantities, axis=0)
    left = rng.normal(size=DRIVES) + sum(size * quantities[:, index] for index, size in sizes.items())
    left -= left.mean()
    costs = np.full(candidates, 2.0 * np.log(candidates))
    names = [f"column_{index}" for index in range(candidates)]
    return best_of_drives(left / left.std(), np.ones(DRIVES, dtype=bool), quantities, costs, names, rng)


def test_a_strong_column_is_found_alone() -> None:
    for seed in range(5):
        found = made(np.random.default_rng(seed), {3: 8.0})
        assert found[0] == (3,)
        assert found[1] < 1e-4


def test_two_columns_that_hide_each_other_are_found_as_a_pair() -> None:
    # alone each shows 10 - 0.8 * 10 = 2 standard errors; together a chi-square of 100 + 100 - 2 * 0.8 * 100 = 40
    for seed in range(5):
        found = made(np.random.default_rng(seed), {0: 10.0, 1: -10.0}, alike=0.8)
        assert sorted(found[0]) == [0, 1]
        assert found[1] < 1e-3


def test_shapes_of_one_column_make_no_pair() -> None:
    rng = np.random.default_rng(1)
    values = np.linalg.qr(rng.normal(size=(DRIVES, 2)))[0]
    left = 8.0 * values.sum(axis=1) + rng.normal(size=DRIVES)
    found = best_of_drives(left, np.ones(DRIVES, dtype=bool), values, np.zeros(2), ["speed", "speed"], rng)
    assert len(found[0]) == 1


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
    assert best_of_drives(left, counted, values, np.zeros(1), ["speed"], rng)[1] < 1e-3


@pytest.mark.parametrize("chi_square", [0.5, 4.0, 30.0, 200.0])
def test_two_degrees_as_one_have_the_same_tail(chi_square: float) -> None:
    from scipy.stats import norm

    one = float(as_one_degree(np.array(chi_square), 2))
    assert 2.0 * norm.sf(np.sqrt(one)) == pytest.approx(np.exp(-chi_square / 2.0), rel=1e-6)
