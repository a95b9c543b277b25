"""Parameters of the autoregressive model, and what follows from them, against numpy and scipy."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.linalg import toeplitz

from tests.kit.core_models import POPULATION, STEADY
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import COARSE_EVERY, START_LAGS, interpolate
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE
from xosc_lateral.drivers.model.records import plain, read_as

WRONG: dict[str, dict[str, Any]] = {
    "mean beyond": {"mean": 0.5},
    "mean on a limit": {"mean": -0.45},
    "limits off the lane": {"limits": (-1.2, 0.4)},
    "limits upside down": {"limits": (0.4, -0.45)},
    "drivers apart by less than nothing": {"between_drivers": -0.1},
    "drivers a lane apart": {"between_drivers": 1.0},
    "correlated by more than one": {"correlation": 1.2},
}


@pytest.mark.parametrize("case", WRONG)
def test_numbers_out_of_their_range_are_refused(case: str) -> None:
    with pytest.raises(DriverProfileError, match=r"mean|between drivers"):
        replace(POPULATION, **WRONG[case])


def test_a_stationary_past_has_the_covariance_of_the_process() -> None:
    factor = POPULATION.start_factor
    np.testing.assert_allclose(factor @ factor.T, toeplitz(POPULATION.coarse.covariance(2)), rtol=1e-8)
    np.testing.assert_array_equal(np.triu(factor, 1), 0.0)


def test_fine_covariance_is_numpys_correlation_of_the_kernel() -> None:
    kernel = POPULATION.kernel
    expected = np.correlate(kernel, kernel, "full")[len(kernel) - 1 :] * NOISE_VARIANCE
    np.testing.assert_allclose(POPULATION.fine_covariance[: len(kernel)], expected, atol=1e-18)
    assert POPULATION.fine_covariance.shape == (START_LAGS,)
    assert (POPULATION.fine_covariance[len(kernel) :] == 0.0).all()


def test_coarse_covariance_is_that_of_the_interpolated_process_over_all_phases() -> None:
    """E[x(t) x(t + lag)] over the phases of a coarse step, by passing unit impulses through the interpolation."""
    ticks = 30
    impulses = interpolate(np.eye(ticks)).T  # row j: what a coarse value of 1 at step j makes
    process = toeplitz(STEADY.coarse.covariance(ticks))
    full = impulses.T @ process @ impulses
    inside = np.arange(full.shape[0])
    for lag in (0, 1, 4, 5, 12):
        rows = inside[20 : 20 + 10 * COARSE_EVERY]
        expected = full[rows, rows + lag].mean()
        # each phase's weights are scaled to sum to 1: the kernel's differ from that by 1e-4
        assert STEADY.coarse_covariance[lag] == pytest.approx(expected, rel=1e-3)


def test_the_driver_s_size_scales_covariances_by_its_square() -> None:
    larger = replace(STEADY, coarse=replace(STEADY.coarse, scale=2.0 * STEADY.coarse.scale))
    np.testing.assert_allclose(larger.coarse_covariance, 4.0 * STEADY.coarse_covariance, rtol=1e-12)


def test_a_start_is_forgotten_within_the_memory() -> None:
    covariance = STEADY.coarse_covariance
    assert abs(covariance[-1]) < 1e-6 * covariance[0]
    assert np.abs(covariance).argmax() == 0


def test_a_model_comes_back_from_its_file_with_every_number() -> None:
    again = read_as(AutoregressiveModel, json.loads(json.dumps(plain(POPULATION))))
    assert plain(again) == plain(POPULATION)
    first, second = (model.stream(np.random.SeedSequence(1)).take(50) for model in (POPULATION, again))
    np.testing.assert_array_equal(first, second)


def test_a_field_that_is_not_known_is_refused_by_its_name() -> None:
    with pytest.raises(DriverProfileError, match="unknown field 'liveliness'"):
        read_as(AutoregressiveModel, plain(POPULATION) | {"liveliness": 1.0})
