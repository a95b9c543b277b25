"""What the autoregressive model is made of: its filters, its drivers, its volatility."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from scipy import signal, stats

from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.drivers.model.core.autoregressive.model import (
    COARSE,
    FINE,
    AutoregressiveModel,
    Factors,
    begin_factors,
)
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    BORDER,
    COARSE_EVERY,
    TICKS,
    Volatility,
    building_low_pass,
    draw_drivers,
    interpolate,
    measuring_low_pass,
    phases,
    split_bands,
)
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.files.profiles import read_profile

STEP = 0.2


@pytest.fixture(scope="module")
def model() -> AutoregressiveModel:
    profile = read_profile(shipped_folder("driver_profiles") / "motorway.json")
    assert isinstance(profile.model, AutoregressiveModel)
    return profile.model


# ---- filters ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("frequency", "slow_share"), [(0.02, 1.0), (0.1, 1.0), (BORDER, 0.5), (0.8, 0.0), (2.0, 0.0)])
def test_movement_is_split_at_the_border(frequency: float, slow_share: float) -> None:
    wave = np.sin(2.0 * np.pi * frequency * STEP * np.arange(2000) + 0.3)
    slow, fast = split_bands(wave, STEP)
    inside = slice(100, -100)
    np.testing.assert_allclose(slow[inside], slow_share * wave[inside], atol=2e-3)
    np.testing.assert_allclose(slow + fast, wave, atol=1e-12)


def test_a_slope_has_nothing_fast_up_to_its_very_ends() -> None:
    _, fast = split_bands(0.3 + 0.01 * np.arange(300.0), STEP)
    assert np.abs(fast).max() < 1e-12


@pytest.mark.parametrize("n", [2, 5, 30])
def test_runs_shorter_than_the_filter_are_split_too(n: int) -> None:
    values = np.random.default_rng(n).normal(size=n)
    slow, fast = split_bands(values, STEP)
    assert slow.shape == fast.shape == (n,)
    np.testing.assert_allclose(slow + fast, values, atol=1e-12)


def test_the_measuring_low_pass_is_63_db_down_where_movement_is_fine() -> None:
    frequency, gain = signal.freqz(measuring_low_pass(STEP), worN=8192, fs=1.0 / STEP)
    assert np.abs(gain[frequency > 0.75]).max() < 10 ** (-63 / 20)
    assert np.abs(np.abs(gain[frequency < 0.1]) - 1.0).max() < 1e-3


def test_images_of_slow_movement_are_75_db_down() -> None:
    """A value a second has images about 1 Hz, 2 Hz ...: what the building low-pass leaves of them."""
    frequency, gain = signal.freqz(building_low_pass() / COARSE_EVERY, worN=8192, fs=5.0)
    assert np.abs(gain[frequency > 0.95]).max() < 10 ** (-75 / 20)


def test_phases_are_the_building_low_pass_laid_over_coarse_values() -> None:
    steps = np.random.default_rng(1).normal(size=(40, 3))
    made = interpolate(steps)
    upsampled = np.zeros((40 * COARSE_EVERY, 3))
    upsampled[::COARSE_EVERY] = steps
    expected = signal.convolve(upsampled, building_low_pass()[:, None], mode="same")[TICKS * COARSE_EVERY :]
    # each phase's weights are scaled to sum to 1: the plain kernel's differ from that by 1e-4
    np.testing.assert_allclose(made, expected[: len(made)], atol=1e-3)
    np.testing.assert_allclose(phases().sum(axis=0), 1.0, atol=1e-15)


def test_slow_movement_given_once_a_second_is_met_five_times_a_second() -> None:
    coarse, fine = np.arange(100.0), np.arange(0.0, 100.0, STEP)
    steps = np.sin(2.0 * np.pi * 0.1 * coarse)[:, None]
    made = interpolate(steps)[:, 0]
    expected = np.sin(2.0 * np.pi * 0.1 * fine)[TICKS * COARSE_EVERY :][: len(made)]
    np.testing.assert_allclose(made, expected, atol=2e-3)


# ---- drivers ---------------------------------------------------------------------------------------------------------
def test_drivers_have_the_population_s_mean_and_spread_and_factors_of_mean_square_one(
    model: AutoregressiveModel,
) -> None:
    n = 20_000
    drivers = draw_drivers(model, None, np.random.default_rng(1), n)
    assert drivers.mean.mean() == pytest.approx(model.mean, abs=5.0 * model.between_drivers / np.sqrt(n))
    assert drivers.mean.std() == pytest.approx(model.between_drivers, rel=0.03)
    for factor, part in ((drivers.coarse, model.coarse_volatility), (drivers.fine, model.fine_volatility)):
        assert np.log(factor).var() == pytest.approx(part.between, rel=0.05, abs=1e-9)
        assert np.mean(factor**2) == pytest.approx(1.0, abs=0.12)


def test_logs_of_both_factors_are_correlated(model: AutoregressiveModel) -> None:
    sized = replace(
        model, coarse_volatility=Volatility(0.1, 0.1, 5.0), fine_volatility=Volatility(0.2, 0.1, 5.0), correlation=0.6
    )
    drivers = draw_drivers(sized, None, np.random.default_rng(2), 20_000)
    assert np.corrcoef(np.log(drivers.coarse), np.log(drivers.fine))[0, 1] == pytest.approx(0.6, abs=0.03)


@pytest.mark.parametrize("away", [-0.2, 0.0, 0.3])
def test_who_is_found_at_a_start_is_the_normal_posterior(model: AutoregressiveModel, away: float) -> None:
    """One size of movement: prior N(mean, between^2) and a place whose own variance is known give Bayes' normal."""
    alike = replace(model, coarse_volatility=Volatility(0.0, 0.1, 5.0), fine_volatility=Volatility(0.0, 0.1, 5.0))
    drivers = draw_drivers(alike, Start(rel_offset=model.mean + away), np.random.default_rng(3), 20_000)
    between = model.between_drivers**2
    moving = alike.coarse_covariance[0] + alike.fine_covariance[0]
    share = between / (between + moving)
    assert drivers.mean.mean() == pytest.approx(model.mean + share * away, abs=4.0 * np.sqrt(between / 20_000))
    assert drivers.mean.var() == pytest.approx(between * (1.0 - share), rel=0.05)


def test_who_is_found_far_out_moves_more_than_others(model: AutoregressiveModel) -> None:
    varied = replace(model, coarse_volatility=Volatility(0.3, 0.1, 5.0))
    far = draw_drivers(varied, Start(rel_offset=model.mean + 0.45), np.random.default_rng(4), 4000)
    near = draw_drivers(varied, Start(rel_offset=model.mean), np.random.default_rng(4), 4000)
    assert np.log(far.coarse).mean() > np.log(near.coarse).mean() + 0.2


# ---- volatility ------------------------------------------------------------------------------------------------------
def varying(model: AutoregressiveModel) -> AutoregressiveModel:
    return replace(
        model,
        coarse_volatility=Volatility(0.0, 0.3, 6.0, 0.1),
        fine_volatility=Volatility(0.0, 0.2, 3.0, 0.0),
        correlation=0.5,
    )


def factors_of(model: AutoregressiveModel, drivers: int = 1, seed: int = 1) -> Factors:
    return Factors(model, begin_factors(model, np.random.SeedSequence(seed), drivers))


def test_factors_have_mean_square_one_and_their_logs_the_variance_of_all_parts(model: AutoregressiveModel) -> None:
    both = factors_of(varying(model), drivers=400)
    coarse, fine = both.take(COARSE, 500), both.take(FINE, 500)
    for factor, variance in ((coarse, 0.4), (fine, 0.2)):
        assert np.log(factor).var() == pytest.approx(variance, rel=0.06)
        assert np.mean(factor**2) == pytest.approx(1.0, abs=0.08)
    quick = np.corrcoef(np.log(coarse).ravel(), np.log(fine).ravel())[0, 1]
    # covariance: the quick parts' alone, 0.5 sqrt(0.3 0.2), lessened by their unlike memories
    memory = np.exp(-1.0 / np.array([6.0, 3.0]))
    lessened = np.sqrt((1.0 - memory**2).prod()) / (1.0 - memory.prod())
    assert quick == pytest.approx(0.5 * np.sqrt(0.3 * 0.2) * lessened / np.sqrt(0.4 * 0.2), abs=0.05)


def test_the_log_of_a_factor_forgets_with_its_own_memory(model: AutoregressiveModel) -> None:
    logs = np.log(factors_of(varying(model), drivers=400).take(FINE, 500))
    logs -= logs.mean()
    for lag in (1, 3, 6):
        covariance = float((logs[lag:] * logs[:-lag]).mean())
        assert covariance / 0.2 == pytest.approx(np.exp(-lag / 3.0), abs=0.05)


@pytest.mark.parametrize("sizes", [(1,) * 20, (7, 13), (20,), (0, 20)])
def test_parts_take_their_factors_in_pieces_of_their_own(model: AutoregressiveModel, sizes: tuple[int, ...]) -> None:
    whole = factors_of(varying(model), 2)
    coarse, fine = whole.take(COARSE, 20), whole.take(FINE, 20)
    pieces = factors_of(varying(model), 2)
    np.testing.assert_array_equal(np.concatenate([pieces.take(COARSE, n) for n in sizes]), coarse)
    np.testing.assert_array_equal(np.concatenate([pieces.take(FINE, n) for n in reversed(sizes)]), fine)


def test_factors_are_stationary_from_the_first_step_on(model: AutoregressiveModel) -> None:
    first = np.log(factors_of(varying(model), drivers=4000).take(COARSE, 1)[0])
    later = np.log(factors_of(varying(model), drivers=4000, seed=2).take(COARSE, 40)[-1])
    assert stats.ks_2samp(first, later).pvalue > 0.001
