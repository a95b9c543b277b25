"""Spectrum shape: the profile's own movement passes, another's is found, and the size alone is no matter."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.coarse import movement, timeline_of
from tests.kit.core_models import STEADY
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.loop import core_model
from xosc_lateral.extras.loop.core_model import BLOCK, TIMES_S, WORTH_ADDING, SpectrumShape, _shapes
from xosc_lateral.extras.loop.timeline import Timeline

WIDTH = 3.6
N = 9000
"""Half an hour."""


def driven(model: object, seed: int) -> Timeline:
    """A drive of the model's own."""
    coarse, fine = model.stream(np.random.SeedSequence(seed)).take(N)  # type: ignore[attr-defined]
    return timeline_of(WIDTH * (coarse + fine))


@pytest.fixture(scope="module")
def profile() -> DriverProfile:
    return DriverProfile(name="own", model=STEADY)


def test_a_profile_s_own_drives_show_its_spectrum(profile: DriverProfile) -> None:
    found = [
        core_model.compare_spectrum_shapes(profile, driven(STEADY, seed), np.random.SeedSequence(1))
        for seed in (21, 22, 23)
    ]
    assert not any(one.is_found for one in found)
    assert max(one.p_value for one in found) > 0.05
    for one in found:
        np.testing.assert_allclose(one.ratio, 1.0, atol=0.15)


def test_a_drive_with_more_fine_movement_is_found_and_the_band_told(profile: DriverProfile) -> None:
    rough = replace(STEADY, fine=replace(STEADY.fine, damping=3.0 * STEADY.fine.damping))
    found = core_model.compare_spectrum_shapes(profile, driven(rough, 24), np.random.SeedSequence(1))
    assert found.is_found
    assert found.ratio[0] == pytest.approx(1.0 / 3.0, rel=0.2)
    np.testing.assert_allclose(found.ratio[-1], 1.0, atol=0.15)


def test_twice_the_size_is_no_other_shape(profile: DriverProfile) -> None:
    timeline = driven(STEADY, 25)
    np.testing.assert_allclose(_shapes(2.0 * timeline.offset, timeline), _shapes(timeline.offset, timeline), atol=1e-9)


def test_a_block_is_a_minute_and_a_rest_is_left_out() -> None:
    timeline = timeline_of(movement(np.random.default_rng(1), 400.0))
    inside = int(timeline.valid.sum())
    assert _shapes(timeline.offset, timeline).shape == (inside // BLOCK, len(TIMES_S))


def test_bands_of_a_sine_are_differences_of_what_averages_leave_of_it() -> None:
    """A mean over m samples leaves sin(pi f m) / (m sin(pi f)) of a wave of frequency f."""
    frequency = 0.2 / 3.0
    timeline = timeline_of(0.1 * np.sin(2.0 * np.pi * frequency * np.arange(3000)))
    samples = np.array([1, 3, 5, 11, 21, 41])  # of averages over 0.4, 1, 2, 4 and 8 s about a sample
    left = np.sin(np.pi * frequency * samples) / (samples * np.sin(np.pi * frequency))
    shape = _shapes(timeline.offset, timeline)[1:-1].mean(axis=0)  # away from the ends
    np.testing.assert_allclose(np.exp(shape), np.abs(np.diff(left)), rtol=0.02)


def test_movement_that_stands_still_has_no_blocks() -> None:
    timeline = timeline_of(np.full(3000, 0.2))
    assert _shapes(np.full(3000, 0.2), timeline).shape == (0, len(TIMES_S))


def test_too_short_a_drive_says_nothing(profile: DriverProfile) -> None:
    timeline = timeline_of(movement(np.random.default_rng(2), 300.0))
    found = core_model.compare_spectrum_shapes(profile, timeline, np.random.SeedSequence(1))
    assert found.p_value == 1.0
    assert not found.is_found


@pytest.mark.parametrize(("p_value", "ratio", "found"), [(1e-6, 1.2, True), (1e-6, 1.03, False), (0.2, 3.0, False)])
def test_a_difference_is_sure_and_large_enough_or_none(p_value: float, ratio: float, found: bool) -> None:
    assert SpectrumShape(TIMES_S, np.array([1.0, ratio]), p_value).is_found is found
    assert SpectrumShape(TIMES_S, np.array([1.0, 1.0 / ratio]), p_value).is_found is found
    assert np.log(1.03) < WORTH_ADDING < np.log(1.2)


def test_the_same_seed_says_the_same(profile: DriverProfile) -> None:
    timeline = driven(STEADY, 26)
    one, other = (core_model.compare_spectrum_shapes(profile, timeline, np.random.SeedSequence(7)) for _ in range(2))
    assert one.p_value == other.p_value
    np.testing.assert_array_equal(one.ratio, other.ratio)
