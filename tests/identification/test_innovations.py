"""Innovations of the movement as the table shows it: independent and of one size."""

from __future__ import annotations

import numpy as np
import pytest

from tests.identification.made_coarse import wander
from xosc_lateral.identification.innovations import innovations

N = 3000
VALID, DRIVE, SCALE = np.ones(N, dtype=bool), np.zeros(N, dtype=np.intp), np.ones(N)


def movement(seed: int) -> np.ndarray:
    """0.1 m with a memory of 5 s, at 1 Hz."""
    return 0.1 * wander(np.random.default_rng(seed), 5 * N, 5.0)[::5]


def test_innovations_are_independent_and_alike() -> None:
    rows = innovations(movement(10), VALID, DRIVE, SCALE)
    assert rows.std() == pytest.approx(1.0, abs=0.02)
    assert abs(np.corrcoef(rows[1:], rows[:-1])[0, 1]) < 0.05


def test_a_factor_on_the_movement_is_taken_out() -> None:
    factor = np.where(np.arange(N) < N // 2, 1.0, 3.0)
    rows = innovations(movement(11), VALID, DRIVE, factor)
    assert rows[: N // 2].std() == pytest.approx(rows[N // 2 :].std(), rel=0.1)
