"""Drives of the paper's model, rebuilt from their definitions with numpy."""

from __future__ import annotations

import json

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.core.two_level.model import TwoLevelModel, TwoLevelSettings, TwoLevelState, _first_bins
from xosc_lateral.drivers.model.records import plain, read_as
from xosc_lateral.drivers.model.seeds import TwoLevelSeed, generator

N = 400
SEED = np.random.SeedSequence(11)


@pytest.fixture(scope="module")
def model() -> TwoLevelModel:
    rng = np.random.default_rng(1)
    path = np.clip(0.02 * rng.normal(size=8000).cumsum() * 0.3, -0.4, 0.4)
    return fit_two_level([0.1 * np.sin(np.arange(8000) / 40.0) + 0.3 * path + 0.01 * rng.normal(size=8000)])


def test_coarse_values_are_the_chain_s_levels_smoothed(model: TwoLevelModel) -> None:
    twin = model.stream(SEED)
    levels = np.concatenate([twin.state.levels[:, 0], twin.walk(N)[:, 0]])
    expected = np.convolve(levels, model.settings.smoothing_kernel, "valid")
    np.testing.assert_allclose(model.stream(SEED).take(N)[0], expected, rtol=0, atol=1e-14)


def test_fine_values_are_uniform_noise_convolved_with_the_kernel(model: TwoLevelModel) -> None:
    taps = len(model.noise.kernel)
    noise = generator(SEED, TwoLevelSeed.NOISE).random(N + taps - 1) - 0.5
    expected = np.convolve(noise, model.noise.kernel, "valid")
    np.testing.assert_allclose(model.stream(SEED).take(N)[1], expected, rtol=0, atol=1e-14)


def test_levels_are_the_centres_of_bins_that_were_visited(model: TwoLevelModel) -> None:
    levels = model.stream(SEED).walk(3000)[:, 0]
    visited = (np.flatnonzero(model.chain.support) + 0.5) / 20 - 0.5
    assert {round(level, 9) for level in levels} <= {round(level, 9) for level in visited}


def test_free_drives_begin_as_often_in_a_bin_as_they_stay_there(model: TwoLevelModel) -> None:
    bins = _first_bins(model, SEED, None, 20_000)
    share = np.bincount(bins, minlength=20) / 20_000
    np.testing.assert_allclose(share, model.chain.stationary, atol=4.0 * np.sqrt(0.25 / 20_000))


@pytest.mark.parametrize(("rel_offset", "spread", "expected"), [(0.12, 1.0, 12), (-0.26, 1.0, 4), (0.9, 1.0, 19)])
def test_a_start_lies_in_its_bin(model: TwoLevelModel, rel_offset: float, spread: float, expected: int) -> None:
    assert _first_bins(model, SEED, Start(rel_offset, spread), 3).tolist() == [expected] * 3


def test_a_start_under_a_larger_spread_lies_nearer_to_the_mean(model: TwoLevelModel) -> None:
    plain_bin, wide_bin = (int(_first_bins(model, SEED, Start(0.31, spread), 1)[0]) for spread in (1.0, 3.0))
    assert plain_bin == 16  # 0.3 is its border
    assert wide_bin == int((model.mean + (0.31 - model.mean) / 3.0 + 0.5) * 20)


def test_what_a_start_lacks_fades_out_as_half_a_cosine() -> None:
    fade = TwoLevelSettings().fade_out
    np.testing.assert_allclose(fade, np.cos(0.1 * np.pi * np.arange(5)) ** 2)  # 0.2 s each, gone after one second
    assert len(TwoLevelSettings(start_fade=0.01).fade_out) == 1


def test_after_a_second_a_start_s_fade_is_gone(model: TwoLevelModel) -> None:
    started = model.stream(SEED, Start(0.13))
    bare = model.stream(SEED, Start(0.13))
    bare.state.fade = bare.state.fade[:0]
    one, other = started.take(30)[0], bare.take(30)[0]
    np.testing.assert_array_equal(one[5:], other[5:])
    assert one[0] != other[0]


def test_drivers_side_by_side_start_where_each_is_told_to(model: TwoLevelModel) -> None:
    starts = np.array([-0.2, 0.0, 0.17])
    coarse, fine = model.stream(SEED, Start(starts), drivers=3).take(1)
    np.testing.assert_allclose(coarse[0] + fine[0], starts, atol=1e-12)


def test_one_driver_alone_is_an_axis_of_one(model: TwoLevelModel) -> None:
    for alone, listed in zip(model.stream(SEED).take(50), model.stream(SEED, drivers=1).take(50), strict=True):
        np.testing.assert_array_equal(alone, listed[:, 0])


@pytest.mark.parametrize("drivers", [None, 2])
def test_a_state_from_json_goes_on_bit_by_bit(model: TwoLevelModel, drivers: int | None) -> None:
    stream = model.stream(SEED, Start(0.1), drivers=drivers)
    stream.take(3)
    state = read_as(TwoLevelState, json.loads(json.dumps(plain(stream.state))))
    for one, other in zip(stream.take(80), model.resume(state).take(80), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("field", TwoLevelSettings.__struct_fields__)
@pytest.mark.parametrize("value", [0, -1, np.inf, np.nan])
def test_settings_are_above_nothing_and_finite(field: str, value: float) -> None:
    with pytest.raises(DriverProfileError, match=f"{field} .*expected above 0"):
        TwoLevelSettings(**{field: value})


@pytest.mark.parametrize(("sigma", "support"), [(0.6, 1.0), (0.3, 2.0), (1.5, 0.4)])
def test_smoothing_is_scipys_gaussian_window(sigma: float, support: float) -> None:
    from scipy.signal.windows import gaussian

    settings = TwoLevelSettings(smoothing_sigma=sigma, smoothing_support=support)
    window = gaussian(2 * round(support / 0.2) + 1, sigma / 0.2)
    np.testing.assert_allclose(settings.smoothing_kernel, window / window.sum(), rtol=1e-12)
