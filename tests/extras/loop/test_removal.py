"""Effects taken out of measured movement: what is left is the movement without them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from xosc_lateral.drivers.model.effects import Acts
from xosc_lateral.extras.loop.held_out import movement_without, runs_without
from xosc_lateral.extras.loop.timeline import Timeline

STEP = 0.2
N = 6000


def timeline(offset: np.ndarray, valid: np.ndarray | None = None, drives: int = 1) -> Timeline:
    n = len(offset)
    valid = np.ones(n, dtype=bool) if valid is None else valid
    names = tuple(f"d{k}" for k in range(drives))
    drive = np.repeat(np.arange(drives), n // drives).astype(np.intp)
    return Timeline(names, drive, STEP * np.arange(n), offset, valid, np.full(n, 3.5), {}, frozenset())


def removal(**parts: np.ndarray) -> dict[Acts, np.ndarray]:
    return {acts: parts.get(acts.value, np.zeros(N)) for acts in Acts}


def movement(seed: int = 1, seconds: float = 6.0) -> np.ndarray:
    keep = np.exp(-STEP / seconds)
    noise = np.random.default_rng(seed).normal(size=N)
    return 0.2 * np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], noise))


def test_without_effects_nothing_is_taken_out() -> None:
    offset = 0.3 + movement()
    left = movement_without(timeline(offset), removal(), slice(0, N))
    np.testing.assert_allclose(left, offset, atol=1e-12)


def test_a_shift_is_taken_out_in_full() -> None:
    own = movement()
    shift = 0.25 * (np.arange(N) % 500 > 300)
    left = movement_without(timeline(own + shift), removal(location=shift), slice(0, N))
    np.testing.assert_allclose(left, own, atol=1e-12)


def test_a_spread_is_taken_out_about_the_mean() -> None:
    own = movement()
    factor = np.full(N, np.log(1.7))
    offset = 0.3 + 1.7 * (own - own.mean())
    left = movement_without(timeline(offset), removal(spread=factor, fine=factor), slice(0, N))
    np.testing.assert_allclose(left, 0.3 + own - own.mean(), atol=1e-12)


def test_fine_movement_has_a_factor_of_its_own() -> None:
    """A second's moving average parts them: a sine of 20 s is slow, noise from sample to sample is mostly fine."""
    slow = 0.2 * np.sin(2.0 * np.pi * STEP * np.arange(N) / 20.0)
    fine = 0.01 * np.random.default_rng(2).normal(size=N)
    left = movement_without(timeline(slow + 3.0 * fine), removal(fine=np.full(N, np.log(3.0))), slice(0, N))
    inside = slice(20, -20)
    roughness = np.diff(left[inside], 2).std() / np.diff(slow + fine, 2)[inside].std()
    assert roughness == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose((left - slow)[inside].mean(), 0.0, atol=2e-3)


def test_runs_are_the_stretches_that_are_long_enough() -> None:
    valid = np.ones(N, dtype=bool)
    valid[1000:1050] = valid[1055:1100] = False  # a second between two gaps is no run
    runs = runs_without(timeline(movement(), valid), removal(), np.ones(N, dtype=bool))
    assert [len(run.offset) for run in runs] == [1000, N - 1100]
    assert runs[1].time[0] == pytest.approx(1100 * STEP)
    assert {run.drive for run in runs} == {"d0"}


def test_runs_do_not_cross_drives_or_rows_that_are_not_used() -> None:
    used = np.ones(N, dtype=bool)
    used[: N // 4] = False
    runs = runs_without(timeline(movement(), drives=2), removal(), used)
    assert [(run.drive, len(run.offset)) for run in runs] == [("d0", N // 4), ("d1", N // 2)]
