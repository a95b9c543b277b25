"""From maxima under the null to p-values, and how the budget of false alarms is shared."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import gumbel_r, kstest

from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.significance import (
    BUDGET,
    HEAVY_TAIL_SHARE,
    effective_number,
    upper_tail,
)


def test_all_levels_together_are_the_budget() -> None:
    assert sum(ERROR_BUDGET.values()) == pytest.approx(BUDGET)
    assert ERROR_BUDGET["mean"] > ERROR_BUDGET["cycle"] > 0.0


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


def quadratic(score: float, null: np.ndarray) -> float:
    """As scores that are no maxima are judged."""
    return upper_tail(score, null, tail_share=HEAVY_TAIL_SHARE, least_excess=0.0)


def test_what_enough_of_the_null_reach_has_their_share() -> None:
    null = np.random.default_rng(8).permutation(np.arange(1000.0))
    assert quadratic(900.0, null) == 0.1
    assert quadratic(980.0, null) == 0.02
    assert quadratic(1.0, np.empty(0)) == 1.0


@pytest.mark.parametrize("wanted", [1e-2, 1e-3, 1e-4])
def test_the_tail_of_an_exponential_is_found_from_a_sample(wanted: float) -> None:
    """Where a law for maxima of chi-square would be wrong by orders of magnitude."""
    rng = np.random.default_rng(3)
    told = [quadratic(-np.log(wanted), rng.exponential(size=4000)) for _ in range(20)]
    assert np.exp(np.mean(np.log(told))) == pytest.approx(wanted, rel=0.5)


def test_a_score_beyond_every_draw_is_no_certainty_and_less_likely_than_one_that_some_reach() -> None:
    null = np.random.default_rng(4).exponential(size=400)
    far, near = quadratic(50.0, null), quadratic(float(np.sort(null)[-9]), null)
    assert 0.0 < far < near <= 10 / effective_number(null) < 12 / 400
    assert quadratic(2.0, np.ones(50)) < 10 / 50


# ---- what few draws, or draws that are alike, can tell ---------------------------------------------------------------
def test_draws_that_resemble_their_neighbours_count_for_fewer() -> None:
    """A first-order autoregression of 0.8: nine of its draws tell as much of a mean as one that is independent."""
    rng = np.random.default_rng(9)
    alone = np.median([effective_number(rng.normal(size=400)) for _ in range(40)])
    alike = np.median([effective_number(lfilter([1.0], [1.0, -0.8], rng.normal(size=400))) for _ in range(40)])
    assert 250.0 < alone <= 400.0
    assert alike == pytest.approx(400.0 / 9.0, rel=0.35)
    assert effective_number(np.ones(50)) == 50.0


@pytest.mark.parametrize("neighbours", [1, 4])
def test_p_values_far_out_are_not_too_small_although_the_tails_scale_comes_from_few_draws(neighbours: int) -> None:
    """An exponential of the mean excess gives three times as many p-values below 1e-3 as there should be."""
    rng = np.random.default_rng(10 + neighbours)
    tables = 20_000
    drawn = rng.exponential(2.0, size=(tables, 100)).repeat(neighbours, axis=1)
    scores = rng.exponential(2.0, size=tables)
    rare = scores > 8.0
    p_values = [upper_tail(score, null) for score, null in zip(scores[rare], drawn[rare], strict=True)]
    for level in (1e-3, 3e-3):
        expected = level * tables
        assert np.sum(np.array(p_values) < level) < expected + 3.0 * np.sqrt(expected)
