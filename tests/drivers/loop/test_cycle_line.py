"""A line in the spectrum: how sure, at which frequency, and how often white noise seems to have one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from xosc_lateral.drivers.loop.terms.hidden import PERIODS_S, WIDTHS, _line

N = 3000
"""Whitened seconds: 50 min."""


@pytest.mark.parametrize("width", WIDTHS)
def test_white_noise_has_a_line_as_often_as_the_p_value_says(width: int) -> None:
    rng = np.random.default_rng(100 + width)
    p_values = [_line(rng.normal(size=N), width)[0] for _ in range(150)]
    # over all frequencies at once: conservative is fine, the other side is not
    assert kstest(np.minimum(p_values, 1.0), "uniform", alternative="greater").pvalue > 0.001
    assert min(p_values) > 1e-4


@pytest.mark.parametrize("period", [7.0, 12.0, 25.0])
def test_a_steady_cycle_is_found_at_its_frequency(period: float) -> None:
    """Also between two of the spectrum's frequencies, where a broader line has what a narrow one loses."""
    time = np.arange(N)
    rows = np.random.default_rng(7).normal(size=N) + 0.3 * np.sin(2.0 * np.pi * time / period + 1.0)
    p_value, frequency, _ = min(_line(rows, width) for width in WIDTHS)
    assert p_value < 1e-6
    assert frequency == pytest.approx(1.0 / period, abs=1.5 / N)


def test_a_cycle_whose_phase_wanders_is_surer_as_a_broad_line() -> None:
    rng = np.random.default_rng(8)
    phase = np.cumsum(rng.normal(size=N)) * np.sqrt(1.0 / 300.0)
    rows = rng.normal(size=N) + 0.3 * np.sin(2.0 * np.pi * np.arange(N) / 12.0 + phase)
    by_width = {width: _line(rows, width)[0] for width in WIDTHS}
    assert min(by_width, key=lambda width: by_width[width]) > 1
    assert min(by_width.values()) < 1e-4


@pytest.mark.parametrize("period", [2.0, 180.0])
def test_cycles_beyond_the_periods_looked_at_are_none_of_its_business(period: float) -> None:
    assert not PERIODS_S[0] <= period <= PERIODS_S[1]
    rows = np.random.default_rng(9).normal(size=N) + 0.5 * np.sin(2.0 * np.pi * np.arange(N) / period + 1.0)
    _, frequency, _ = _line(rows, 1)
    assert 1.0 / PERIODS_S[1] <= frequency <= 1.0 / PERIODS_S[0]


def test_the_size_of_the_rows_does_not_matter() -> None:
    rows = np.random.default_rng(10).normal(size=N)
    one, thousand = _line(rows, 1), _line(1000.0 * rows, 1)
    assert thousand[0] == pytest.approx(one[0])
    assert thousand[1:] == one[1:]
