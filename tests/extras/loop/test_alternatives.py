"""When two explanations can't be told apart, and when they can."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.extras.loop.refinement import explains_as_much

N, MINUTE = 3000, 60


def drawn(alike: float, size: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The true column, one that goes along with it, and rows that the true one moves."""
    rng = np.random.default_rng(seed)
    true = rng.normal(size=(N, 1))
    other = alike * true + np.sqrt(1.0 - alike**2) * rng.normal(size=(N, 1))
    return true, other, size * true[:, 0] + rng.normal(size=N)


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_a_column_that_has_nothing_to_do_with_it_is_no_alternative(size: float) -> None:
    told = [explains_as_much(*drawn(0.0, size, seed), np.arange(N) // MINUTE) for seed in range(20)]
    assert sum(told) <= 1


def test_a_column_that_is_nearly_the_same_is_an_alternative() -> None:
    told = [explains_as_much(*drawn(0.98, 0.1, seed), np.arange(N) // MINUTE) for seed in range(20)]
    assert sum(told) >= 18


def test_the_right_one_is_hardly_ever_denied() -> None:
    """Where chance makes its likeness the better one, the likeness is by no more than 1.6 standard errors."""
    denied = 0
    for seed in range(100):
        true, other, rows = drawn(0.9, 0.15, seed)
        if np.abs(other[:, 0] @ rows) / np.linalg.norm(other) > np.abs(true[:, 0] @ rows) / np.linalg.norm(true):
            denied += not explains_as_much(other, true, rows, np.arange(N) // MINUTE)
    assert denied <= 2


def test_one_cluster_can_tell_nothing() -> None:
    assert explains_as_much(*drawn(0.0, 1.0, 1), np.zeros(N, dtype=np.intp))
