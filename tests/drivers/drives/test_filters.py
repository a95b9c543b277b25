"""Low-pass filters and spectra against scipy's, which the package does without for its import time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from xosc_lateral.drivers.drives.filters import Detrend, hann, kaiser_design, low_pass, mirrored, periodograms


@pytest.mark.parametrize("attenuation", [21.0, 35.0, 50.0])
@pytest.mark.parametrize("width", [0.05, 0.2])
def test_the_design_is_kaisers(attenuation: float, width: float) -> None:
    half, beta = kaiser_design(attenuation, width)
    taps, expected = signal.kaiserord(attenuation, width)
    assert beta == pytest.approx(expected, abs=1e-12)
    assert taps - 1 <= 2 * half + 1 <= taps + 2  # odd, so that it delays nothing


@pytest.mark.parametrize(("half", "cutoff", "beta"), [(20, 0.16, 6.0), (24, 0.2, 7.0), (89, 0.1, 4.53)])
def test_a_low_pass_is_scipys_window_design(half: int, cutoff: float, beta: float) -> None:
    expected = signal.firwin(2 * half + 1, cutoff, window=("kaiser", beta))
    np.testing.assert_allclose(low_pass(half, cutoff, beta), expected, rtol=0, atol=1e-15)


def test_the_design_keeps_its_promise_in_both_bands() -> None:
    """To 2 dB: the formula is a fit."""
    half, beta = kaiser_design(50.0, 0.1)
    frequency, gain = signal.freqz(low_pass(half, 0.4, beta), worN=4096)
    share, size = frequency / np.pi, np.abs(gain)
    assert np.abs(size[share < 0.35] - 1.0).max() < 10 ** (-48 / 20)
    assert size[share > 0.45].max() < 10 ** (-48 / 20)


def test_an_attenuation_beyond_the_formula_is_refused() -> None:
    with pytest.raises(ValueError, match=r"attenuation 80\.0 dB, expected 21 to 50"):
        kaiser_design(80.0, 0.1)


@pytest.mark.parametrize("size", [16, 50, 51])
def test_mean_of_the_windows_is_scipys_welch(size: int) -> None:
    values = np.random.default_rng(size).normal(size=1001).cumsum()
    _, expected = signal.welch(
        values, window=hann(size), nperseg=size, noverlap=size - size // 2, detrend=False, return_onesided=False
    )
    found = periodograms(values, size)
    np.testing.assert_allclose(found.mean(axis=0), expected[: size // 2 + 1], rtol=1e-9)
    _, without_mean = signal.welch(
        values, window=hann(size), nperseg=size, noverlap=size - size // 2, detrend="constant", return_onesided=False
    )
    mean = periodograms(values, size, detrend=Detrend.MEAN).mean(axis=0)
    np.testing.assert_allclose(mean, without_mean[: size // 2 + 1], rtol=1e-9)


def test_white_noise_has_a_power_of_one_everywhere() -> None:
    power = periodograms(np.random.default_rng(2).normal(size=200_000), 64).mean(axis=0)
    # 6249 half-overlapping windows are worth about 5500 independent ones.
    np.testing.assert_allclose(power, 1.0, atol=6 * np.sqrt(2 / 5500))


def test_a_straight_line_has_no_power_once_its_ends_are_taken_out_and_a_short_run_no_window() -> None:
    line = np.linspace(3.0, 9.0, 300)
    assert periodograms(line, 50, detrend=Detrend.ENDS).max() < 1e-20
    assert periodograms(line[:49], 50).shape == (0, 26)


@pytest.mark.parametrize("n", [1, 2, 5, 40])
def test_a_series_goes_on_through_the_points_of_its_ends_and_stays_where_it_has_no_image(n: int) -> None:
    line = 0.3 + 0.1 * np.arange(n)
    long = mirrored(line, 7)
    near = min(7, n - 1)
    np.testing.assert_allclose(long[7 - near : n + 7 + near], 0.3 + 0.1 * np.arange(-near, n + near), atol=1e-15)
    assert (long[: 7 - near] == long[7 - near]).all() and (long[n + 7 + near :] == long[n + 6 + near]).all()
    values = np.random.default_rng(n).normal(size=n)
    np.testing.assert_array_equal(mirrored(values, 7)[7 : n + 7], values)
    np.testing.assert_array_equal(mirrored(values, 0), values)
