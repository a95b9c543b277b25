"""Effects rounded to what is known of them."""

from __future__ import annotations

import numpy as np

from laboratory.refined import rounded_profile
from laboratory.rounding import rounded_effect
from xosc_lateral.drivers.model.effects import Acts, Levels, Product, Saturating
from xosc_lateral.drivers.model.effects.shapes import Factor
from xosc_lateral.files.profiles import read_profile


def test_numbers_keep_six_digits_wherever_they_stand() -> None:
    given = Saturating(
        acts=Acts.LOCATION,
        column="right_distance",
        coefficients=(-0.08779400313518358,),
        errors=(0.0069512246277193745,),
        reference=(0.015662796825362743,),
        middle=21.551526018045312,
        scale=16.418519342786695,
    )
    found = rounded_effect(given)
    assert (found.coefficients, found.errors, found.reference) == ((-0.087794,), (0.00695122,), (0.0156628,))
    assert (found.middle, found.scale, found.column) == (21.5515, 16.4185, "right_distance")
    levels = rounded_effect(Levels(acts=Acts.LOCATION, column="lane_index", levels=(1.0 / 3.0,)))
    assert levels.levels == (0.333333,)
    product = Product(acts=Acts.LOCATION, factors=(Factor(column="speed", at=31.23456789), Factor(column="rain")))
    assert rounded_effect(product).factors[0].at == 31.2346


def test_the_refined_profile_is_shipped_rounded() -> None:
    """`make profiles` rounds it on its way to the file: rounding again changes nothing."""
    shipped = read_profile("motorway-refined")
    again = rounded_profile(shipped)
    assert again.lane_width == shipped.lane_width
    for one, other in zip(shipped.effects, again.effects, strict=True):
        np.testing.assert_equal(one.coefficients, other.coefficients)  # type: ignore[attr-defined]
        np.testing.assert_equal(one.response_range, other.response_range)  # type: ignore[attr-defined]
