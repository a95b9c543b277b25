"""Offsets for segments: core movement, effects, lane width, state."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.profiles import simulated_profile
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.core.base import Start
from xosc_lateral.drivers.model.effects import Acts, Cycle, Drift, EffectTerms, Linear, Regimes
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import OffsetSampler, combine, sample_offsets
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.drivers.model.validity import Validity

CURVE = Linear(acts=Acts.LOCATION, column="curvature", coefficients=(200.0,), errors=(1.0,), reference=(0.0,))


def segment(n: int, *, first: int = 0, width: float = 3.5, before: int = 0, after: int = 0) -> Segment:
    rows = np.arange(first - before, first + n + after)
    curvature = 1e-3 * np.sin(rows / 40)
    return Segment(
        time=rows * 0.2,
        lane_width=np.full(len(rows), width),
        speed=np.full(len(rows), 30.0),
        context={"curvature": curvature},
        before=before,
        after=after,
    )


@pytest.fixture(scope="module", params=["two-level", "best"])
def profile(request: pytest.FixtureRequest) -> DriverProfile:
    return replace(simulated_profile(request.param), validity=Validity())  # as in files that state none


def test_offsets_are_relative_to_the_lanes_width(profile: DriverProfile) -> None:
    narrow, wide = (sample_offsets(profile, segment(300, width=width), 1) for width in (3.0, 4.5))
    assert np.allclose(wide, 1.5 * narrow)


def test_offsets_without_effects_are_the_models(profile: DriverProfile) -> None:
    coarse, fine = profile.model.stream(child(np.random.SeedSequence(1), 0), Start(0.1)).take(300)
    assert np.array_equal(sample_offsets(profile, segment(300, width=4.0), 1, start=0.4), (coarse + fine) * 4.0)


def test_an_effect_on_location_adds_its_strength(profile: DriverProfile) -> None:
    part = segment(500)
    bent = replace(profile, effects=(CURVE,))
    shift = sample_offsets(bent, part, 1) - sample_offsets(profile, part, 1)
    assert np.allclose(shift, 200.0 * part.context["curvature"], atol=1e-12)


def test_a_column_that_is_missing_is_neutral(profile: DriverProfile) -> None:
    part = segment(100)
    bare = Segment(part.time, part.lane_width, part.speed)
    bent = replace(profile, effects=(CURVE,))
    assert np.array_equal(sample_offsets(bent, bare, 1), sample_offsets(profile, part, 1))


def test_speed_and_lane_width_of_the_segment_are_context(profile: DriverProfile) -> None:
    fast = Linear(acts=Acts.LOCATION, column="speed", coefficients=(0.01,), errors=(0.001,), reference=(20.0,))
    shift = sample_offsets(replace(profile, effects=(fast,)), segment(50), 1) - sample_offsets(profile, segment(50), 1)
    assert np.allclose(shift, 0.1)


def test_a_factor_on_spread_acts_about_the_mean(profile: DriverProfile) -> None:
    wider = Linear(
        acts=Acts.SPREAD, column="speed", coefficients=(1.0,), errors=(0.1,), reference=(30.0 - np.log(2.0),)
    )
    stream = profile.model.stream(child(np.random.SeedSequence(4), 0))
    coarse, fine = stream.take(200)
    expected = (stream.mean + 2.0 * (coarse - stream.mean) + fine) * 3.5
    assert np.allclose(sample_offsets(replace(profile, effects=(wider,)), segment(200), 4), expected)


@pytest.mark.parametrize("start", [-0.6, 0.0, 0.35])
def test_a_drive_with_effects_starts_where_it_is_told_to(profile: DriverProfile, start: float) -> None:
    livelier = Linear(acts=Acts.FINE, column="speed", coefficients=(0.02,), errors=(0.1,), reference=(0.0,))
    effects = (CURVE, livelier, Drift(size=0.1))
    assert sample_offsets(replace(profile, effects=effects), segment(10, first=30), 2, start=start)[0] == pytest.approx(
        start
    )


def test_segments_cut_in_pieces_give_the_whole(profile: DriverProfile) -> None:
    effects = (CURVE, Drift(size=0.1), Cycle(amplitude=0.1, period_s=20.0), Regimes(factor=2.0, on_s=5.0, off_s=20.0))
    rich = replace(profile, effects=effects)
    whole = OffsetSampler(rich, 3).sample(segment(900))
    sampler = OffsetSampler(rich, 3)
    pieces = [sampler.sample(segment(n, first=first)) for first, n in ((0, 100), (100, 1), (101, 799))]
    assert np.array_equal(np.concatenate(pieces), whole)


def test_the_state_goes_on_through_a_lane_change(profile: DriverProfile) -> None:
    sampler = OffsetSampler(profile, 3)
    first, second = sampler.sample(segment(100)), sampler.sample(segment(100, first=140))
    assert np.array_equal(np.concatenate([first, second]), OffsetSampler(profile, 3).sample(segment(200)))


def test_what_is_skipped_was_driven(profile: DriverProfile) -> None:
    """With hidden effects, too, which go by the time: nothing is lost but the rows between."""
    rich = replace(profile, effects=(Drift(size=0.1), Cycle(amplitude=0.1, period_s=20.0)))
    whole, sampler = OffsetSampler(rich, 3).sample(segment(400)), OffsetSampler(rich, 3)
    sampler.skip(100.0)  # nobody drives on who has not begun
    first = sampler.sample(segment(100))
    sampler.skip(-5.0)
    sampler.skip(30.0)
    later = sampler.sample(segment(150, first=250))
    assert np.array_equal(first, whole[:100]) and np.array_equal(later, whole[250:])


def test_a_copy_goes_on_by_itself(profile: DriverProfile) -> None:
    sampler = OffsetSampler(profile, 3)
    sampler.sample(segment(50))
    copy = sampler.copy()
    assert np.array_equal(copy.sample(segment(50, first=50)), sampler.sample(segment(50, first=50)))


def test_rows_before_and_after_are_context_alone(profile: DriverProfile) -> None:
    assert np.array_equal(
        sample_offsets(profile, segment(80, before=20, after=10), 5), sample_offsets(profile, segment(80), 5)
    )
    assert len(sample_offsets(profile, segment(0, before=5), 5)) == 0


def test_locations_add_up_and_factors_multiply() -> None:
    one, two = np.ones(2), np.full(2, 2.0)
    terms = combine([EffectTerms(location=one, spread=two), EffectTerms(location=two, spread=two, rate=two)])
    assert terms.location is not None and terms.spread is not None and terms.rate is not None
    assert (terms.location[0], terms.spread[0], terms.rate[0], terms.fine) == (3.0, 4.0, 2.0, None)


def test_wrong_calls_are_refused(profile: DriverProfile) -> None:
    with pytest.raises(ValueError, match=r"steps of 0\.1 to 0\.1 s, the model needs 0\.2 s"):
        sample_offsets(profile, Segment(np.arange(5) * 0.1, np.full(5, 3.5), np.full(5, 30.0)), 1)
    sampler = OffsetSampler(profile, 1)
    sampler.sample(segment(5))
    with pytest.raises(ValueError, match="has no start"):
        sampler.sample(segment(5, first=5), start=0.0)
