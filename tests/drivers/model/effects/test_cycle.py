"""A cycle whose phase starts anywhere and wanders."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tests.kit.profiles import whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Cycle


def cycle(effect: Cycle, time: np.ndarray, seed: int) -> np.ndarray:
    return np.asarray(whole_terms(effect, time, {}, np.random.default_rng(seed)).location)


def test_a_steady_swing_is_a_sine() -> None:
    time = 0.2 * np.arange(600)
    found = cycle(Cycle(amplitude=0.12, period_s=15.0, coherence_s=1e18), time, 1)
    waves = np.stack([np.sin(2 * np.pi * time / 15.0), np.cos(2 * np.pi * time / 15.0)], axis=1)
    parts, left, *_ = np.linalg.lstsq(waves, found, rcond=None)
    assert np.hypot(*parts) == pytest.approx(0.12, abs=1e-9)
    assert left[0] < 1e-12


def test_it_starts_anywhere_in_its_cycle() -> None:
    """A sine at an even phase has the arcsine law."""
    effect = Cycle(amplitude=0.1, period_s=12.0)
    first = np.array([cycle(effect, np.zeros(1), seed)[0] for seed in range(500)])
    assert stats.kstest(first, "arcsine", (-0.1, 0.2)).pvalue > 0.001


def test_the_phase_wanders_by_one_radian_within_the_coherence_time() -> None:
    """Brownian motion: E sin(x0) sin(x0 + w) = exp(-Var w / 2) / 2 at whole periods."""
    effect, time = Cycle(amplitude=1.0, period_s=10.0, coherence_s=30.0), np.arange(0.0, 31.0, 1.0)
    paths = np.stack([cycle(effect, time, seed) for seed in range(1500)])
    remembered = float(np.mean(paths[:, 0] * paths[:, -1])) / 0.5
    assert remembered == pytest.approx(np.exp(-0.5), abs=4.0 / np.sqrt(1500))


def test_the_drive_s_clock_does_not_matter() -> None:
    effect, time = Cycle(amplitude=0.1, period_s=9.0, coherence_s=60.0), 0.25 * np.arange(200)
    np.testing.assert_allclose(cycle(effect, 4096.0 + time, 4), cycle(effect, time, 4), atol=1e-12)


def test_twice_the_amplitude_is_twice_the_path() -> None:
    time = 0.2 * np.arange(100)
    one, two = (cycle(Cycle(amplitude=a, period_s=9.0, coherence_s=60.0), time, 5) for a in (0.1, 0.2))
    np.testing.assert_allclose(two, 2.0 * one, rtol=1e-12)


@pytest.mark.parametrize("field", ["amplitude", "period_s", "coherence_s"])
def test_sizes_and_times_are_above_nothing(field: str) -> None:
    with pytest.raises(DriverProfileError, match=f"cycle: {field} = "):
        Cycle(**{"amplitude": 0.1, "period_s": 9.0} | {field: 0.0})
