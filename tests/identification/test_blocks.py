"""What is held out together; columns that wrap around; whether drivers differ."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f_oneway

from xosc_lateral.identification.blocks import BLOCK_S, FOLDS, folds_of, held_out_words, hold_out_blocks
from xosc_lateral.identification.circular import circular_period
from xosc_lateral.identification.population import _scatter

STEP = 0.2
BLOCK = round(BLOCK_S / STEP)


class Drives(SimpleNamespace):
    """What blocks need to know of a timeline."""

    def __len__(self) -> int:
        return int(self.spans[-1].stop)


def drives(*lengths: int) -> Any:
    ends = np.cumsum([0, *lengths])
    return Drives(step=STEP, spans=[slice(a, b) for a, b in pairwise(ends.tolist())], names=["x"] * len(lengths))


# ---- blocks ----------------------------------------------------------------------------------------------------------
def test_a_long_drive_is_cut_into_equal_blocks_and_a_short_one_held_out_whole() -> None:
    blocks = hold_out_blocks(drives(4 * BLOCK, 2 * BLOCK))
    np.testing.assert_array_equal(np.bincount(blocks), [BLOCK, BLOCK, BLOCK, BLOCK, 2 * BLOCK])
    assert folds_of(blocks) == FOLDS


@given(st.lists(st.integers(1, 6 * BLOCK), min_size=1, max_size=8))
def test_blocks_are_numbered_in_order_and_never_cross_drives(lengths: list[int]) -> None:
    timeline = drives(*lengths)
    blocks = hold_out_blocks(timeline)
    assert blocks[0] == 0
    assert set(np.diff(blocks)) <= {0, 1}
    for span in timeline.spans[:-1]:
        assert blocks[span.stop] == blocks[span.stop - 1] + 1
    for span in timeline.spans:
        sizes = np.bincount(blocks[span])
        sizes = sizes[sizes > 0]
        assert sizes.max() - sizes.min() <= 1 or len(sizes) == 1
        assert len(sizes) == 1 or sizes.min() >= BLOCK


@pytest.mark.parametrize(
    ("lengths", "words"),
    [
        ((BLOCK,), "nothing: the table is too short"),
        ((BLOCK,) * 3, "3 drives in 3 folds"),
        ((8 * BLOCK,), f"8 blocks of about {BLOCK_S:g} s in 4 folds"),
    ],
)
def test_what_is_held_out_is_said(lengths: tuple[int, ...], words: str) -> None:
    timeline = drives(*lengths)
    assert words in held_out_words(timeline, hold_out_blocks(timeline))


# ---- columns that wrap around ----------------------------------------------------------------------------------------
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


# ---- whether drivers differ ------------------------------------------------------------------------------------------
def test_scatter_is_tested_as_in_an_analysis_of_variance() -> None:
    halves = np.random.default_rng(2).normal(size=(12, 2)) + np.random.default_rng(3).normal(size=(12, 1))
    _, p_value = _scatter(halves)
    assert p_value == pytest.approx(f_oneway(*halves).pvalue, rel=1e-9)


def test_scatter_between_drives_is_freed_of_noise() -> None:
    rng = np.random.default_rng(4)
    halves = 0.3 * rng.normal(size=(4000, 1)) + 0.5 * rng.normal(size=(4000, 2))
    deviation, p_value = _scatter(halves)
    assert deviation == pytest.approx(0.3, abs=0.02)
    assert p_value < 1e-6
    assert _scatter(0.5 * rng.normal(size=(10, 2)))[0] >= 0.0
