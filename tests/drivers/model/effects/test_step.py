"""One jump of the mean."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.profiles import whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Step

RNG = np.random.default_rng(0)


def at(effect: Step, time: object) -> np.ndarray:
    return np.asarray(whole_terms(effect, np.asarray(time, dtype=float), {}, RNG).location)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_mean_weighed_by_both_shares_is_nothing(share: float) -> None:
    before, after = at(Step(size=0.15, at_s=10.0, share_before=share), [0.0, 20.0])
    assert share * before + (1.0 - share) * after == pytest.approx(0.0, abs=1e-15)
    assert after - before == pytest.approx(0.15)


def test_the_row_at_the_moment_itself_is_after() -> None:
    assert at(Step(size=0.1, at_s=3.0, share_before=0.0), [2.999, 3.0]).tolist() == pytest.approx([-0.1, 0.0])


def test_to_the_right_is_the_mirror_image() -> None:
    time = np.arange(20.0)
    np.testing.assert_array_equal(at(Step(size=-0.12, at_s=7.0), time), -at(Step(size=0.12, at_s=7.0), time))


def test_it_may_lie_outside_the_drive() -> None:
    assert np.ptp(at(Step(size=0.1, at_s=1e6), np.arange(50.0))) == 0.0


def test_numbers_are_finite() -> None:
    with pytest.raises(DriverProfileError, match="step: at_s = inf"):
        Step(size=0.1, at_s=np.inf)
