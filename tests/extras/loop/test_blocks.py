"""What is held out together."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.extras.loop.identify import BLOCK_S, FOLDS, folds_of, held_out_words, hold_out_blocks

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
    assert words in held_out_words(timeline)
