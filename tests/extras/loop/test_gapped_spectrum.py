"""Spectra across gaps: a library where there are none, what is known where there are; seams: `test_spectra`."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import welch

from xosc_lateral.extras.loop.loop_curves import MANY_SEGMENTS, gapped_spectrum

STEP, SEGMENT = 0.2, 256


def series(seed: int, n: int = 6000, runs: int = 1) -> np.ndarray:
    """First-order movement about 0.3 m: a mean that has to go."""
    rng = np.random.default_rng(seed)
    noise, out = rng.normal(size=(runs, n)), np.zeros((runs, n))
    for k in range(1, n):
        out[:, k] = 0.9 * out[:, k - 1] + 0.1 * noise[:, k]
    return 0.3 + out


def whole(n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.ones(n, dtype=bool), np.zeros(n, dtype=np.intp)


def test_without_gaps_it_is_welch_s_method_of_a_library() -> None:
    values = series(1)
    frequency, density, number = gapped_spectrum(values, *whole(values.shape[1]), STEP, SEGMENT)
    window = np.hanning(SEGMENT)
    expected = welch(
        values[0] - values[0].mean(), 1.0 / STEP, window=window, nperseg=SEGMENT, noverlap=SEGMENT // 2, detrend=False
    )
    np.testing.assert_allclose(frequency, expected[0][1:])
    np.testing.assert_allclose(density[:-1], expected[1][1:-1], rtol=1e-9)  # the last one has no twin to be added
    assert number == (values.shape[1] - SEGMENT) // (SEGMENT // 2) + 1


def test_several_runs_are_averaged() -> None:
    values = series(2, runs=3)
    _, together, _ = gapped_spectrum(values, *whole(values.shape[1]), STEP, SEGMENT)
    alone = [gapped_spectrum(values[[k]], *whole(values.shape[1]), STEP, SEGMENT)[1] for k in range(3)]
    np.testing.assert_allclose(together, np.mean(alone, axis=0), rtol=1e-9)


def test_the_density_adds_up_to_the_variance_gaps_or_none() -> None:
    values, (valid, seams) = series(3, n=60_000), whole(60_000)
    variance = values.var()
    gaps = valid.copy()
    gaps[:: SEGMENT + 40] = False  # one row missing in every segment but a few
    for kept in (valid, gaps):
        frequency, density, _ = gapped_spectrum(values, kept, seams, STEP, SEGMENT)
        assert density.sum() * frequency[0] == pytest.approx(variance, rel=0.1)


def test_with_many_whole_segments_those_with_gaps_do_not_count() -> None:
    values, (valid, seams) = series(5), whole(6000)
    _, _, every = gapped_spectrum(values, valid, seams, STEP, SEGMENT)
    valid[3000] = False  # two segments, which overlap by half, hold it
    _, density, number = gapped_spectrum(values, valid, seams, STEP, SEGMENT)
    assert number == every - 2 >= MANY_SEGMENTS
    assert (density > 0.0).all()


def test_with_few_those_that_are_mostly_there_do() -> None:
    values, (valid, seams) = series(6, n=3 * SEGMENT), whole(3 * SEGMENT)
    valid[::10] = False
    _, density, number = gapped_spectrum(values, valid, seams, STEP, SEGMENT)
    assert 0 < number < MANY_SEGMENTS
    assert (density > 0.0).all()


@pytest.mark.parametrize("kept", [0.0, 0.5], ids=["nothing", "every second row"])
def test_where_too_little_is_left_nothing_is_said(kept: float) -> None:
    values, (valid, seams) = series(7), whole(6000)
    valid[: round(6000 * (1.0 - kept))] = False
    valid[1::2] = kept > 0.0
    valid[::2] = False
    if kept == 0.0:
        valid[0] = True  # a mean there must be
    _, density, number = gapped_spectrum(values, valid, seams, STEP, SEGMENT)
    assert number == 0
    assert np.isnan(density).all()
