"""Up to which frequency sampled movement is like real drivers': movement with a planted lack."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.spectra import (
    ALIKE,
    DRIVER,
    NOT_KNOWN,
    RECORDING,
    UNLIKE,
    Verdict,
    alarms_per_hour,
    comparison_band,
    dithered,
    judged,
    slow_movement,
    verdict_of,
)

STEP = 0.2


def paths(seed: int, *, factor: float = 1.0, above: float = 0.0, count: int = 40) -> list[np.ndarray]:
    """Steady movement whose power above a frequency [Hz] is another by a factor."""
    n = 1500
    hertz = np.fft.rfftfreq(n, STEP)
    density = 0.2 / (1.0 + (hertz / 0.1) ** 4) * np.where(hertz >= above, factor, 1.0)
    rng = np.random.default_rng(seed)
    return [np.fft.irfft(np.fft.rfft(rng.normal(size=n)) * np.sqrt(density / (2.0 * STEP)), n) for _ in range(count)]


def verdict(
    sampled: list[np.ndarray], valid_below: float = np.inf, *, resolution: float = 0.0, noise: float = 0.0
) -> Verdict:
    """Of 40 drives; with white noise [m] on both sides."""
    rng = np.random.default_rng(5)
    real = dithered([path + noise * rng.normal(size=len(path)) for path in paths(0)], resolution, 8)
    errors = [noise * rng.normal(size=len(path)) for path in sampled]
    groups = [f"d{k}" for k in range(len(real))]
    return verdict_of(real, [(dithered(sampled, resolution, 9), errors)], groups, STEP, valid_below)


def test_movement_of_the_same_spectrum_is_like_real_drivers() -> None:
    found = verdict(paths(1))
    assert found.like_up_to() == found.like_up_to(DRIVER) == 1.5
    assert found.judged(DRIVER) == found.judged(RECORDING) == ALIKE
    for one in found.ratios:
        assert one.interval[0] < 1.0 < one.interval[1] or abs(np.log(one.ratio)) < 0.3
    assert found.in_words().startswith("driver like other real drivers, power alike up to 1.5 Hz, all that is compared")


@pytest.mark.parametrize("factor", [0.2, 0.5, 2.0, 3.0])
def test_the_frequency_is_named_from_which_on_power_lacks(factor: float) -> None:
    found = verdict(paths(1, factor=factor, above=0.32))
    assert found.like_up_to() == 0.32 and found.judged(DRIVER) == UNLIKE
    assert found.in_words().startswith("driver unlike other real drivers, power alike up to 0.32 Hz:")
    ratio = next(one.ratio for one in found.ratios if one.judged == UNLIKE and one.of == RECORDING)
    assert ratio == pytest.approx(factor, rel=0.3)


def test_what_leaks_into_the_band_below_is_never_taken_for_a_difference() -> None:
    """Five times the power above 0.32 Hz is 1.5 times as much just below it, through windows of 25.6 s."""
    found = verdict(paths(1, factor=5.0, above=0.32))
    below = {one.low: one for one in found.ratios if one.of == RECORDING and one.high <= 0.32}
    assert 1.35 < below[0.25].ratio < 1.6 and below[0.25].judged == NOT_KNOWN
    assert found.like_up_to() == 0.25 and found.judged(DRIVER) == UNLIKE


def test_few_drives_show_nothing_and_are_not_taken_for_like() -> None:
    """A ratio of 0.47 +- 0.45 is no likeness."""
    real, made = paths(0, count=3), paths(1, count=3)
    found = verdict_of(real, [(made, [np.zeros(len(path)) for path in made])], ["a", "b", "c"], STEP)
    assert found.judged(DRIVER) == found.judged(RECORDING) == NOT_KNOWN
    assert [judged(0.2, 1.1), judged(0.7, 1.4), judged(1.6, 3.0), judged(0.1, 0.6)] == [
        NOT_KNOWN, ALIKE, UNLIKE, UNLIKE,
    ]  # fmt: skip


def test_what_the_sensor_hides_is_its_own_and_not_the_drivers() -> None:
    """Noise of 5 cm is above the movement from 0.4 Hz on: no driver is judged there, by whatever he does."""
    restless = paths(1, factor=3.0, above=0.7)
    found = verdict(restless, noise=0.05)
    assert found.judged(DRIVER) == ALIKE and 0.2 < found.like_up_to(DRIVER) < 0.7
    causes = {one.low: one.cause for one in found.ratios if one.of == RECORDING}
    assert causes[0.04] == DRIVER and causes[1.0] == "sensor"
    assert verdict(restless).judged(DRIVER) == UNLIKE


def test_only_what_the_recording_shows_is_compared() -> None:
    found = verdict(paths(1, factor=0.01, above=0.2), 0.16)
    assert found.like_up_to() == 0.16 and found.judged(DRIVER) == ALIKE
    assert "the recording shows too little for any" in found.alarm_words()
    assert not found.shows_alarms and verdict(paths(1), 0.5).shows_alarms


def test_what_is_finer_than_the_resolution_is_no_difference() -> None:
    """Movement above 0.7 Hz is some tenths of a millimetre to a centimetre here; seen to 0.3 m none of it shows."""
    lacking = paths(1, factor=1e-4, above=0.7)
    assert verdict(lacking).like_up_to() == 0.7
    assert verdict(lacking, resolution=0.3).like_up_to() == 1.5


def test_alarms_are_those_that_last() -> None:
    """1 m/s for 0.4 s, for 0.2 s, and to the other side for a second, in 100 s."""
    path = np.zeros(501)
    path[100:] += 0.2
    path[101:] += 0.2
    path[200:] += 0.2
    path[300:305] -= 0.2 * np.arange(1, 6)
    path[305:] -= 1.0
    assert alarms_per_hour([path], STEP, 0.5) == pytest.approx(2 * 36.0)
    assert alarms_per_hour([path], STEP, 1.5) == 0.0
    assert alarms_per_hour([], STEP, 0.5) == 0.0


def test_a_recording_is_compared_below_what_it_is_valid_to() -> None:
    run = Run("d", 0, STEP * np.arange(600), np.zeros(600), np.full(600, 3.5), valid_below=0.1)
    assert comparison_band([run]) == 0.1
    time = STEP * np.arange(3000)
    for hertz, left in ((0.04, 1.0), (0.15, 0.0), (0.3, 0.0)):
        wave = np.sin(2.0 * np.pi * hertz * time)
        assert slow_movement(wave, STEP, 0.1)[1000:2000].std() == pytest.approx(left * wave.std(), abs=0.02)
