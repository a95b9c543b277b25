"""Coarse and fine part of the autoregressive model, rebuilt from their definitions with scipy."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.signal import lfilter

from tests.kit.core_models import POPULATION, STEADY
from xosc_lateral.drivers.model.core.autoregressive.model import (
    COARSE,
    FINE,
    AutoregressiveModel,
    CoarsePart,
    CoarseState,
    Factors,
    FinePart,
    FineState,
    begin_factors,
)
from xosc_lateral.drivers.model.core.autoregressive.parameters import COARSE_EVERY, TICKS, DriverState, interpolate

N = 203
SEED = np.random.SeedSequence(3)


def drivers(*factors: float) -> DriverState:
    return DriverState(np.zeros(len(factors)), np.array(factors), np.array(factors))


def coarse_part(model: AutoregressiveModel, driver: DriverState, skip: tuple[int, ...]) -> CoarsePart:
    past = np.full((model.coarse.order, len(skip)), 0.01)
    state = CoarseState.begin(np.random.default_rng(5), past, np.array(skip))
    return CoarsePart(model, driver, state, Factors(model, begin_factors(model, SEED, len(skip))))


def fine_part(model: AutoregressiveModel, driver: DriverState, skip: tuple[int, ...]) -> FinePart:
    state = FineState.begin(np.random.default_rng(6), np.array(skip))
    return FinePart(model, driver, state, Factors(model, begin_factors(model, SEED, len(skip))))


def factors_of(model: AutoregressiveModel, part: int, n: int) -> np.ndarray:
    return Factors(model, begin_factors(model, SEED, 1)).take(part, n)[:, 0]


@pytest.mark.parametrize("model", [STEADY, POPULATION], ids=["steady", "volatile"])
def test_coarse_movement_is_the_interpolated_filter_of_volatile_noise(model: AutoregressiveModel) -> None:
    steps = 2 * TICKS + 1 + N
    noise = model.coarse.scale * np.random.default_rng(5).standard_normal(steps) * factors_of(model, COARSE, steps)
    a = model.coarse.coefficients
    before = np.array([a[0] * 0.01 + a[1] * 0.01, a[1] * 0.01])  # both past values are 0.01
    series, _ = lfilter([1.0], [1.0, *-a], noise, zi=before)
    expected = 1.3 * interpolate(np.asarray(series)[:, None])[:N, 0]
    found = coarse_part(model, drivers(1.3), (0,)).take(N)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("model", [STEADY, POPULATION], ids=["steady", "volatile"])
def test_fine_movement_is_uniform_noise_times_its_factor_convolved_with_the_kernel(model: AutoregressiveModel) -> None:
    taps = len(model.kernel)
    blocks = -(-(N + COARSE_EVERY + taps) // COARSE_EVERY)
    knots = factors_of(model, FINE, blocks + 1)
    between = np.interp(np.arange(blocks * COARSE_EVERY) / COARSE_EVERY, np.arange(blocks + 1), knots)
    noise = (np.random.default_rng(6).random(blocks * COARSE_EVERY) - 0.5) * between
    expected = 0.7 * np.convolve(noise, model.kernel, "valid")[:N]
    found = fine_part(model, drivers(0.7), (0,)).take(N)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("made", [coarse_part, fine_part], ids=["coarse", "fine"])
@pytest.mark.parametrize("sizes", [(1,) * 40, (0, 3, 5, 32), (40,), (39, 1)], ids=str)
def test_pieces_are_the_whole(made, sizes: tuple[int, ...]) -> None:  # type: ignore[no-untyped-def]
    whole = made(POPULATION, drivers(1.0, 0.5), (2, 0)).take(40)
    part = made(POPULATION, drivers(1.0, 0.5), (2, 0))
    np.testing.assert_array_equal(np.concatenate([part.take(n) for n in sizes]), whole)


@pytest.mark.parametrize("made", [coarse_part, fine_part], ids=["coarse", "fine"])
def test_drivers_who_skip_rows_begin_later_in_the_same_movement(made) -> None:  # type: ignore[no-untyped-def]
    plain = made(STEADY, drivers(1.0, 1.0, 1.0), (0, 0, 0)).take(60)
    late = made(STEADY, drivers(1.0, 1.0, 1.0), (0, 3, 7)).take(50)
    for driver, skip in enumerate((0, 3, 7)):
        np.testing.assert_array_equal(late[:, driver], plain[skip : skip + 50, driver])


@pytest.mark.parametrize("made", [coarse_part, fine_part], ids=["coarse", "fine"])
def test_looking_at_the_next_value_does_not_take_it(made) -> None:  # type: ignore[no-untyped-def]
    part = made(POPULATION, drivers(1.0, 1.2), (4, 1))
    first = part.first()
    np.testing.assert_array_equal(part.first(), first)
    np.testing.assert_array_equal(part.take(3)[0], first)


@pytest.mark.parametrize("sizes", [(1, 1, 8), (2, 8), (10,)], ids=str)
def test_a_bridge_is_added_step_by_step_and_used_up(sizes: tuple[int, ...]) -> None:
    bare = coarse_part(STEADY, drivers(1.0), (0,)).take(10)
    part = coarse_part(STEADY, drivers(1.0), (0,))
    part.state.bridge = np.array([[0.3], [0.2], [0.1]])
    values = np.concatenate([part.take(n) for n in sizes])
    np.testing.assert_allclose((values - bare)[:, 0], [0.3, 0.2, 0.1] + [0.0] * 7, atol=1e-16)
    assert len(part.state.bridge) == 0


def test_a_driver_s_factor_scales_his_movement_alone() -> None:
    one, other = (made(STEADY, drivers(1.0, 1.0), (0, 0)).take(20) for made in (coarse_part, fine_part))
    twice, also = (made(STEADY, drivers(2.0, 1.0), (0, 0)).take(20) for made in (coarse_part, fine_part))
    np.testing.assert_allclose(twice / one, np.tile([2.0, 1.0], (20, 1)), rtol=1e-12)
    np.testing.assert_allclose(also / other, np.tile([2.0, 1.0], (20, 1)), rtol=1e-12)


def test_a_mirrored_model_moves_in_the_mirror() -> None:
    """With the past and the noise's scale of the other sign, the path is the mirror image."""
    there = coarse_part(STEADY, drivers(1.0), (0,)).take(30)
    mirrored = coarse_part(STEADY, drivers(-1.0), (0,)).take(30)
    np.testing.assert_array_equal(mirrored, -there)


def test_what_is_held_does_not_grow_with_the_drive() -> None:
    coarse, fine = coarse_part(POPULATION, drivers(1.0), (2,)), fine_part(POPULATION, drivers(1.0), (1,))
    sizes = []
    for _ in range(60):
        coarse.take(7)
        fine.take(7)
        sizes.append((len(coarse.state.made), len(coarse.state.held), len(fine.state.made), len(fine.state.noise)))
    early, late = np.max(sizes[:10], axis=0), np.max(sizes[10:], axis=0)
    assert (late <= early).all()


def test_zero_volatility_is_a_factor_of_one() -> None:
    np.testing.assert_array_equal(factors_of(STEADY, COARSE, 20), np.ones(20))
    np.testing.assert_array_equal(factors_of(replace(STEADY, correlation=-1.0), FINE, 20), np.ones(20))
