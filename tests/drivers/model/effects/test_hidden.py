"""What hidden effects share: finite numbers, no columns, a state that begins and goes on."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest

from tests.kit.profiles import whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import EffectTerms, HiddenEffect
from xosc_lateral.drivers.model.effects.hidden import NoState


class Ramp(HiddenEffect, frozen=True, kw_only=True):
    """A plain function of time, as a new effect would be written."""

    positive: ClassVar[tuple[str, ...]] = ("slope",)
    slope: float
    start: float = 0.0

    def advance(self, state: NoState, time: np.ndarray, step: float) -> EffectTerms:
        return EffectTerms(location=self.start + self.slope * time + 0.0 * step)


def test_a_function_of_time_needs_no_more_than_its_formula() -> None:
    effect = Ramp(slope=0.01, start=-0.1)
    np.testing.assert_allclose(
        np.asarray(whole_terms(effect, np.arange(4.0), {}, np.random.default_rng(0)).location),
        [-0.1, -0.09, -0.08, -0.07],
    )
    assert effect.columns == ()
    assert isinstance(effect.begin(np.random.default_rng(0), 0.2), NoState)


def test_whole_numbers_become_numbers_with_a_point() -> None:
    assert isinstance(Ramp(slope=1).slope, float)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"slope": 0.0}, "ramp: slope = 0.0"),
        ({"slope": -2.0}, "ramp: slope = -2.0"),
        ({"slope": np.nan}, "ramp: slope = nan"),
        ({"slope": 1.0, "start": -np.inf}, "ramp: start = -inf"),
    ],
)
def test_fields_are_finite_and_those_named_above_nothing(fields: dict, message: str) -> None:
    with pytest.raises(DriverProfileError, match=message):
        Ramp(**fields)


def test_what_need_not_be_positive_may_be_negative() -> None:
    assert Ramp(slope=1.0, start=-3.0).start == -3.0


def test_no_rows_have_no_terms() -> None:
    terms = whole_terms(Ramp(slope=1.0), np.zeros(0), {}, np.random.default_rng(0))
    assert (terms.location, terms.spread, terms.rate, terms.fine) == (None, None, None, None)
