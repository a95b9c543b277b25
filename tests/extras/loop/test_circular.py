"""Directions are told from all other columns by how they jump."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.extras.loop.gridding import circular_period


def turning(n: int = 4000, seed: int = 0) -> np.ndarray:
    """A direction that goes round several times, in turns."""
    return np.cumsum(0.003 + 0.01 * np.random.default_rng(seed).normal(size=n))


@pytest.mark.parametrize(("circle", "expected"), [(360.0, 360.0), (2.0 * np.pi, 2.0 * np.pi), (100.0, 100.0)])
def test_a_direction_shows_its_full_circle(circle: float, expected: float) -> None:
    column = circle * (turning() % 1.0)
    assert circular_period([column]) == pytest.approx(expected, rel=0.01)
    assert circular_period([column[:2000], column[2000:]]) == pytest.approx(expected, rel=0.01)
    centred = circle * ((turning() + 0.5) % 1.0 - 0.5)
    assert circular_period([centred]) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    "column",
    [
        360.0 * turning(),  # unwrapped
        360.0 * np.random.default_rng(1).random(4000),  # noise jumps by every part of its range
        np.where(np.arange(4000) % 200 < 100, 0.0, 360.0),  # a switch
        np.full(4000, 5.0),
        np.append(360.0 * (turning() % 1.0), np.nan),  # directions are always there
        360.0 * (turning()[:90] % 1.0),  # too short
    ],
    ids=["unwrapped", "noise", "switch", "constant", "gap", "short"],
)
def test_what_does_not_wrap_has_no_circle(column: np.ndarray) -> None:
    assert circular_period([column]) == 0.0
