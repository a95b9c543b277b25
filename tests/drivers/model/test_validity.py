"""Where a profile holds: in words, beside a scenario, and in what lane width does."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.profiles import simulated_profile
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.profile import DriverProfile, sampling_hash
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.drivers.model.validity import Band, Validity

KNOWN = Validity(
    (Band(0.0, 0.15, "tracks"), Band(0.15, 1.0, "GNSS", (14.0, 25.0))), (20.0, 40.0), (3.5, 3.8), ("motorway",), 0.01
)


@pytest.fixture(scope="module")
def profile() -> DriverProfile:
    return replace(simulated_profile("best"), validity=KNOWN)


def even(width: float, seconds: float = 60.0) -> Segment:
    return Segment.even(seconds, 0.2, width, 30.0)


def test_validity_is_said_in_a_line_and_kept_in_the_file(profile: DriverProfile) -> None:
    assert KNOWN.in_words() == (
        "0 to 0.15 Hz (tracks); 0.15 to 1 Hz (GNSS, 50 to 90 km/h), above: assumed; 72 to 144 km/h; "
        "lanes of 3.50 to 3.80 m; motorway"
    )
    assert KNOWN.highest_frequency == 1.0
    assert Validity().in_words() == "" and Validity().highest_frequency is None
    assert DriverProfile.from_dict(profile.to_dict()).validity == KNOWN
    assert "validity" not in replace(profile, validity=Validity()).to_dict()


def test_only_what_is_far_outside_is_named() -> None:
    assert KNOWN.departures(np.array([18.0, 42.0, np.nan]), np.array([3.3, 4.0])) == []
    assert KNOWN.departures(np.array([10.0, 30.0]), np.array([3.7, 5.0])) == [
        "36 to 108 km/h (measured: 72 to 144)",
        "3.70 to 5.00 m wide (measured: 3.50 to 3.80)",
    ]
    assert Validity().departures(np.array([1.0]), np.array([9.0])) == []


def test_offsets_do_not_grow_beyond_the_widest_lane_measured(profile: DriverProfile) -> None:
    widest, wider = (sample_offsets(profile, even(width), 1) for width in (3.8, 10.0))
    assert np.array_equal(widest, wider)
    stated_nothing = replace(profile, validity=Validity())
    np.testing.assert_allclose(
        sample_offsets(stated_nothing, even(10.0), 1), sample_offsets(stated_nothing, even(5.0), 1) * 2.0
    )


def test_steering_noise_is_as_large_in_a_narrow_lane(profile: DriverProfile) -> None:
    model = replace(profile.model, coarse=replace(profile.model.coarse, scale=0.0), between_drivers=0.0)  # type: ignore[attr-defined]
    noise = replace(profile, model=replace(model, mean=0.0))
    narrow, wide = (sample_offsets(noise, even(width), 1) for width in (2.5, 3.5))
    np.testing.assert_allclose(narrow, wide, atol=1e-12)
    assert wide.std() > 1e-3


@pytest.mark.parametrize("width", [2.5, 3.6, 8.0])
def test_a_drive_begins_where_it_is_told_to_in_any_lane(profile: DriverProfile, width: float) -> None:
    assert sample_offsets(profile, even(width), 3, start=0.21)[0] == pytest.approx(0.21, abs=1e-9)
    stream = OffsetStream(profile, 3, start=0.21)
    streamed = [stream.step({"lane_width": width, "speed": 30.0}) for _ in range(50)]
    np.testing.assert_allclose(streamed, sample_offsets(profile, even(width), 3, start=0.21)[:50], atol=1e-12)


def test_what_lane_width_does_is_part_of_what_offsets_depend_on(profile: DriverProfile) -> None:
    assert sampling_hash(profile) != sampling_hash(replace(profile, validity=Validity()))
    assert sampling_hash(profile) == sampling_hash(replace(profile, validity=replace(KNOWN, roads=("rural",))))


@pytest.mark.parametrize("wrong", [{"speed": (30.0, 20.0)}, {"lane_width": (-1.0, 3.0)}])
def test_contradictions_are_refused(wrong: dict[str, tuple[float, float]]) -> None:
    with pytest.raises(DriverProfileError, match=next(iter(wrong))):
        Validity(**wrong)  # type: ignore[arg-type]
    with pytest.raises(DriverProfileError, match=r"a band from 0.5 to 0.2 Hz"):
        Band(0.5, 0.2)
