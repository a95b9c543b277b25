"""The error's density as measured, and its varying level."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.sensor.model import SensorModel
from xosc_lateral.driver.sensor.texture import amplitude_factor, level_variation, measured_density
from xosc_lateral.drives.periodogram import periodograms
from xosc_lateral.errors import DriverProfileError

STEP = 0.2


def density_of(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.fft.rfftfreq(128, STEP), 2.0 * STEP * periodograms(path, 128).mean(axis=0)


def test_a_bump_comes_back_as_it_was_measured():
    frequency = np.fft.rfftfreq(128, STEP)
    shape = 1e-6 * (1.0 + 9.0 * np.exp(-0.5 * ((frequency - 1.2) / 0.1) ** 2))
    table = measured_density(frequency, np.array([2.0 * shape]), np.full(len(frequency), 0.5))
    sensor = SensorModel(white=1e-6, frequencies=table[0], densities=table[1])
    seen_at, seen = density_of(sensor.sample(200_000, STEP, np.random.default_rng(0)))
    inside = (seen_at > 0.3) & (seen_at < 2.2)
    np.testing.assert_allclose(seen[inside], shape[inside], rtol=0.3)


@pytest.mark.parametrize(("variance", "lasts"), [(0.0, 10.0), (0.8, 10.0), (1.5, 20.0)])
def test_the_level_s_variation_is_found(variance: float, lasts: float):
    steady = SensorModel(white=1e-4)
    restless = SensorModel(white=1e-4, level_variance=variance, level_duration=lasts)
    runs = [restless.sample(1500, STEP, np.random.default_rng(seed)) for seed in range(30)]
    found, lasting = level_variation(runs, steady.sample(50_000, STEP, np.random.default_rng(99)), STEP)
    assert found == pytest.approx(variance, abs=0.25)
    if variance:
        assert 0.5 * lasts < lasting < 2.0 * lasts


def test_a_varying_level_keeps_the_power():
    level = amplitude_factor(0.7, 8.0, 200_000, STEP, np.random.default_rng(1))
    assert np.mean(level**2) == pytest.approx(1.0, rel=0.06)
    assert np.log(level**2).var() == pytest.approx(0.7, rel=0.1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"frequencies": (1.0, 0.5), "densities": (1.0, 1.0)},
        {"frequencies": (1.0,)},
        {"level_variance": -1.0},
        {"level_duration": 0.0},
    ],
)
def test_what_is_no_texture_is_refused(wrong: dict[str, object]):
    with pytest.raises(DriverProfileError):
        SensorModel(white=1.0, **wrong)  # type: ignore[arg-type]
