"""Tracks made of pieces: found where they are, sampled as they were found."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.records import plain, read_as
from xosc_lateral.driver.sensor.model import SensorModel
from xosc_lateral.driver.sensor.separation import separate
from xosc_lateral.driver.sensor.slope_jumps import SlopeJumps, shape_points
from xosc_lateral.driver.sensor.slope_jumps_fit import find_slope_jumps, jumps_of
from xosc_lateral.drives.filters import scale_frequencies
from xosc_lateral.drives.periodogram import periodograms
from xosc_lateral.drives.resampling import STEP, resample
from xosc_lateral.errors import DriverProfileError

RATE, EVERY, JUMP = 20.0, 1.0, 0.02
WHITE = 2.0 * EVERY * JUMP**2
"""One-sided density of jumps that know nothing of each other. [m2/s2/Hz]"""


def track(
    rng: np.random.Generator,
    jump: float,
    seconds: float = 60.0,
    *,
    every: float = EVERY,
    moved: float = 2.0,
    with_movement: float = 0.0,
) -> np.ndarray:
    """Slow movement in millimetres, whose slope jumps once a second, by more where it bends more."""
    n, size = round(seconds * RATE), round(every * RATE)
    frequency = np.fft.rfftfreq(n, 1.0 / RATE)
    slow = scale_frequencies(rng.normal(size=n), np.where((frequency > 0.0) & (frequency < 0.15), moved, 0.0))
    places = np.arange(int(rng.integers(size)) + 1, n - 1, size)
    steps = np.zeros(n)
    bend = np.gradient(np.gradient(slow, 1.0 / RATE), 1.0 / RATE)
    size_there = np.sqrt(1.0 - with_movement + with_movement * (bend / bend.std()) ** 2)
    steps[places] = jump * size_there[places] * rng.normal(size=len(places))
    bent = np.cumsum(np.cumsum(steps)) / RATE
    bent -= np.polyval(np.polyfit(np.arange(n), bent, 6), np.arange(n))  # it would wander off
    return np.round(slow + bent, 3)


@pytest.fixture(scope="module")
def tracks() -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    return [track(rng, JUMP) for _ in range(40)]


def seen(rows: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    time = np.arange(len(rows[0])) / RATE
    runs = [resample(time, one, np.arange(0.0, time[-1], STEP)) for one in rows]
    density = 2.0 * STEP * np.concatenate([periodograms(run, 128) for run in runs]).mean(axis=0)
    return np.fft.rfftfreq(128, STEP), density, runs


def test_jumps_between_cubics_are_read_exactly():
    size, rng = 20, np.random.default_rng(1)
    time = np.arange(400) / RATE
    jumps = rng.normal(size=19)
    path = 0.3 * time - 0.02 * time**2 + 0.001 * time**3
    for k, jump in enumerate(jumps, start=1):
        path = path + jump * np.maximum(time - k * EVERY, 0.0)
    found, first = jumps_of(path, size, RATE)
    np.testing.assert_allclose(found, jumps, atol=1e-9)
    assert first == size


def test_slope_jumps_are_found_with_their_period_size_and_the_rows_rounding(tracks):
    _, _, runs = seen(tracks)
    slope_jumps, noise = find_slope_jumps(tracks, RATE, runs)
    assert slope_jumps.every == EVERY
    middle = np.array(slope_jumps.densities[2:-2])
    assert middle.mean() == pytest.approx(WHITE, rel=0.1)  # 40 tracks of 58 jumps
    assert noise == pytest.approx(1e-3 / np.sqrt(12.0), rel=0.05)
    assert slope_jumps.level_variance < 0.3  # of 0, with an error of about 0.1


def test_what_makes_slope_jumps_louder_is_found():
    """As loud in all tracks and wherever they bend; louder in some tracks; louder where they bend."""
    rng = np.random.default_rng(8)
    sizes = np.exp(0.5 * np.sqrt(0.6) * rng.normal(size=80))
    made = {
        "even": [track(rng, JUMP) for _ in range(80)],
        "by track": [track(rng, JUMP * size) for size in sizes],
        "by movement": [track(rng, JUMP, moved=10.0, with_movement=0.5) for _ in range(80)],
    }
    found = {}
    for name, rows in made.items():
        _, _, runs = seen(rows)
        found[name], _ = find_slope_jumps(rows, RATE, runs)
    assert found["even"].track_variance < 0.15
    assert found["by track"].track_variance == pytest.approx(np.var(2.0 * np.log(sizes)), abs=0.2)
    assert found["by movement"].track_variance < 0.15
    assert max(found[name].with_movement for name in ("even", "by track")) < 0.12
    assert found["by movement"].with_movement == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("every", [0.8, 1.25])
def test_ideal_slope_jumps_have_an_even_shape_whatever_their_period(every: float):
    rng = np.random.default_rng(11)
    rows = [track(rng, JUMP, every=every) for _ in range(40)]
    slope_jumps, _ = find_slope_jumps(rows, RATE, seen(rows)[2])
    assert slope_jumps.every == every
    points = shape_points(slope_jumps.highest, len(slope_jumps.shape))
    shape = np.array(slope_jumps.shape)[(points > 1.3 * slope_jumps.highest) & (points < 1.45)]
    assert len(shape) >= 2
    assert np.median(shape) == pytest.approx(1.0, abs=0.15)
    assert min(slope_jumps.shape) > 0.0


def test_smooth_tracks_have_none():
    rng = np.random.default_rng(6)
    smooth = [track(rng, 0.0) for _ in range(40)]
    _, _, runs = seen(smooth)
    assert find_slope_jumps(smooth, RATE, runs) is None


def test_rows_too_few_for_pieces_show_none():
    time = np.arange(0.0, 300.0, 0.5)
    assert find_slope_jumps([np.sin(time)], 2.0, [np.sin(np.arange(0.0, 300.0, STEP))]) is None


def test_what_slope_jumps_add_is_the_sensors_above_half_a_slope_jump_a_period_and_no_drivers(tracks):
    frequency, density, runs = seen(tracks)
    split = separate(runs, STEP, rows=tracks, rate=RATE)
    images = (frequency > 0.6) & (frequency < 0.9)
    assert split.driver_share_of(frequency)[images].max() < 1e-9
    known = split.sensor.slope_jumps.density(frequency)
    np.testing.assert_allclose(known[images].mean(), density[images].mean(), rtol=0.1)


def test_sampled_slope_jumps_have_their_density_with_zeros_once_a_period():
    slope_jumps = SlopeJumps(EVERY, (WHITE,) * 5, (0.0,) * 5, 0.5, 5.0)
    rng = np.random.default_rng(2)
    made = [slope_jumps.sample(np.zeros(1000), STEP, rng) for _ in range(60)]
    frequency = np.fft.rfftfreq(200, STEP)
    density = 2.0 * STEP * np.concatenate([periodograms(one, 200) for one in made]).mean(axis=0)
    between = (frequency > 0.65) & (frequency < 0.95) | (frequency > 1.05) & (frequency < 1.45)
    ratio = density[between] / slope_jumps.density(frequency[between])
    np.testing.assert_allclose(np.log(ratio).mean(), 0.0, atol=0.1)
    slow = (frequency > 0.25) & (frequency < 0.4)
    expected = WHITE / EVERY**2 / (2.0 * np.pi * frequency[slow]) ** 4
    np.testing.assert_allclose(np.log(density[slow] / expected).mean(), 0.0, atol=0.1)
    assert density[frequency < 0.05].max() < density[slow].max()


def test_the_shape_is_a_factor_on_what_is_sampled_above_half_a_slope_jump_a_period():
    points = shape_points(0.5 / EVERY, 21)
    shape = tuple(np.where(points > 1.0, 0.25, 1.0).tolist())
    slope_jumps = SlopeJumps(EVERY, (WHITE,) * 5, (0.0,) * 5, 0.0, 5.0, shape=shape)
    made = slope_jumps.sample(np.zeros(30_000), STEP, np.random.default_rng(4))
    frequency, density = np.fft.rfftfreq(200, STEP), 2.0 * STEP * periodograms(made, 200).mean(axis=0)
    for band in ((0.65, 0.95), (1.15, 1.45)):
        inside = (frequency > band[0]) & (frequency < band[1])
        assert np.log(density[inside] / slope_jumps.density(frequency[inside])).mean() == pytest.approx(0.0, abs=0.1)
    bare = SlopeJumps(EVERY, (WHITE,) * 5, (0.0,) * 5, 0.0, 5.0).density(frequency)
    np.testing.assert_allclose(slope_jumps.density(frequency)[inside], 0.25 * bare[inside])


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, 0.7, 1.4), (0.6, 2.0, 20.0)])
def test_slope_jumps_are_louder_where_the_sampled_path_bends(share: float, least: float, most: float):
    """Ten seconds straight, ten seconds of a wave, and so on: power above half a jump a period of the one and other."""
    slope_jumps = SlopeJumps(EVERY, (WHITE,) * 5, (0.0,) * 5, 0.0, 5.0, with_movement=share, acceleration=0.05)
    time = STEP * np.arange(20_000)
    wave = np.sin(0.5 * np.pi * time) * np.clip(4.0 * np.sin(0.1 * np.pi * time), 0.0, 1.0)
    path = 0.1 / np.std(np.diff(wave, 2) / STEP**2) * wave
    tracked = path + slope_jumps.sample(path, STEP, np.random.default_rng(7))
    frequency = np.fft.rfftfreq(len(tracked), STEP)
    fast = scale_frequencies(tracked, np.where((frequency > 0.65) & (frequency < 1.45), 1.0, 0.0))
    bends = np.sin(0.1 * np.pi * time) > 0.3
    straight = np.sin(0.1 * np.pi * time) < -0.3
    assert least < (fast[bends] ** 2).mean() / (fast[straight] ** 2).mean() < most


def test_a_path_gives_up_what_the_slope_jumps_have_in_it():
    """All of a wave of 0.3 Hz is theirs: it makes room. Slower than 0.1 Hz, and of another's, nothing is touched."""
    theirs = SlopeJumps(EVERY, (0.0,) * 5, (1.0,) * 5, 0.0, 5.0)
    others = SlopeJumps(EVERY, (0.0,) * 5, (0.0,) * 5, 0.0, 5.0)
    time = STEP * np.arange(3000)
    slow, wave = np.cos(2.0 * np.pi * 0.05 * time), np.cos(2.0 * np.pi * 0.3 * time)
    middle = slice(500, 2500)
    rng = np.random.default_rng(0)
    path = slow + wave
    np.testing.assert_allclose((path + theirs.sample(path, STEP, rng))[middle], slow[middle], atol=0.02)
    np.testing.assert_allclose((path + others.sample(path, STEP, rng))[middle], path[middle], atol=0.02)
    assert np.abs(theirs.sample(path, STEP, rng)[[0, -1]]).max() < 1e-9  # and its ends stay where they are


def test_power_below_half_a_slope_jump_a_period_is_the_paths_and_as_loud_as_the_images():
    """What is drawn stands for what was given up, and loud slope jumps are loud at all frequencies."""
    rng = np.random.default_rng(3)
    density = 2.0 * WHITE / EVERY**2 / (2.0 * np.pi * 0.3) ** 4
    slope_jumps = SlopeJumps(EVERY, (WHITE,) * 5, (0.5,) * 5, 1.5, 10.0)
    frequency = np.fft.rfftfreq(6000, STEP)
    band = (frequency > 0.28) & (frequency < 0.32)
    whole, near, far = [], [], []
    for _ in range(16):
        gain = np.where(band, np.sqrt(density / (2.0 * STEP)), 0.0)
        path = scale_frequencies(rng.normal(size=6000), gain)
        pieces = (path + slope_jumps.sample(path, STEP, rng))[500:5500].reshape(-1, 100)
        powers = np.abs(np.fft.rfft(pieces * np.hanning(100), axis=1)) ** 2
        at = np.fft.rfftfreq(100, STEP)
        near.append(np.log(powers[:, (at > 0.33) & (at < 0.45)].sum(axis=1)))
        far.append(np.log(powers[:, (at > 1.05) & (at < 1.45)].sum(axis=1)))
        one = np.abs(np.fft.rfft(path + slope_jumps.sample(path, STEP, rng))) ** 2
        whole.append(one[band].sum() / (np.abs(np.fft.rfft(path)) ** 2)[band].sum())
    assert np.mean(whole) == pytest.approx(1.0, abs=0.1)
    assert np.corrcoef(np.concatenate(near), np.concatenate(far))[0, 1] > 0.3


def test_slope_jumps_are_kept_in_files_and_checked():
    slope_jumps = SlopeJumps(EVERY, (1e-3, 2e-3), (0.1, 0.2), 0.5, 5.0, 0.2, 0.3, 0.04, (1.0, 0.9))
    sensor = SensorModel(white=1e-8, slope_jumps=slope_jumps)
    assert read_as(SensorModel, plain(sensor)) == sensor
    for wrong in ((0.0, (1.0, 1.0), (0.1, 0.1)), (1.0, (1.0,), (0.1,)), (1.0, (1.0, 1.0), (0.1, 2.0))):
        with pytest.raises(DriverProfileError, match="slope jumps"):
            SlopeJumps(*wrong, 0.5, 5.0)
    for other in ({"track_variance": -0.1}, {"with_movement": 1.1}, {"acceleration": 0.0}, {"shape": (np.nan,)}):
        with pytest.raises(DriverProfileError, match="slope jumps"):
            SlopeJumps(1.0, (1.0, 1.0), (0.1, 0.1), 0.5, 5.0, **other)
