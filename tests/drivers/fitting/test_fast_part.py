"""Fast movement of one recording in a profile of another; drives with a known spectrum and a known growth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.profiles import simulated_profile
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.drives.drive import Drive, Run
from xosc_lateral.drivers.drives.filters import filtered, low_pass_between
from xosc_lateral.drivers.fitting.bands import (
    SPEED_KNOTS,
    density_of,
    fast_part_of,
    fast_part_of_runs,
    growth_with_speed,
    shows_growth,
    steering_gain,
    with_fast_part,
)
from xosc_lateral.drivers.fitting.fitting import fit_profile, smoothed_above
from xosc_lateral.drivers.fitting.joined_bands import split_by_band, visible_below
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.sampled_offsets import sample_free
from xosc_lateral.drivers.model.sensor import SensorModel
from xosc_lateral.drivers.model.validity import Validity

STEP = 0.2
REFERENCE = 20.0


def true_density(hertz: np.ndarray) -> np.ndarray:
    """Of the offset at the reference speed: flat at first, then falling with the fifth power. [m2/Hz]"""
    return np.asarray(0.2 / (1.0 + (hertz / 0.08) ** 5))


def movement(speed: float, seconds: float, seed: int, *, grows: bool = True) -> np.ndarray:
    """Gaussian, of the density above; what is faster than 0.1 Hz grows with the speed."""
    n = round(seconds / STEP)
    hertz = np.fft.rfftfreq(n, STEP)
    growth = steering_gain(np.array([speed]))[0] / steering_gain(np.array([REFERENCE]))[0] if grows else 1.0
    density = true_density(hertz) * np.where(hertz > 0.1, growth, 1.0)
    noise = np.fft.rfft(np.random.default_rng(seed).normal(size=n))
    return np.asarray(np.fft.irfft(noise * np.sqrt(density / (2.0 * STEP)), n))


def runs_at(speeds: tuple[float, ...], *, grows: bool = True) -> list[Run]:
    n = round(600.0 / STEP)
    return [
        Run(f"d{k}", 0, STEP * np.arange(n), movement(speed, 600.0, k, grows=grows), np.full(n, 3.5),
            {"speed": np.full(n, speed)})
        for k, speed in enumerate(speeds)
    ]  # fmt: skip


SPEEDS = (13.0, 16.0, 20.0, 24.0, 28.0, 32.0)


def test_growth_follows_the_single_track_car_between_its_knots() -> None:
    law = growth_with_speed(20.0)
    speed = np.arange(SPEED_KNOTS[0], SPEED_KNOTS[-1], 0.5)
    strength = law.strength(STEP, {"speed": speed})
    expected = 0.5 * np.log(steering_gain(speed) / steering_gain(np.array([20.0])))
    assert strength is not None
    np.testing.assert_allclose(strength, expected, atol=0.03)
    outside = law.strength(STEP, {"speed": np.array([5.0, 11.0, 42.0, 60.0])})
    assert outside is not None and outside[0] == outside[1] and outside[2] == pytest.approx(outside[3], abs=1e-4)


def test_growth_is_seen_where_it_is_and_not_where_it_is_not() -> None:
    assert shows_growth(runs_at(SPEEDS))
    assert not shows_growth(runs_at(SPEEDS, grows=False))
    assert not shows_growth(runs_at((20.0, 20.0, 20.0)))
    assert not shows_growth([runs_at((20.0,))[0].part(slice(0, 200))])


def test_the_spectrum_at_the_reference_speed_comes_back() -> None:
    fast = fast_part_of_runs(runs_at(SPEEDS), 1.0, "planted")
    assert len(fast.effects) == 1
    reference = fast.effects[0].reference[0]
    growth = steering_gain(np.array([reference]))[0] / steering_gain(np.array([REFERENCE]))[0]
    at = np.array([0.15, 0.2, 0.3, 0.5, 0.8])
    # 280 windows, five or so a knot: 10 %; two straight lines between knots in a curve: as much
    np.testing.assert_allclose(fast.density(at) / (true_density(at) * growth), 1.0, atol=0.3)
    assert fast.volatility.total < 0.03


def test_growth_that_the_runs_contradict_is_left_out() -> None:
    assert fast_part_of_runs(runs_at(SPEEDS, grows=False), 1.0, "planted").effects == ()


def test_a_few_seconds_are_too_little() -> None:
    with pytest.raises(NotEnoughDataError, match=r"3 stretches of 51.2 s without a cut; fast movement takes 16"):
        fast_part_of_runs([runs_at((20.0,))[0].part(slice(0, 520))], 1.0, "short")


def drives(
    count: int, *, name: str, smooth: bool = False, shape: Callable[[np.ndarray], np.ndarray] = np.asarray
) -> list[Drive]:
    n = round(400.0 / STEP)
    found = []
    for k in range(count):
        speed = 15.0 + 15.0 * k / count
        offset = shape(movement(speed, 400.0, 100 + k + 1000 * smooth))
        if smooth:
            offset = filtered(offset, low_pass_between(0.1, 0.2, STEP, 40.0))
        context = {"speed": np.full(n, speed), "lane_width": np.full(n, 3.5)}
        below = 0.1 if smooth else 1.5
        found.append(Drive(f"{name}{k}", STEP * np.arange(n), offset, np.full(n, 3.5), context, valid_below=below))
    return found


@pytest.mark.pages
def test_a_second_recording_gives_back_what_the_provider_took() -> None:
    """The movement at 25 m/s: with the second recording as planted, without it there is none."""
    smoothed, clean = drives(5, name="s", smooth=True), drives(5, name="c")
    both = fit_profile([*smoothed, *clean], name="both")
    alone = fit_profile(smoothed, name="alone")
    expected = true_density(np.array([0.3]))[0] * np.divide(*steering_gain(np.array([25.0, REFERENCE])))
    powers = [power_at(profile, 0.3, 25.0) / expected for profile in (both, alone)]
    assert powers[0] == pytest.approx(1.0, abs=0.4)
    assert powers[1] < 0.03  # 15 dB below
    assert [(band.low, band.high) for band in both.validity.bands] == [(0.0, 0.1), (0.15, 1.5)]
    assert alone.validity.highest_frequency == 0.1
    shows_all = fit_profile(clean, name="clean", stand_in=lambda: pytest.fail("drives that show all need no other"))
    by_prior = fit_profile(smoothed, name="prior", prior=shows_all)
    assert fit_profile(smoothed, name="prior", stand_in=lambda: shows_all).to_dict() == by_prior.to_dict()
    assert power_at(by_prior, 0.3, 25.0) == pytest.approx(power_at(both, 0.3, 25.0), rel=0.3)
    for profile in (both, by_prior):  # what is slow is the smoothed recording's in any case
        assert power_at(profile, 0.05, 25.0) == pytest.approx(power_at(alone, 0.05, 25.0), rel=0.4)


def power_at(profile, hertz: float, speed: float) -> float:  # type: ignore[no-untyped-def]
    (free,) = sample_free(profile, 6_000.0, 1, speed=speed)
    power = np.abs(np.fft.rfft(free.offset - free.offset.mean())) ** 2 * 2.0 * STEP / len(free.offset)
    at = np.fft.rfftfreq(len(free.offset), STEP)
    return float(power[(at > 0.9 * hertz) & (at < 1.1 * hertz)].mean())


def test_drives_are_split_by_what_they_show() -> None:
    smoothed, clean = drives(2, name="s", smooth=True), drives(2, name="c")
    assert split_by_band([*smoothed, *clean]) == (smoothed, clean)
    assert split_by_band(clean) == (clean, [])
    with pytest.raises(DriverProfileError, match=r"valid below 0.1, 1.5, inf Hz: at most two bands"):
        split_by_band([*smoothed, *clean, *[Drive("x", d.time, d.offset, d.lane_width) for d in clean]])
    with pytest.raises(DriverProfileError, match="fitted to one recording alone"):
        fit_profile([*smoothed, *clean], name="both", model=ModelKind.TWO_LEVEL)


def test_a_two_level_profile_has_no_fast_part() -> None:
    with pytest.raises(DriverProfileError, match="of the model two-level, expected autoregressive"):
        fast_part_of(simulated_profile("two-level"))


@pytest.mark.pages
def test_movement_below_the_band_stays_and_above_is_the_fast_parts() -> None:
    profile = simulated_profile("best")
    made = with_fast_part(profile, fast_part_of_runs(runs_at(SPEEDS), 1.0, "planted"), 0.1)
    slow, fast = np.array([0.02, 0.04, 0.06, 0.08]), np.array([0.2, 0.3, 0.5, 0.8])
    np.testing.assert_allclose(density_of(made)(slow) / density_of(profile)(slow), 1.0, atol=0.1)
    wanted = fast_part_of_runs(runs_at(SPEEDS), 1.0, "planted").density(fast)
    np.testing.assert_allclose(density_of(made)(fast) / wanted, 1.0, atol=0.15)
    none = with_fast_part(profile, None, 0.1)
    assert (density_of(none)(fast[1:]) < 0.1 * wanted[1:]).all()


def test_a_sensor_hides_the_driver_from_where_its_noise_is_as_strong() -> None:
    profile = simulated_profile("best")
    level = float(density_of(profile)(np.array([0.3]))[0])
    assert visible_below(replace(profile, sensor=SensorModel(level))) == pytest.approx(0.3, abs=0.02)
    assert visible_below(profile) == 1.5 or profile.sensor is not None


def test_a_spectrum_that_falls_as_no_drivers_does_is_noticed() -> None:
    at_speed = Validity(speed=(19.0, 21.0), lane_width=(3.5, 3.5))
    reference = with_fast_part(simulated_profile("best"), fast_part_of_runs(runs_at(SPEEDS), 1.0, "planted"), 0.1)
    reference = replace(reference, validity=at_speed)
    assert smoothed_above(reference, reference) is None
    smoothed = replace(with_fast_part(reference, None, 0.15), validity=at_speed)
    found = smoothed_above(smoothed, reference)
    assert found is not None and 0.2 < found < 0.35
