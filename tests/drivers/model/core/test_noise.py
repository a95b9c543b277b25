"""Shaped noise."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.fitting.models.two_level import fit_shaped_noise, mean_power
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE, ShapedNoise
from xosc_lateral.drivers.model.linear_filters import JitKernel, _convolve_compiled, convolve


def test_even_damping_leaves_white_noise_white() -> None:
    kernel = ShapedNoise(np.full(11, 0.02)).kernel
    expected = np.zeros(51)
    expected[25] = 0.02
    assert np.allclose(kernel, expected, atol=1e-12)


def test_the_kernel_is_the_inverse_transform_of_the_damping_function() -> None:
    noise = ShapedNoise(np.array([3.0, 2.0, 0.5, 0.0]))
    half = np.arange(26) * 5.0 / 51  # [Hz]
    damping = np.interp(half, np.linspace(0, 2.5, 4), noise.damping)
    k = np.arange(-25, 26)
    written_out = (
        damping[0] + 2 * (damping[1:, None] * np.cos(2 * np.pi * np.outer(half[1:] / 5, k))).sum(axis=0)
    ) / 51
    assert np.allclose(noise.kernel, written_out, atol=1e-12)
    assert np.allclose(noise.kernel, noise.kernel[::-1])


@pytest.mark.parametrize("seed", range(3))
def test_fit_recovers_the_damping_it_was_sampled_with(seed: int) -> None:
    damping = np.array([0.05, 0.06, 0.04, 0.02, 0.01, 0.008, 0.006, 0.005, 0.004, 0.003, 0.002])
    kernel = ShapedNoise(damping).kernel
    white = np.random.default_rng(seed).random(90_050) - 0.5
    found = fit_shaped_noise([np.convolve(white, kernel, "valid")]).damping
    windows = 90_000 / 25  # half-overlapping, of 50 values; each amplitude has a relative error of about 1 / (2 sqrt)
    assert np.abs(found - damping).max() < 0.06 * 5 / np.sqrt(windows) + 0.1 * damping.max()
    assert np.abs(found[3:] / damping[3:] - 1).max() < 0.2


def test_white_noise_of_variance_one_has_power_one() -> None:
    power = mean_power([np.random.default_rng(0).normal(size=100_000)], 50)
    assert np.abs(power - 1.0).max() < 0.15


def test_sampled_noise_has_the_variance_of_its_kernel() -> None:
    noise = ShapedNoise(np.linspace(0.03, 0.0, 11))
    values = convolve(np.random.default_rng(1).random(200_000) - 0.5, noise.kernel)
    assert values.var() == pytest.approx(NOISE_VARIANCE * (noise.kernel**2).sum(), rel=0.03)


@pytest.mark.parametrize("paths", [1, 3])
@pytest.mark.parametrize("n", [1, 7, 511, 512, 513, 5000])
def test_compiled_and_plain_convolution_agree_to_the_last_bit(n: int, paths: int) -> None:
    rng = np.random.default_rng(n)
    kernel = rng.normal(size=51)
    kernel += kernel[::-1]
    values, result = rng.normal(size=(n + 50, paths)), np.empty(n * paths)
    _convolve_compiled()(values.ravel(), kernel, paths, result)
    half = kernel[25] * values[25 : 25 + n]
    for k in range(25):
        half += kernel[k] * (values[k : k + n] + values[50 - k : 50 - k + n])
    assert np.array_equal(result.reshape(n, paths), half)
    one = convolve(values, kernel)
    assert np.allclose(one.T, [np.convolve(path, kernel, "valid") for path in values.T])


def test_a_loop_gives_the_same_compiled_and_plain() -> None:
    def body(start, values, result):  # type: ignore[no-untyped-def]
        total = start
        for i in range(len(values)):
            total = 0.9 * total + values[i]
            result[i] = total
        return total

    loop = JitKernel(body)
    values = np.random.default_rng(2).normal(size=1000)
    plain, compiled = np.empty(1000), np.empty(1000)
    last = loop(1, (0.5, values), (plain,))
    assert loop.compiled()(0.5, values, compiled) == last
    assert np.array_equal(plain, compiled)


def test_contradictions_are_refused() -> None:
    with pytest.raises(DriverProfileError, match="values >= 0"):
        ShapedNoise(np.array([0.1, -0.1]))
    with pytest.raises(DriverProfileError, match="odd"):
        ShapedNoise(np.array([0.1, 0.1]), 50)
    with pytest.raises(NotEnoughDataError, match="12 values"):
        fit_shaped_noise([np.zeros(12)])
