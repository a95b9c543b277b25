"""Residuals whose tie to the columns is broken: what a draw keeps, and what it does not."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from xosc_lateral.extras.loop.significance import BLOCK_S, MANY_DRIVES, draw_null, effective_number, in_another_order

N = 3000


def drawn(residual: np.ndarray, draws: int = 400) -> np.ndarray:
    return draw_null(residual, np.zeros(len(residual), dtype=int), np.random.default_rng(1), draws)


def test_a_draw_is_the_same_seconds_in_another_order() -> None:
    residual = np.random.default_rng(2).normal(size=N)
    for draw in drawn(residual, 5).T:
        np.testing.assert_array_equal(np.sort(draw), np.sort(residual))
        assert abs(np.corrcoef(draw, residual)[0, 1]) < 0.3


def test_neighbours_stay_neighbours_but_at_the_ends_of_blocks() -> None:
    steps = np.diff(drawn(np.arange(float(N)), 20), axis=0)
    blocks = round(N / BLOCK_S)
    assert (np.abs(steps - 1.0) > 0.5).sum(axis=0).max() <= blocks
    rising = lfilter([1.0], [1.0, -0.9], np.ones(N))
    np.testing.assert_allclose(drawn(rising, 3).std(axis=0), rising.std())


def test_memory_of_a_minute_is_kept() -> None:
    residual = lfilter([1.0], [1.0, -np.exp(-1.0 / 60.0)], np.random.default_rng(3).normal(size=N))
    residual -= residual.mean()

    def correlation(values: np.ndarray) -> float:
        return float(values[30:] @ values[:-30] / (values @ values))

    kept = [correlation(draw) for draw in drawn(residual, 50).T]
    assert np.mean(kept) > 0.8 * correlation(residual)


def test_a_slow_column_meets_more_independent_draws_than_rotations() -> None:
    """Against a column of a minute's memory, rotations of a drive of 50 min are few; dealt in blocks they are many."""
    rng = np.random.default_rng(4)
    column, residual = (lfilter([1.0], [1.0, -np.exp(-1.0 / 60.0)], rng.normal(size=N)) for _ in range(2))
    shifts = np.sort(rng.integers(60, N - 60, size=400))
    rotated = np.array([np.square(column @ np.roll(residual, shift)) for shift in shifts])
    dealt = np.square(column @ drawn(residual))
    assert effective_number(dealt) > 2.5 * effective_number(rotated)


def test_a_drive_of_a_few_minutes_is_only_rotated() -> None:
    residual = np.random.default_rng(5).normal(size=400)
    for draw in drawn(residual, 20).T:
        shift = int(np.flatnonzero(draw == residual[0])[0])
        np.testing.assert_array_equal(np.roll(draw, -shift), residual)
        assert 60 <= shift <= 340


def test_many_drives_keep_their_rows_and_lose_their_sign() -> None:
    drive = np.repeat(np.arange(MANY_DRIVES), 30)
    residual = np.random.default_rng(6).normal(size=len(drive))
    signs = draw_null(residual, drive, np.random.default_rng(7), 50) / residual[:, None]
    assert set(np.unique(np.round(signs, 9))) == {-1.0, 1.0}
    assert np.ptp(signs.reshape(MANY_DRIVES, 30, 50), axis=1).max() < 1e-9


def test_what_is_shorter_than_a_block_stays_as_it_is() -> None:
    np.testing.assert_array_equal(in_another_order(np.arange(5.0), 300, np.random.default_rng(1)), np.arange(5.0))
    assert len(in_another_order(np.zeros(0), 300, np.random.default_rng(1))) == 0
