"""A smooth of time: where it was fitted it is what it was, beyond it holds."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.profiles import effect_from_dict, whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import TimeSmooth

RNG = np.random.default_rng(0)


def test_the_first_half_cosine_goes_from_plus_to_minus_and_holds_beyond() -> None:
    effect = TimeSmooth(location=(0.2,), location_errors=(0.01,), from_s=100.0, to_s=300.0)
    location = whole_terms(effect, np.array([0.0, 100.0, 200.0, 300.0, 400.0]), {}, RNG).location
    np.testing.assert_allclose(location, [0.2, 0.2, 0.0, -0.2, -0.2], atol=1e-12)


def test_spread_and_fine_are_factors_and_the_mean_stays() -> None:
    effect = TimeSmooth(spread=(0.0, np.log(2.0)), fine=(np.log(3.0),), from_s=0.0, to_s=100.0)
    terms = whole_terms(effect, np.array([0.0, 50.0, 100.0]), {}, RNG)
    np.testing.assert_allclose(terms.spread, [2.0, 0.5, 2.0])
    np.testing.assert_allclose(terms.fine, [3.0, 1.0, 1.0 / 3.0])
    assert terms.location is None


def test_it_is_read_as_it_was_written() -> None:
    effect = TimeSmooth(location=(0.2, 0.1), spread=(0.3,), to_s=50.0)
    assert effect_from_dict(effect.to_dict()) == effect
    assert effect.to_dict()["kind"] == "time-smooth"


@pytest.mark.parametrize("wrong", [{"location": (np.nan,)}, {"from_s": 10.0, "to_s": 10.0}])
def test_what_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(DriverProfileError, match="time-smooth"):
        TimeSmooth(**wrong)  # type: ignore[arg-type]
