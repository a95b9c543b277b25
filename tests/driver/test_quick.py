"""What is quick of a path: all above 0.2 Hz, nothing below 0.1 Hz, without delay."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.quick import quick_between, quick_part, reach
from xosc_lateral.drives.resampling import STEP

TIME = STEP * np.arange(3000)


@pytest.mark.parametrize(("frequency", "share"), [(0.02, 0.0), (0.09, 0.0), (0.15, 0.5), (0.21, 1.0), (0.5, 1.0)])
def test_frequencies_are_parted(frequency: float, share: float):
    wave = np.sin(2.0 * np.pi * frequency * TIME)
    inside = slice(200, -200)
    np.testing.assert_allclose(quick_part(wave, STEP)[inside], share * wave[inside], atol=0.03)


def test_the_ends_are_not_quick_and_a_straight_line_is_nowhere():
    path = np.random.default_rng(0).normal(size=400).cumsum()
    quick = quick_part(path, STEP)
    assert quick[0] == pytest.approx(0.0, abs=1e-9) and quick[-1] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(quick_part(0.3 + 0.01 * TIME, STEP), 0.0, atol=1e-9)


def test_pieces_with_their_surroundings_are_the_whole_bit_by_bit():
    path, rows = np.random.default_rng(1).normal(size=600).cumsum(), reach(STEP)
    whole = quick_between(path, STEP)
    pieces = [quick_between(path[first : first + 7 + 2 * rows], STEP) for first in range(0, len(whole) - 6, 7)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole[: 7 * len(pieces)])


@pytest.mark.parametrize("n", [0, 1, 2, 5, 60])
def test_short_paths_are_no_trouble(n: int):
    assert quick_part(np.linspace(0.0, 1.0, n), STEP).shape == (n,)
    assert np.isfinite(quick_part(np.random.default_rng(2).normal(size=n), STEP)).all()
