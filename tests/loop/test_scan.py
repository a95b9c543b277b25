"""The scan against direct computation, and its null against theory."""

import numpy as np
import pytest
from scipy.stats import chi2, f

from xosc_lateral.loop.chance import tail_probability
from xosc_lateral.loop.scan import Calibration, Rows, as_one_degree, draw_shifts, scan, transform_answers


def white_rows(n: int, seed: int, effect: np.ndarray | None = None) -> Rows:
    rows = np.random.default_rng(seed).normal(size=n)
    rows = rows if effect is None else rows + effect
    rows -= rows.mean()
    taken = np.full((1, n), 1 / np.sqrt(n))
    return Rows(rows, np.ones(n), taken, np.ones(1), rows)


def column(n: int, seed: int) -> np.ndarray:
    return np.convolve(np.random.default_rng(seed).normal(size=n), np.ones(8), mode="same")[:, None]


def test_a_lag_is_found_and_the_chi_square_is_the_regression_s() -> None:
    n = 1200
    x = column(n, 1)
    moved = np.roll(x[:, 0], 3)
    rows = white_rows(n, 2, 0.1 * moved)
    found = scan(rows, [x], transform_answers([x]), np.zeros(1), draw_shifts(n, np.random.default_rng(0)))
    centred = moved - moved.mean()
    assert found.lag[0] == 3
    assert found.chi_square[0] == pytest.approx((rows.response @ centred) ** 2 / (centred @ centred), rel=1e-3)


def test_shifts_give_chance_of_one_degree_of_freedom() -> None:
    n = 4000
    answers = [column(n, seed) for seed in range(3, 23)]
    found = scan(
        white_rows(n, 40),
        answers,
        transform_answers(answers),
        np.zeros(20),
        draw_shifts(n, np.random.default_rng(1)),
        np.array([0]),
    )
    assert found.null.mean() == pytest.approx(1.0, abs=0.15)
    assert np.mean(found.null > chi2.isf(0.05, 1)) == pytest.approx(0.05, abs=0.015)


def test_degrees_are_traded_at_equal_tail_probability() -> None:
    values = np.array([0.5, 5.0, 20.0, 45.0])
    assert chi2.sf(as_one_degree(values, 3), 1) == pytest.approx(chi2.sf(values, 3), rel=1e-6)
    assert as_one_degree(np.array([2000.0]), 2) == pytest.approx([2000.0 + np.log(np.pi * 2000 / 2)], rel=0.01)


@pytest.mark.parametrize("freedom", [6.0, 20.0, 200.0])
def test_noise_known_from_few_frequencies_makes_a_score_less_sure(freedom: float) -> None:
    score = Calibration(2.0, freedom, 0.0).apply(2.0 * 9.0, 1)
    assert chi2.sf(score, 1) == pytest.approx(f.sf(9.0, 1, freedom), rel=0.1)


def test_tail_probabilities_agree_with_theory_inside_and_beyond_the_sample() -> None:
    rng = np.random.default_rng(5)
    null = chi2.rvs(1, size=(400, 50), random_state=rng).max(axis=1)
    for observed in (8.0, 12.0, 16.0, 25.0):
        exact = 1.0 - chi2.cdf(observed, 1) ** 50
        assert np.log(tail_probability(observed, null)) == pytest.approx(np.log(exact), abs=0.35 + 0.06 * observed)
