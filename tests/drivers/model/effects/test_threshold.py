"""Beyond a limit only."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.effects import made, quantity
from xosc_lateral.drivers.model.effects import Threshold

X = np.linspace(-10.0, 10.0, 41)


def beyond(values: object, **fields: object) -> np.ndarray:
    return quantity(made(Threshold, column="x", **fields), x=values)[:, 0]


@pytest.mark.parametrize("jump", [True, False])
def test_above_and_below_are_mirror_images(jump: bool) -> None:
    np.testing.assert_array_equal(beyond(X, at=2.0, above=True, jump=jump), beyond(-X, at=-2.0, above=False, jump=jump))


def test_a_hinge_is_the_integral_of_the_step() -> None:
    fine = np.linspace(-5.0, 5.0, 10_001)
    step, hinge = beyond(fine, at=1.0, jump=True), beyond(fine, at=1.0, jump=False)
    np.testing.assert_allclose(np.cumsum(step) * (fine[1] - fine[0]), hinge, atol=2e-3)


def test_one_of_both_sides_acts_and_the_limit_itself_does_not() -> None:
    both = beyond(X, at=0.0, above=True) + beyond(X, at=0.0, above=False)
    np.testing.assert_array_equal(both, X != 0.0)


def test_where_there_is_none_is_the_quiet_side() -> None:
    for above in (True, False):
        assert beyond([np.nan], at=0.0, above=above)[0] == 0.0


@pytest.mark.parametrize(
    ("above", "jump", "words"),
    [
        (True, True, "threshold (step above 2.5)"),
        (False, True, "threshold (step below 2.5)"),
        (True, False, "threshold (hinge above 2.5)"),
    ],
)
def test_the_shape_is_said(above: bool, jump: bool, words: str) -> None:
    assert made(Threshold, column="x", at=2.5, above=above, jump=jump).shape == words
