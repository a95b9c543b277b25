"""Small steps between the 0.2 s grid and seconds, each against the plain way to write it."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.drivers.drives.drive import Drive, in_digits
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.autocorrelation import moving_sum, positions_in_run
from xosc_lateral.extras.loop.timeline import (
    Coarse,
    coarse_all,
    coarse_mean,
    coarse_middle,
    join_drives,
    local_mean,
    on_fine_grid,
)

STEP, COARSE = 0.2, 5
flags = st.lists(st.booleans(), min_size=1, max_size=60).map(np.array)


def numbers(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=n)


@pytest.mark.parametrize("n", [5, 23, 100])
def test_seconds_are_means_and_middles_of_five_rows(n: int) -> None:
    values = numbers(n)
    seconds = [values[5 * k : 5 * k + 5] for k in range(n // 5)]
    np.testing.assert_allclose(coarse_mean(values), [second.mean() for second in seconds])
    np.testing.assert_array_equal(coarse_middle(values), [second[2] for second in seconds])
    np.testing.assert_array_equal(coarse_all(values > -1.0), [bool((second > -1.0).all()) for second in seconds])


def test_columns_side_by_side_are_averaged_each_by_itself() -> None:
    values = numbers(50).reshape(25, 2)
    np.testing.assert_allclose(coarse_mean(values)[:, 1], coarse_mean(values[:, 1]))


@pytest.mark.parametrize("n", [12, 25, 53])
def test_seconds_become_rows_again_by_straight_lines_between_their_middles(n: int) -> None:
    seconds = numbers(n // 5)
    grid: Any = np.empty(n)  # its length alone counts
    middles = COARSE * np.arange(len(seconds)) + 2.0
    np.testing.assert_allclose(on_fine_grid(seconds, grid), np.interp(np.arange(n), middles, seconds))


def test_a_slope_survives_the_way_to_seconds_and_back() -> None:
    slope = 0.01 * np.arange(200.0)
    np.testing.assert_allclose(on_fine_grid(coarse_mean(slope), cast(Any, slope))[2:-3], slope[2:-3])


@given(flags, st.floats(0.2, 6.0))
def test_local_means_count_valid_rows_alone(valid: np.ndarray, seconds: float) -> None:
    values, half = numbers(len(valid)), max(1, round(0.5 * seconds / STEP))
    expected = []
    for k in range(len(valid)):
        near = slice(max(k - half, 0), k + half + 1)
        inside = values[near][valid[near]]
        expected.append(inside.mean() if len(inside) else 0.0)
    np.testing.assert_allclose(local_mean(values, valid, seconds), expected, atol=1e-12)


@given(flags)
def test_means_of_drives_count_valid_rows_alone(valid: np.ndarray) -> None:
    values, drive = numbers(len(valid)), np.sort(np.random.default_rng(1).integers(0, 3, len(valid))).astype(np.intp)
    expected = []
    for index in range(int(drive.max()) + 1):
        inside = values[valid & (drive == index)]
        expected.append(inside.mean() if len(inside) else 0.0)
    coarse = Coarse(None, values, valid, drive, values, {})  # type: ignore[arg-type]
    np.testing.assert_allclose(coarse.by_drive(values), expected, atol=1e-12)


@given(flags)
def test_places_in_a_run_count_from_its_beginning(valid: np.ndarray) -> None:
    expected, count = [], 0
    for flag in valid:
        expected.append(count if flag else -1)
        count = count + 1 if flag else 0
    np.testing.assert_array_equal(positions_in_run(valid), expected)


@pytest.mark.parametrize("taps", [1, 3, 16, 17, 60])
@pytest.mark.parametrize("columns", [None, 1, 3])
def test_moving_sums_are_convolutions_that_begin_with_nothing(taps: int, columns: int | None) -> None:
    """Seventeen weights and more go through Fourier transforms."""
    weights = numbers(taps, 1)
    values = numbers(80) if columns is None else numbers(80 * columns).reshape(80, columns)
    paths = values.reshape(80, -1).T
    expected = np.stack([np.convolve(path, weights)[:80] for path in paths], axis=1).reshape(values.shape)
    np.testing.assert_allclose(moving_sum(weights, values), expected, atol=1e-12)
    assert moving_sum(weights, np.empty((80, 0))).shape == (80, 0)


# ---- drives, joined --------------------------------------------------------------------------------------------------
def drive(name: str, seconds: float, **context: np.ndarray) -> Drive:
    time = np.arange(0.0, seconds, STEP)
    n = len(time)
    held = {"lane_width": np.full(n, 3.5), "speed": np.full(n, 30.0), **{key: v[:n] for key, v in context.items()}}
    return Drive(name, time, 0.1 * np.sin(time), np.full(n, 3.5), held, frozenset(), "made")


def test_joined_drives_keep_their_own_rows_and_clocks() -> None:
    joined = join_drives([drive("a", 300.0), drive("b", 200.0)])
    assert joined.names == ("a", "b")
    for index, span in enumerate(joined.spans):
        assert set(joined.drive[span]) == {index}
        inside = joined.valid[span]
        assert inside.sum() * STEP > 0.9 * (300.0, 200.0)[index]
        np.testing.assert_allclose(joined.offset[span][inside], 0.1 * np.sin(joined.time[span][inside]), atol=2e-3)
    assert not joined.offset[~joined.valid].any()


def test_a_column_that_one_drive_lacks_is_there_and_says_there_is_none() -> None:
    rain = np.linspace(0.0, 5.0, 2000)
    joined = join_drives([drive("a", 300.0, rain=rain), drive("b", 200.0)])
    assert np.isfinite(joined.context["rain"][joined.drive == 0]).all()
    assert np.isnan(joined.context["rain"][joined.valid & (joined.drive == 1)]).all()


def test_equal_numbers_that_were_averaged_are_equal() -> None:
    values = np.array([3.7, 3.7 + 4e-16, 3.7 - 9e-16, 3.85, np.nan])
    rounded = in_digits(values)
    assert len(np.unique(rounded[:3])) == 1
    assert rounded[3] == pytest.approx(3.85, abs=1e-12)
    assert np.isnan(rounded[4])
    assert in_digits(np.zeros(2)) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("lag_s", [-4.2, 0.0, 1.5])
@pytest.mark.parametrize("response_s", [0.0, 2.0, 60.0])
def test_a_drive_responds_to_nothing_that_another_drive_met(lag_s: float, response_s: float) -> None:
    rng = np.random.default_rng(3)
    made = [_drive(f"drive-{index}", rng.normal(10.0 * index, 1.0, size=500)) for index in range(4)]
    timeline = join_drives(made)
    effect = Linear(acts=Acts.LOCATION, column="speed", lag_s=lag_s, response_s=response_s)
    joined = timeline.respond(effect.known(timeline.context), lag_s, response_s)
    for span in timeline.spans:
        alone = effect.response(STEP, {"speed": timeline.context["speed"][span]})
        inside = timeline.valid[span]
        np.testing.assert_allclose(joined[span][inside], alone[inside], rtol=0.0, atol=1e-9)


def _drive(name: str, speed: np.ndarray) -> Drive:
    n = len(speed)
    return Drive(
        name=name,
        time=STEP * np.arange(n),
        offset=0.1 * np.sin(np.arange(n)),
        lane_width=np.full(n, 3.6),
        context={"speed": speed},
        levels=frozenset(),
    )
