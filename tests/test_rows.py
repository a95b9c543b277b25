"""Stretches of True."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.rows import true_slices


@pytest.mark.parametrize(
    ("mask", "expected"),
    [("", []), ("0", []), ("1", [(0, 1)]), ("0110", [(1, 3)]), ("1101", [(0, 2), (3, 4)])],
)
def test_stretches_are_the_longest_slices_of_true(mask, expected):
    values = np.array([one == "1" for one in mask], dtype=bool)
    assert [(part.start, part.stop) for part in true_slices(values)] == expected
