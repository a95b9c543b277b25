"""A line in the spectra of all drives: how sure, at which frequency, and how often white noise seems to have one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from xosc_lateral.extras.loop.terms.hidden import PERIODS_S, line

N = 3000
"""Whitened seconds: 50 min."""


def one_drive(rows: np.ndarray, drives: int = 1) -> tuple[float, float, int]:
    """In drives of equal length."""
    n = len(rows)
    drive = (np.arange(n) * drives // n).astype(np.intp)
    return line(rows, np.ones(n, dtype=bool), drive, np.random.default_rng(1))


@pytest.mark.parametrize(("drives", "seconds"), [(1, 1000), (5, 1500)])
def test_white_noise_has_a_line_as_often_as_the_p_value_says(drives: int, seconds: int) -> None:
    rng = np.random.default_rng(100 + drives)
    p_values = [one_drive(rng.normal(size=seconds), drives)[0] for _ in range(60)]
    # over all frequencies at once: conservative is fine, the other side is not
    assert kstest(p_values, "uniform", alternative="greater").pvalue > 0.001
    assert min(p_values) > 1e-4


@pytest.mark.parametrize("period", [7.0, 12.0, 25.0])
def test_a_steady_cycle_is_found_at_its_frequency(period: float) -> None:
    """Also between two of the spectrum's frequencies."""
    time = np.arange(N)
    rows = np.random.default_rng(7).normal(size=N) + 0.3 * np.sin(2.0 * np.pi * time / period + 1.0)
    p_value, frequency, _ = one_drive(rows)
    assert p_value < 1e-6
    assert frequency == pytest.approx(1.0 / period, abs=1.5 / N)


def test_short_drives_show_together_what_none_shows_alone() -> None:
    rng, seconds = np.random.default_rng(11), 300
    phases = rng.uniform(0.0, 2.0 * np.pi, 8)
    parts = [rng.normal(size=seconds) + 0.4 * np.sin(2.0 * np.pi * np.arange(seconds) / 12.0 + one) for one in phases]
    assert min(one_drive(part)[0] for part in parts) > 1e-4
    p_value, frequency, _ = one_drive(np.concatenate(parts), 8)
    assert p_value < 1e-5
    assert 1.0 / frequency == pytest.approx(12.0, rel=0.03)


def test_a_cycle_whose_phase_wanders_is_a_broad_line() -> None:
    rng = np.random.default_rng(8)
    phase = np.cumsum(rng.normal(size=N)) * np.sqrt(1.0 / 300.0)
    rows = rng.normal(size=N) + 0.3 * np.sin(2.0 * np.pi * np.arange(N) / 12.0 + phase)
    p_value, _, width = one_drive(rows)
    assert width > 1
    assert p_value < 1e-4


@pytest.mark.parametrize("period", [2.0, 180.0])
def test_cycles_beyond_the_periods_looked_at_are_none_of_its_business(period: float) -> None:
    assert not PERIODS_S[0] <= period <= PERIODS_S[1]
    rows = np.random.default_rng(9).normal(size=N) + 0.5 * np.sin(2.0 * np.pi * np.arange(N) / period + 1.0)
    _, frequency, _ = one_drive(rows)
    assert 1.0 / PERIODS_S[1] <= frequency <= 1.0 / PERIODS_S[0]
