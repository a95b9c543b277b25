"""The curve between samples: its six conditions, polynomials that it follows, and its ends."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from tests.kit.upsampled import upsample
from xosc_lateral.drivers.model.linear_filters import extrapolate, piece

SAMPLES = np.random.default_rng(1).normal(size=12)


def curve(row: int) -> Polynomial:
    return Polynomial(piece(*SAMPLES[row - 1 : row + 3]))


@pytest.mark.parametrize("order", [0, 1, 2])
def test_pieces_meet_in_value_slope_and_bend(order: int) -> None:
    for row in range(1, 8):
        here, there = curve(row), curve(row + 1)
        if order:
            here, there = here.deriv(order), there.deriv(order)
        assert here(1.0) == pytest.approx(there(0.0), abs=1e-12)


def test_at_a_sample_slope_and_bend_are_the_central_differences() -> None:
    one = curve(3)
    assert one(0.0) == SAMPLES[3]
    assert one.deriv()(0.0) == pytest.approx(0.5 * (SAMPLES[4] - SAMPLES[2]))
    assert one.deriv(2)(0.0) == pytest.approx(SAMPLES[4] - 2.0 * SAMPLES[3] + SAMPLES[2])


@pytest.mark.parametrize("power", [0, 1, 2])
def test_it_follows_polynomials_up_to_a_parabola(power: int) -> None:
    before, here, there, behind = (np.array([-1.0, 0.0, 1.0, 2.0]) ** power).tolist()
    u = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(Polynomial(piece(before, here, there, behind))(u), u**power, atol=1e-14)


@pytest.mark.parametrize("factor", [2, 5, 20])
def test_samples_are_met_bit_by_bit_and_the_rest_lies_on_the_curve(factor: int) -> None:
    dense = upsample(SAMPLES, factor)
    assert len(dense) == 11 * factor + 1
    np.testing.assert_array_equal(dense[::factor], SAMPLES)
    share = np.arange(factor) / factor
    np.testing.assert_allclose(dense[3 * factor : 4 * factor], curve(3)(share), atol=1e-14)


def test_backwards_it_is_the_same_curve() -> None:
    np.testing.assert_allclose(upsample(SAMPLES[::-1], 4), upsample(SAMPLES, 4)[::-1], atol=1e-12)


def test_size_and_place_go_through() -> None:
    np.testing.assert_allclose(upsample(0.3 - 2.0 * SAMPLES, 3), 0.3 - 2.0 * upsample(SAMPLES, 3), atol=1e-12)


def test_past_its_ends_it_goes_on_straight() -> None:
    assert extrapolate(1.0, 3.0) == 5.0
    np.testing.assert_allclose(upsample(np.array([0.0, 1.0]), 4), [0.0, 0.25, 0.5, 0.75, 1.0])


@pytest.mark.parametrize("samples", [[], [0.3]])
def test_too_few_samples_stay_as_they_are(samples: list[float]) -> None:
    np.testing.assert_array_equal(upsample(np.array(samples), 5), samples)


def test_once_as_dense_is_a_copy() -> None:
    dense = upsample(SAMPLES, 1)
    np.testing.assert_array_equal(dense, SAMPLES)
    assert dense is not SAMPLES


def test_less_dense_is_no_upsampling() -> None:
    with pytest.raises(ValueError, match="0 steps per model step, at least 1"):
        upsample(SAMPLES, 0)
