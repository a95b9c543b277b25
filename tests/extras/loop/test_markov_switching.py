"""The two-state hidden Markov model against all paths written out, and against what it was sampled from."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.stats import norm

from xosc_lateral.extras.loop.terms.hidden import fit_regimes, forward_backward


def all_paths(rows: np.ndarray, valid: np.ndarray, quiet: float, loud: float, go: float, leave: float):
    """Probability of the loud state per row, expected switches on and off, log-likelihood: over all 2^n paths."""
    move = np.array([[1.0 - go, go], [leave, 1.0 - leave]])
    first = np.array([leave, go]) / (go + leave)
    sizes = np.array([quiet, loud])
    total, on, went, left = 0.0, np.zeros(len(rows)), 0.0, 0.0
    for path in product((0, 1), repeat=len(rows)):
        states = np.array(path)
        weight = first[states[0]] * np.prod(move[states[:-1], states[1:]])
        # densities up to the common factor of the normal's, as in the module
        weight *= np.prod(np.where(valid, norm.pdf(rows, scale=sizes[states]) * np.sqrt(2.0 * np.pi), 1.0))
        total += weight
        on += weight * states
        went += weight * np.sum((states[:-1] == 0) & (states[1:] == 1))
        left += weight * np.sum((states[:-1] == 1) & (states[1:] == 0))
    return on / total, went / total, left / total, np.log(total)


@pytest.mark.parametrize("seed", range(4))
def test_probabilities_are_those_of_all_paths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, valid = rng.normal(size=9) * rng.choice([0.5, 2.0], 9), rng.random(9) > 0.2
    quiet, loud, go, leave = 0.6, 1.9, 0.2, 0.35
    expected = all_paths(rows, valid, quiet, loud, go, leave)
    on, went, left, likelihood = forward_backward(rows**2, valid, quiet, loud, go, leave)
    np.testing.assert_allclose(on, expected[0], rtol=1e-9)
    assert (went, left, likelihood) == pytest.approx(expected[1:], rel=1e-9)


def test_rows_that_are_cut_out_say_nothing() -> None:
    rows, valid = np.array([0.1, 50.0, 0.1]), np.array([True, False, True])
    wild = forward_backward(rows**2, valid, 0.5, 2.0, 0.1, 0.1)
    tame = forward_backward(np.array([0.1, 0.0, 0.1]) ** 2, valid, 0.5, 2.0, 0.1, 0.1)
    np.testing.assert_array_equal(wild[0], tame[0])
    assert wild[3] == tame[3]


def regimes(n: int, factor: float, on_s: float, off_s: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    state, states = 0, np.zeros(n, dtype=int)
    for t in range(n):
        if rng.random() < (1.0 / on_s if state else 1.0 / off_s):
            state = 1 - state
        states[t] = state
    return rng.normal(size=n) * np.where(states == 1, factor, 1.0), states == 1


@pytest.mark.parametrize("seed", [11, 12])
def test_what_was_put_in_comes_back(seed: int) -> None:
    rows, truth = regimes(6000, 2.5, 30.0, 90.0, seed)
    fit = fit_regimes(rows, np.ones(6000, dtype=bool))
    assert fit.factor == pytest.approx(2.5, rel=0.1)
    assert fit.quiet == pytest.approx(1.0, rel=0.06)
    assert fit.on_s == pytest.approx(30.0, rel=0.4)
    assert fit.off_s == pytest.approx(90.0, rel=0.4)
    assert np.mean((fit.on > 0.5) == truth) > 0.93


def test_the_unit_of_the_rows_does_not_matter() -> None:
    rows, _ = regimes(3000, 2.5, 30.0, 90.0, 13)
    valid = np.ones(3000, dtype=bool)
    one, hundred = fit_regimes(rows, valid), fit_regimes(100.0 * rows, valid)
    assert hundred.factor == pytest.approx(one.factor, rel=1e-6)
    assert hundred.quiet == pytest.approx(100.0 * one.quiet, rel=1e-6)
    np.testing.assert_allclose(hundred.on, one.on, atol=1e-6)
