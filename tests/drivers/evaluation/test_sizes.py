"""What two profiles are told apart by: how sure it is, and what as much driving would show."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.evaluation.sizes import (
    QUANTITIES,
    SIGNIFICANCE_LEVEL,
    SLOW_S,
    Sizes,
    differences,
    sizes_of_runs,
    sizes_of_samples,
)

STEP, MEMORY_S, DEVIATION = 0.2, 10.0, 0.2


def wander(seed: int, seconds: float = 3000.0) -> np.ndarray:
    """A first-order autoregression of known memory and deviation."""
    from scipy.signal import lfilter

    keep = np.exp(-STEP / MEMORY_S)
    noise = np.random.default_rng(seed).normal(size=round(seconds / STEP)) * DEVIATION * np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], noise))


def drive(name: str, offset: np.ndarray, *, valid_below: float | None = None) -> Run:
    width = np.full(len(offset), 3.5)
    return Run(name, 0, STEP * np.arange(len(offset)), offset, width, valid_below=valid_below)


def two_drives(seed: int, *, scale: float = 1.0, shift: float = 0.0) -> Sizes:
    return sizes_of_runs([drive(f"d{k}", scale * wander(2 * seed + k) + shift) for k in range(2)], STEP)


def test_the_error_of_the_mean_is_that_of_a_process_whose_error_is_known() -> None:
    expected = DEVIATION * np.sqrt(2.0 * MEMORY_S / 6000.0)
    sizes = [two_drives(seed) for seed in range(20)]
    scatter = float(np.std([one.values[0] for one in sizes]))
    stated = float(np.sqrt(np.mean([one.errors[0] ** 2 for one in sizes])))
    assert scatter == pytest.approx(expected, rel=0.35)
    assert expected < stated < 1.6 * expected  # the larger one of two estimates


def test_ten_per_cent_and_a_hand_are_told_apart_and_the_same_driver_is_not() -> None:
    pairs = 20
    same, wide, left = (
        [differences(two_drives(seed), two_drives(100 + seed, **change)) for seed in range(pairs)]
        for change in ({}, {"scale": 1.1}, {"shift": 0.12})
    )
    told = [
        sum(min(part.p_value for part in parts) <= SIGNIFICANCE_LEVEL for parts in case) for case in (same, wide, left)
    ]
    assert told[0] <= 3  # a binomial of 5 % is above 3 of 20 in 2 % of cases
    assert told[1] >= 18
    assert told[2] >= 18


def test_the_least_difference_is_found_in_four_of_five_cases() -> None:
    parts = differences(two_drives(0), two_drives(1))
    mean = parts[0]
    rng = np.random.default_rng(0)
    drawn = mean.least + mean.error * rng.normal(size=4000)
    limit = mean.error * 2.394  # two-sided, 5 % over three quantities
    assert np.mean(np.abs(drawn) > limit) == pytest.approx(0.8, abs=0.02)


def test_drives_that_differ_among_themselves_say_less() -> None:
    alike = sizes_of_runs([drive("a", wander(0)), drive("b", wander(1))], STEP)
    apart = sizes_of_runs([drive("a", wander(0) - 0.3), drive("b", wander(1) + 0.3)], STEP)
    assert apart.errors[0] > 5.0 * alike.errors[0]


def test_movement_that_a_recording_does_not_show_is_not_compared() -> None:
    seen = two_drives(0)
    slow = sizes_of_runs([drive("a", wander(2), valid_below=0.3), drive("b", wander(3), valid_below=0.3)], STEP)
    assert [part.quantity for part in differences(seen, slow)] == list(QUANTITIES[:2])
    assert set(slow.to_dict()) == set(QUANTITIES[:2])


def test_slow_and_fast_movement_are_those_of_a_sine() -> None:
    time = STEP * np.arange(15000)
    slow, fast = 0.3 * np.sin(2 * np.pi * time / 60.0), 0.1 * np.sin(2 * np.pi * time / SLOW_S)
    sizes = sizes_of_runs([drive("a", slow + fast)], STEP).to_dict()
    assert sizes["slow movement"][0] == pytest.approx(0.3 / np.sqrt(2.0), rel=0.01)
    assert sizes["fast movement"][0] == pytest.approx(0.1 / np.sqrt(2.0) * np.sinc(1.0 / SLOW_S), rel=0.02)


def test_what_a_profile_holds_of_them_is_read_again() -> None:
    known = two_drives(3)
    again = Sizes.from_dict(known.to_dict())
    assert again is not None
    np.testing.assert_allclose(again.values, known.values, rtol=1e-3)
    np.testing.assert_allclose(again.errors, known.errors, rtol=1e-2)
    assert Sizes.from_dict({}) is None
    assert Sizes.from_dict({"mean offset": "much"}) is None


def test_sampled_drives_are_as_sure_as_the_measured_ones_that_they_stand_for() -> None:
    samples = np.stack([wander(seed, 3600.0) for seed in range(20)])
    short, long = (sizes_of_samples(samples, STEP, 2, seconds) for seconds in (3000.0, 12000.0))
    assert short.errors[1] == pytest.approx(2.0 * long.errors[1], rel=0.3)
    assert short.errors[0] == pytest.approx(DEVIATION * np.sqrt(2.0 * MEMORY_S / 3000.0), rel=0.4)
