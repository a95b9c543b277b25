"""The spectrum's fit: scale of the coarse movement, and noise with what that lacks."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.signal import welch

from tests.kit.core_models import STEADY
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import (
    DEFAULT_SETTINGS,
    _typical_power,
    fit_spectrum,
    shaped,
    window_of,
)
from xosc_lateral.drivers.model.core.autoregressive.parameters import Autoregression
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE, ShapedNoise

KNOTS = np.linspace(0.0, 2.5, DEFAULT_SETTINGS.n_knots)
"""[Hz]"""

APART = replace(STEADY, fine=ShapedNoise(np.concatenate([np.zeros(9), np.linspace(0.02, 0.001, 42)]), 71, 5.0))
"""Its noise begins where no movement is taken for coarse any more."""


def gain(noise: ShapedNoise) -> np.ndarray:
    """Of the kernel, at the knots. A damping is only known through it: 51 knots are more than 71 taps can hold."""
    return np.abs(np.exp(-0.4j * np.pi * np.outer(KNOTS, np.arange(len(noise.kernel)))) @ noise.kernel)


def test_white_noise_has_its_variance_at_every_frequency() -> None:
    runs = [0.3 * np.random.default_rng(k).normal(size=4000) for k in range(5)]
    frequency, power = _typical_power(runs, DEFAULT_SETTINGS)
    assert frequency[-1] == 0.5
    inside = slice(2, -1)  # a straight line is taken out of the slowest, the last has one degree of freedom
    assert np.log(power[inside] / 0.09).mean() == pytest.approx(0.0, abs=0.05)
    assert np.log(power[inside] / 0.09).std() < 0.25


def test_a_few_loud_minutes_hardly_raise_the_typical_power() -> None:
    """A tenth of the time ten times as loud: Welch's mean goes up elevenfold, the geometric mean by 10^0.2."""
    rng = np.random.default_rng(1)
    calm = [rng.normal(size=1000) for _ in range(9)]
    loud = [*calm, 10.0 * rng.normal(size=1000)]
    inside = slice(2, -1)
    typical = np.exp(np.log(_typical_power(loud, DEFAULT_SETTINGS)[1][inside]).mean())
    mean = np.mean([welch(run, nperseg=100)[1][2:-1] / 2.0 for run in loud])
    assert typical == pytest.approx(10.0**0.2, rel=0.15)
    assert mean > 6.0 * typical


def test_short_runs_are_seen_through_shorter_windows() -> None:
    rng = np.random.default_rng(2)
    long, _ = _typical_power([rng.normal(size=3000)], DEFAULT_SETTINGS)
    short, _ = _typical_power([rng.normal(size=60) for _ in range(30)], DEFAULT_SETTINGS)
    assert len(long) == 51  # 20 s at 5 Hz
    assert len(short) == 26


@pytest.mark.parametrize(
    ("samples", "seconds"),
    [
        ([300] * 10, 30.0),
        ([300] * 9, 20.0),  # 18 windows of 30 s
        ([149] * 100, 20.0),
        ([99] * 100, 10.0),
        ([60], 10.0),  # the last, although there are few
        ([150] * 20 + [80] * 100, 10.0),  # a few long runs don't speak for many short ones
        ([150] * 60 + [80] * 100, 30.0),
    ],
)
def test_windows_are_the_longest_of_which_enough_hold_half_the_time(samples: list[int], seconds: float) -> None:
    size = window_of([np.zeros(n) for n in samples], (30.0, 20.0, 10.0), DEFAULT_SETTINGS)
    assert size * DEFAULT_SETTINGS.step == pytest.approx(seconds)


@pytest.mark.parametrize("shape", ["flat", "falling", "bump"])
def test_the_kernel_has_the_wanted_gain_at_the_knots_although_it_is_short(shape: str) -> None:
    knots = np.linspace(0.0, 1.0, DEFAULT_SETTINGS.n_knots)
    wanted = {
        "flat": np.full_like(knots, 0.02),
        "falling": 0.02 * np.exp(-5.0 * knots),
        "bump": 0.001 + 0.02 * np.exp(-0.5 * ((knots - 0.4) / 0.1) ** 2),
    }[shape]
    np.testing.assert_allclose(gain(shaped(wanted, DEFAULT_SETTINGS))[3:-3], wanted[3:-3], rtol=0.05)


def test_movement_of_a_known_model_is_given_its_own_scale_and_noise_back() -> None:
    coarse, fine = APART.stream(np.random.SeedSequence(3), drivers=40).take(2000)
    halved = Autoregression(APART.coarse.coefficients, 0.5 * APART.coarse.scale)
    found, noise = fit_spectrum(list((coarse + fine).T), halved, DEFAULT_SETTINGS)
    # windows of 20 s leak a little of the slow movement into the band; the rounds of matching take that back
    assert found.scale == pytest.approx(APART.coarse.scale, rel=0.15)
    assert np.sqrt(NOISE_VARIANCE) * np.linalg.norm(noise.kernel) == pytest.approx(fine.std(), rel=0.15)
    fast = KNOTS[:-1] > 0.6
    np.testing.assert_allclose(gain(noise)[:-1][fast], gain(APART.fine)[:-1][fast], rtol=0.15)


def test_the_noise_has_nothing_where_movement_is_coarse() -> None:
    coarse, fine = STEADY.stream(np.random.SeedSequence(4), drivers=10).take(1000)
    _, noise = fit_spectrum(list((coarse + fine).T), STEADY.coarse, DEFAULT_SETTINGS)
    assert (noise.damping[DEFAULT_SETTINGS.fine_from[0] >= KNOTS] == 0.0).all()


def test_twice_the_movement_is_twice_of_both() -> None:
    runs = list(sum(STEADY.stream(np.random.SeedSequence(5), drivers=10).take(1000)).T)  # type: ignore[arg-type]
    one, noise = fit_spectrum(runs, STEADY.coarse, DEFAULT_SETTINGS)
    two, louder = fit_spectrum([2.0 * run for run in runs], STEADY.coarse, DEFAULT_SETTINGS)
    assert two.scale == pytest.approx(2.0 * one.scale, rel=1e-9)
    np.testing.assert_allclose(louder.damping, 2.0 * noise.damping, rtol=1e-6, atol=1e-12)
