"""From maxima under the null to p-values, and how the budget of false alarms is shared."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import gumbel_r, kstest

from xosc_lateral.identification.significance import BUDGET, MANY_DRIVES, exponential_tail, upper_tail
from xosc_lateral.identification.stages import ERROR_BUDGET

level_of = ERROR_BUDGET.level_of


def test_all_levels_together_are_the_budget() -> None:
    assert sum(level_of(component, MANY_DRIVES) for component in ERROR_BUDGET.weights) == pytest.approx(BUDGET)
    assert level_of("mean", MANY_DRIVES) > level_of("restoring", MANY_DRIVES) > 0.0


def test_what_cannot_be_asked_between_a_few_drives_is_not_spent() -> None:
    assert level_of("between", MANY_DRIVES - 1) == 0.0
    spent = sum(level_of(component, 1) for component in ERROR_BUDGET.weights)
    assert spent == pytest.approx(BUDGET - level_of("between", MANY_DRIVES))


def test_without_a_null_nothing_is_sure() -> None:
    assert upper_tail(1e9, np.empty(0)) == 1.0


def test_common_scores_have_the_share_of_the_null_that_reaches_them() -> None:
    maxima = np.arange(100.0)
    assert upper_tail(50.0, maxima) == 0.5
    assert upper_tail(-1.0, maxima) == 1.0


def test_rare_scores_have_the_tail_of_the_law_that_maxima_follow() -> None:
    rng = np.random.default_rng(1)
    maxima = gumbel_r.rvs(20.0, 3.0, size=100_000, random_state=rng)
    for score in (32.0, 40.0):
        assert np.log(upper_tail(score, maxima)) == pytest.approx(np.log(gumbel_r.sf(score, 20.0, 3.0)), abs=0.3)


@pytest.mark.parametrize("score", [30.0, 45.0, 60.0])
def test_a_tail_heavier_than_that_of_maxima_is_given_its_weight(score: float) -> None:
    """Exponential scores, whose tail is exp(-score / 5): the law of maxima alone would call them a tenth as likely."""
    maxima = np.random.default_rng(6).exponential(5.0, 200_000)
    p_value = upper_tail(score, maxima)
    assert np.log(p_value) == pytest.approx(-score / 5.0, abs=0.35)
    place = maxima.mean() - np.euler_gamma * (scale := maxima.std() * np.sqrt(6.0) / np.pi)
    assert gumbel_r.sf(score, place, scale) < p_value


@given(st.floats(0.0, 200.0), st.floats(0.0, 200.0))
def test_a_larger_score_is_never_likelier(first: float, second: float) -> None:
    maxima = gumbel_r.rvs(20.0, 3.0, size=300, random_state=np.random.default_rng(2))
    low, high = sorted((first, second))
    assert 0.0 < upper_tail(high, maxima) <= upper_tail(low, maxima) <= 1.0


@pytest.mark.parametrize("seed", [3, 4])
def test_p_values_of_the_null_itself_are_not_too_small(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p_values = []
    for _ in range(400):
        drawn = gumbel_r.rvs(20.0, 3.0, size=301, random_state=rng)
        p_values.append(upper_tail(drawn[0], drawn[1:]))
    # one-sided: a p-value may be too large (the heavier of two tails counts), not too small
    assert kstest(p_values, "uniform", alternative="greater").pvalue > 0.001


def test_a_null_that_never_varies_is_no_reason_for_certainty() -> None:
    assert 0.0 < upper_tail(10.0, np.full(50, 10.0)) <= 1.0
    assert upper_tail(11.0, np.full(50, 10.0)) > 0.0


def test_what_enough_of_the_null_reach_has_their_share() -> None:
    null = np.arange(1000.0)
    assert exponential_tail(900.0, null) == 0.1
    assert exponential_tail(990.0, null) == 0.01
    assert exponential_tail(1.0, np.empty(0)) == 1.0


@pytest.mark.parametrize("wanted", [1e-2, 1e-3, 1e-4, 1e-6])
def test_the_tail_of_an_exponential_is_found_from_a_sample(wanted: float) -> None:
    """Where a law for maxima of chi-square would be wrong by orders of magnitude."""
    rng = np.random.default_rng(3)
    told = [exponential_tail(-np.log(wanted), rng.exponential(size=4000)) for _ in range(20)]
    assert np.exp(np.mean(np.log(told))) == pytest.approx(wanted, rel=0.5)


def test_a_score_beyond_every_draw_is_no_certainty_and_less_likely_than_one_that_some_reach() -> None:
    null = np.random.default_rng(4).exponential(size=400)
    far, near = exponential_tail(50.0, null), exponential_tail(float(np.sort(null)[-9]), null)
    assert 0.0 < far < near <= 10 / 400
    assert exponential_tail(2.0, np.ones(50)) < 10 / 50
