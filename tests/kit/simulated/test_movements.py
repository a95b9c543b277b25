"""Movements that no driver model made: what each claims of itself, measured; and the tables that record them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal, stats

from examples.driver_simulator.motorway import STEP
from tests.kit.simulated import movements
from tests.kit.simulated.movements import MOVEMENT_STEP, Movement, record_movement

N = round(3600.0 / MOVEMENT_STEP)

PLAIN: dict[str, Movement] = {
    name: getattr(movements, name)
    for name in (
        "ornstein_uhlenbeck",
        "heavy_tailed",
        "reflected",
        "delayed_control",
        "clustered",
        "bursts",
        "lopsided",
        "pursuit",
        "oscillating",
        "sawtooth",
        "long_memory",
        "free_play",
        "zigzag",
        "rate_limited",
        "in_regimes",
    )
}


def moved(name: str, seed: int = 1, n: int = N) -> np.ndarray:
    return PLAIN[name](n, np.random.default_rng(seed))


def correlation(values: np.ndarray, seconds: float) -> float:
    lag = round(seconds / MOVEMENT_STEP)
    left = values - values.mean()
    return float(left[lag:] @ left[:-lag] / (left @ left))


# ---- what all of them are --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", PLAIN)
def test_a_car_moves_by_as_much_as_people_drive_and_never_at_once(name: str) -> None:
    """SDLP is 0.1 to 0.35 m on roads; a car that is steered does not get aside faster than 1 m/s."""
    path = moved(name)
    assert path.shape == (N,)
    assert 0.08 < path.std() < 0.45
    assert abs(path.mean()) < 0.2
    assert np.abs(np.diff(path)).max() / MOVEMENT_STEP < 1.5


@pytest.mark.parametrize("name", PLAIN)
def test_another_generator_is_another_path_and_the_same_is_the_same(name: str) -> None:
    np.testing.assert_array_equal(moved(name, 5, 3000), moved(name, 5, 3000))
    assert np.abs(moved(name, 5, 3000) - moved(name, 6, 3000)).max() > 0.05


# ---- what each claims ------------------------------------------------------------------------------------------------
def test_the_ordinary_one_forgets_within_seconds_and_keeps_a_part_for_a_minute() -> None:
    path = moved("ornstein_uhlenbeck")
    slow = 0.12**2 / (0.12**2 + 0.15**2)
    assert correlation(path, 20.0) == pytest.approx(slow * np.exp(-20.0 / 60.0), abs=0.12)
    assert correlation(path, 0.5) > 0.9


def test_pushes_with_heavy_tails_reach_further_than_normal_ones() -> None:
    change = np.diff(moved("heavy_tailed"))
    assert stats.kurtosis(change) > 1.0
    assert abs(stats.kurtosis(np.diff(moved("ornstein_uhlenbeck")))) < 0.3


def test_the_reflected_one_is_hardly_ever_far_beyond_its_tolerance() -> None:
    path = moved("reflected")
    assert np.abs(path).max() < 0.35 + 0.15
    assert (np.abs(path) > 0.3).mean() > 0.01


def test_the_oscillating_one_has_its_line_at_14_s_and_the_ordinary_none_there() -> None:
    frequency, power = signal.welch(moved("oscillating"), fs=1.0 / MOVEMENT_STEP, nperseg=4096)
    inside = frequency > 1.0 / 40.0
    assert 1.0 / frequency[inside][np.argmax(power[inside])] == pytest.approx(14.0, rel=0.15)


@pytest.mark.parametrize("name", ["clustered", "bursts", "in_regimes"])
def test_loudness_that_comes_and_goes_shows_in_the_squares_and_hardly_in_the_path(name: str) -> None:
    """Squares of what can't be predicted go together over seconds; of the ordinary movement they don't."""
    together = {}
    for one in (name, "ornstein_uhlenbeck"):
        path = moved(one)[::10]
        lags = np.stack([path[3 - k : len(path) - k] for k in (1, 2, 3)], axis=1)
        left = path[3:] - lags @ np.linalg.lstsq(lags, path[3:], rcond=None)[0]
        squares = np.log(left**2 + 1e-8)
        together[one] = np.corrcoef(squares[1:], squares[:-1])[0, 1]
    assert together[name] > 0.08
    assert abs(together["ornstein_uhlenbeck"]) < 0.06


def test_the_lopsided_one_is_pushed_to_one_side_seldom_and_far() -> None:
    assert stats.skew(np.diff(moved("lopsided"))) > 0.2
    assert abs(stats.skew(np.diff(moved("ornstein_uhlenbeck")))) < 0.1


def test_the_long_one_is_the_sum_of_six_that_forget_within_seconds_to_minutes() -> None:
    expected = np.mean([np.exp(-60.0 / time) for time in (1.0, 3.0, 8.0, 20.0, 60.0, 200.0)])
    found = np.mean([correlation(moved("long_memory", seed), 60.0) for seed in range(8)])
    assert found == pytest.approx(expected, abs=0.06)
    assert np.mean([correlation(moved("heavy_tailed", seed), 60.0) for seed in range(8)]) == pytest.approx(
        0.0, abs=0.06
    )


def test_a_sawtooth_goes_away_slowly_and_comes_back_quickly() -> None:
    """Who moves fastest of all goes back to the middle; in the ordinary movement either way is as quick."""
    share = {}
    for name in ("sawtooth", "heavy_tailed"):
        path = moved(name)[::10]
        speed, away = np.diff(path), np.sign(0.5 * (path[1:] + path[:-1]))
        fastest = np.abs(speed) > np.quantile(np.abs(speed), 0.97)
        share[name] = (np.sign(speed) != away)[fastest].mean()
    assert share["sawtooth"] > 0.85
    assert share["heavy_tailed"] == pytest.approx(0.5, abs=0.2)


def test_regimes_are_loud_for_a_minute_and_quiet_for_two() -> None:
    """By the spread in windows of 20 s: two clusters, a factor of more than 1.5 apart."""
    path = moved("in_regimes", n=4 * N)
    windows = path[: len(path) // 200 * 200].reshape(-1, 200)
    spread = np.log((windows - windows.mean(axis=1, keepdims=True)).std(axis=1))
    ordinary = moved("heavy_tailed", n=4 * N)
    steady = ordinary[: len(ordinary) // 200 * 200].reshape(-1, 200)
    steady = np.log((steady - steady.mean(axis=1, keepdims=True)).std(axis=1))
    assert spread.std() > 1.3 * steady.std()
    assert np.corrcoef(spread[1:], spread[:-1])[0, 1] > 0.3


def test_who_is_held_harder_strays_less_and_comes_back_sooner() -> None:
    free, tight = (movements.held(N, np.random.default_rng(3), np.full(N, strength)) for strength in (0.0, 1.0))
    assert free.std() > 3.0 * tight.std()
    assert correlation(free, 5.0) == pytest.approx(np.exp(-0.05 * 5.0), abs=0.08)
    assert correlation(tight, 5.0) < 0.1


# ---- tables ----------------------------------------------------------------------------------------------------------
def test_the_table_has_the_movement_and_a_context_that_knows_nothing_of_it() -> None:
    table = record_movement(PLAIN["ornstein_uhlenbeck"], 600.0, 4)
    width = (table["distance_left"] + table["distance_right"]).to_numpy()
    offset = ((table["distance_right"] - table["distance_left"]) / 2.0).to_numpy()
    assert 3.0 < np.median(width) < 4.0
    steady = np.abs(offset) < 1.0  # lane changes apart
    assert 0.05 < offset[steady].std() < 0.4


def test_the_context_is_the_same_whatever_moves_the_car() -> None:
    one, other = (record_movement(PLAIN[name], 120.0, 4) for name in ("ornstein_uhlenbeck", "oscillating"))
    same = [name for name in one if name not in ("distance_left", "distance_right", "lane_index")]
    assert {"grade", "rain", "truck_right", "wind_speed", "crossfall"} <= set(same)
    for name in same:
        np.testing.assert_array_equal(one[name], other[name], name)


def test_a_camera_of_five_centimetres_reads_multiples_of_five_centimetres() -> None:
    plain, coarse = (record_movement(PLAIN["reflected"], 120.0, 4, resolution=size) for size in (None, 0.05))
    for side in ("distance_left", "distance_right"):
        np.testing.assert_allclose(coarse[side] / 0.05, np.rint(coarse[side] / 0.05), atol=1e-9)
        assert np.abs(coarse[side] - plain[side]).max() <= 0.025 + 1e-3
    assert len(np.unique(plain["distance_left"])) > 3 * len(np.unique(coarse["distance_left"]))


def test_a_movement_is_told_of_a_column_where_that_is_asked_for() -> None:
    told = []

    def note(n: int, rng: np.random.Generator, strength: np.ndarray) -> np.ndarray:
        told.append(strength)
        return np.zeros(n)

    record_movement(note, 60.0, 1, told_of="grade")
    assert told[0].shape == (round(60.0 / MOVEMENT_STEP) + 1,) or abs(len(told[0]) - 60.0 / MOVEMENT_STEP) <= 2
    assert (told[0].min(), told[0].max()) == pytest.approx((0.0, 1.0), abs=0.02)


def test_the_grid_of_movements_is_coarser_than_that_of_the_road() -> None:
    assert pytest.approx(5.0) == MOVEMENT_STEP / STEP


def test_who_is_rate_limited_goes_as_fast_as_he_does_or_hardly_at_all() -> None:
    """Speeds that are bounded have thinner tails than normal ones: excess kurtosis -1.2 where all are as frequent."""
    path, away = moved("rate_limited"), round(3.0 / MOVEMENT_STEP)
    assert stats.kurtosis((path[away:] - path[:-away]) / 3.0) < -0.7
