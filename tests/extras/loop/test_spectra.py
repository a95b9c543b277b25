"""Spectra of series with gaps and seams."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.extras.loop.loop_curves import gapped_spectrum


def test_the_spectrum_of_white_noise_is_flat_and_holds_its_variance() -> None:
    rng = np.random.default_rng(1)
    series = rng.normal(size=(4, 20_000))
    frequency, density, number = gapped_spectrum(
        series, np.ones(20_000, dtype=np.bool_), np.zeros(20_000, dtype=np.intp), 0.2, 512
    )
    assert number == 77
    assert density.sum() * frequency[0] == pytest.approx(1.0, rel=0.03)
    assert density[:50].mean() == pytest.approx(density[-50:].mean(), rel=0.05)


def test_a_jump_between_blocks_does_not_enter_the_spectrum() -> None:
    rng = np.random.default_rng(2)
    n = 8192
    seams = np.arange(n) // 1024
    valid = np.ones(n, dtype=np.bool_)
    smooth = 0.01 * rng.normal(size=(1, n)).cumsum(axis=1)
    jumping = smooth + 5.0 * seams
    within = gapped_spectrum(jumping, valid, seams, 0.2, 512)[1]
    across = gapped_spectrum(jumping, valid, np.zeros(n, dtype=np.intp), 0.2, 512)[1]
    assert across[100:].mean() > 10.0 * within[100:].mean()
