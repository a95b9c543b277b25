"""Up to which frequency sampled movement is like real drivers': movement with a planted lack."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.spectra import (
    Verdict,
    alarms_per_hour,
    comparison_band,
    dithered,
    slow_movement,
    verdict_of,
)

STEP = 0.2


def paths(seed: int, *, factor: float = 1.0, above: float = 0.0, count: int = 12) -> list[np.ndarray]:
    """Steady movement whose power above a frequency [Hz] is another by a factor."""
    n = 1500
    hertz = np.fft.rfftfreq(n, STEP)
    density = 0.2 / (1.0 + (hertz / 0.1) ** 4) * np.where(hertz >= above, factor, 1.0)
    rng = np.random.default_rng(seed)
    return [np.fft.irfft(np.fft.rfft(rng.normal(size=n)) * np.sqrt(density / (2.0 * STEP)), n) for _ in range(count)]


def verdict(sampled: list[np.ndarray], valid_below: float | None = None, *, resolution: float = 0.0) -> Verdict:
    real = dithered(paths(0), resolution, 8)
    runs = [
        Run(f"d{k}", 0, STEP * np.arange(len(path)), path, np.full(len(path), 3.5), valid_below=valid_below)
        for k, path in enumerate(real)
    ]
    return verdict_of(runs, dithered(sampled, resolution, 9), [run.drive for run in runs], STEP)


def test_movement_of_the_same_spectrum_is_like_real_drivers() -> None:
    found = verdict(paths(1))
    assert found.like_up_to == 1.5 and all(band.ratio == pytest.approx(1.0, abs=0.3) for band in found.bands)
    assert found.in_words() == "power like other real drivers' up to 1.5 Hz, all that is compared"


@pytest.mark.parametrize(("factor", "side"), [(0.2, "below"), (5.0, "above")])
def test_the_frequency_is_named_from_which_on_power_lacks(factor: float, side: str) -> None:
    found = verdict(paths(1, factor=factor, above=0.32))
    assert found.like_up_to == pytest.approx(0.32)
    words = found.in_words()
    assert words.startswith(f"power like other real drivers' up to 0.32 Hz, {side} theirs from 0.32 Hz on (")
    ratio = next(band.ratio for band in found.bands if not band.is_like)
    assert ratio == pytest.approx(factor, rel=0.3)


def test_only_what_the_recording_shows_is_compared() -> None:
    found = verdict(paths(1, factor=0.01, above=0.2), valid_below=0.16)
    assert found.in_words() == "power like other real drivers' up to 0.16 Hz, all that is compared"
    assert "the recording shows too little for any" in found.alarm_words()
    assert not found.shows_alarms and verdict(paths(1), valid_below=0.5).shows_alarms


def test_what_is_finer_than_the_resolution_is_no_difference() -> None:
    """Movement above 0.7 Hz is some tenths of a millimetre to a centimetre here; seen to 0.3 m none of it shows."""
    lacking = paths(1, factor=1e-4, above=0.7)
    assert verdict(lacking).like_up_to == 0.7
    assert verdict(lacking, resolution=0.3).like_up_to == 1.5


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
