"""Enrichment of made motions: where offsets come out, how they go on, what is found and reported."""

from __future__ import annotations

from collections.abc import Mapping
from math import erf, sqrt
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tests.kit.motion import drive, entity, together, two_roads
from tests.kit.profiles import simulated_profile
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.motion.trajectory import distance_driven
from xosc_lateral.world.surroundings.context import STEERING_DURATION

PROFILE = Neighbours.PROFILE


class Shift(ColumnEffect, frozen=True, kw_only=True):
    """An effect that moves by 1 m for each unit of a column."""

    acts: Acts = Acts.LOCATION
    coefficients: tuple[float, ...] = (1.0,)
    errors: tuple[float, ...] = (0.0,)
    reference: tuple[float, ...] = (0.0,)
    column: str

    @property
    def columns(self) -> tuple[str, ...]:
        return (self.column,)

    @property
    def shape(self) -> str:
        return "shift"

    def quantity(self, context: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.nan_to_num(context[self.column])[:, None]


def _with(profile: DriverProfile, *effects: object) -> DriverProfile:
    return structs.replace(profile, effects=effects)


def test_the_path_deviates_by_the_sampled_offsets_to_a_centimetre_in_lane_coordinates(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = together(drive(network, entity(), start=300.0), drive(network, entity("back"), lane=2, start=300.0))
    profile = simulated_profile()
    result = enrich(SegmentedRun(motion, network), {"car": profile, "back": profile}, seed=3)
    for item in result.entities:
        path, nominal = item.trajectory, item.motion
        found = network.path_to_lane(path.x, path.y, nominal.road, nominal.s)
        assert (found.lane == nominal.lane).all()
        (segment,) = item.segments
        at = np.round(segment.time / motion.step).astype(int)
        np.testing.assert_allclose(found.offset[at], segment.offset, atol=1e-6)
        between = np.interp(nominal.time, segment.time, segment.offset)
        assert np.abs(found.offset - between).max() < 0.03
        assert np.ptp(segment.offset) > 0.05


def test_whoever_follows_a_trajectory_moves_in_a_lane_change_as_if_there_were_none(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    deviations = []
    for rows in (slice(400, 600), slice(0, 0), slice(0, 200), slice(801, 1001)):
        activity = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
        activity[rows] |= int(Activity.LATERAL)
        motion = together(drive(network, entity(), duration=20.0, activity=activity))
        result = enrich(SegmentedRun(motion, network, continuous=["car"]), {"car": simulated_profile()}, seed=1)
        (item,) = result.entities
        deviations.append(item.deviation)
        following = [segment.span for segment in item.segments]
        assert all(span.is_road_following for span in following)
        assert sum(span.last - span.first + 1 for span in following) == 1001 - (rows.stop - rows.start)
        for segment in item.segments:
            assert segment.span.start <= segment.time[0] and segment.time[-1] <= segment.span.end
    for deviation in deviations[1:]:
        np.testing.assert_array_equal(deviation, deviations[0])
    assert np.ptp(deviations[0][400:600]) > 0.02


@pytest.mark.parametrize("what", ["placed anew", "backwards"])
def test_movement_does_not_go_on_through_what_is_no_driving(tmp_path: Path, what: str) -> None:
    network = two_roads(tmp_path)
    activity = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
    activity[400:600] |= int(Activity.LATERAL)
    motion = drive(network, entity(), duration=20.0, activity=activity)
    if what == "backwards":
        at = np.arange(1001)
        motion = motion.having(speed=np.where((at >= 480) & (at < 520), -5.0, motion.speed))
    else:
        activity[500] |= int(Activity.TELEPORTED)
    motion = motion.having(activity=activity)
    found = [
        enrich(SegmentedRun(together(motion), network, continuous=names), {"car": simulated_profile()}, seed=1)
        .entities[0]
        .deviation
        for names in ((), ("car",))
    ]
    if what == "backwards":
        np.testing.assert_array_equal(found[0], found[1])
    else:  # before and after it, it goes on
        assert np.ptp(found[1][401:499]) > 0.005


def test_a_lane_change_leads_over_smoothly_and_no_offset_is_sampled_in_it(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    activity = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
    activity[400:600] |= int(Activity.LATERAL)
    motion = together(drive(network, entity(), duration=20.0, activity=activity))
    (item,) = enrich(SegmentedRun(motion, network), {"car": simulated_profile()}, seed=1).entities
    first, second = item.segments
    assert first.time[-1] <= 400 * motion.step
    assert second.time[0] >= 600 * motion.step
    slope = np.gradient(item.deviation, distance_driven(item.motion))
    bend = np.gradient(slope, distance_driven(item.motion))
    assert np.abs(np.diff(slope)).max() < 2e-3
    assert np.abs(bend[380:620]).max() < 0.02


def test_a_standing_car_does_not_slide(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    time = np.arange(1001) * 0.02
    speed = np.clip(30.0 - 5.0 * (time - 5.0), 0.0, 30.0)
    motion = together(drive(network, entity(), duration=20.0, speed=speed))
    (item,) = enrich(SegmentedRun(motion, network), {"car": simulated_profile()}, seed=1).entities
    standing = speed == 0.0
    assert np.ptp(item.trajectory.x[standing]) == 0.0
    assert np.ptp(item.deviation[standing]) == 0.0


def test_each_entity_has_random_numbers_of_its_own(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    profile = simulated_profile()
    a, b = drive(network, entity("a")), drive(network, entity("b"), lane=-1)
    alone = enrich(SegmentedRun(together(a), network), {"a": profile}, seed=5)
    both = enrich(SegmentedRun(together(b, a), network, neighbours=PROFILE), {"a": profile, "b": profile}, seed=5)
    np.testing.assert_array_equal(alone.entity("a").deviation, both.entity("a").deviation)
    assert not np.array_equal(both.entity("a").deviation, both.entity("b").deviation)
    for other in ({"seed": 6}, {"seed": 5, "variant": 1}, {"seed": 5, "seed_words": {"a": [1]}}):
        changed = enrich(SegmentedRun(together(a), network), {"a": profile}, **other)  # type: ignore[arg-type]
        assert not np.array_equal(alone.entity("a").deviation, changed.entity("a").deviation)


def test_an_effect_sees_the_context_around_its_segment_and_acts_in_it(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    base = simulated_profile()
    effect = Shift(column="curvature", lag_s=-1.0)
    activity = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
    activity[300:400] |= int(Activity.LATERAL)
    motion = together(drive(network, entity(), start=200.0, duration=20.0, activity=activity))
    plain = enrich(SegmentedRun(motion, network), {"car": base}, seed=1).entity("car")
    shifted = enrich(SegmentedRun(motion, network), {"car": _with(base, effect)}, seed=1).entity("car")
    for with_effect, without in zip(shifted.segments, plain.segments, strict=True):
        # looked ahead by a second, beyond the segment too; the curve begins at once, and is seen over a second or two
        since = with_effect.time + 1.0 - 10.0
        expected = np.array([0.5 + 0.5 * erf(one / STEERING_DURATION / sqrt(2.0)) for one in since]) / (400.0 + 5.25)
        np.testing.assert_allclose(
            with_effect.offset - without.offset, expected, atol=0.05 / 400.0
        )  # 5 Hz: half a step


def test_a_context_that_nobody_supplies_is_named_and_a_given_one_is_used(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    driver = _with(simulated_profile(), Shift(column="wind_speed"))
    motion = together(drive(network, entity()))
    unknown = enrich(SegmentedRun(motion, network), {"car": driver}, seed=1)
    assert unknown.entity("car").neutral == ("wind_speed",)
    assert any("wind_speed" in warning.what for warning in unknown.warnings())
    wind = (np.array([0.0, 10.0]), np.array([0.2, 0.2]))
    given = enrich(SegmentedRun(motion, network), {"car": driver}, seed=1, context={"wind_speed": wind})
    difference = given.entity("car").segments[0].offset - unknown.entity("car").segments[0].offset
    np.testing.assert_allclose(difference, 0.2)
    assert not list(given.warnings())


def test_touching_and_leaving_the_lane_are_reported_and_resampled_on_request(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = together(drive(network, entity("a"), lane=-2), drive(network, entity("b"), lane=-1))
    far_left = (np.array([0.0, 10.0]), np.array([2.2, 2.2]))
    driver = _with(simulated_profile(), Shift(column="push"))
    result = enrich(
        SegmentedRun(motion, network, neighbours=PROFILE), {"a": driver}, seed=1, context={"push": far_left}
    )
    assert [departure.name for departure in result.departures] == ["a"]
    assert [gap.names for gap in result.new_contacts] == [("a", "b")]
    assert len(list(result.warnings())) == 2
    again = enrich(
        SegmentedRun(motion, network, neighbours=PROFILE), {"a": driver}, seed=1, context={"push": far_left}, attempts=3
    )
    assert len(again.departures) == 1  # nothing helps against a driver who is pushed over the marking
    jointly = enrich(SegmentedRun(motion, network), {"a": driver}, seed=1, context={"push": far_left})
    assert not jointly.new_contacts, "a car that is there is given way to"
    calm = enrich(SegmentedRun(motion, network), {"a": simulated_profile()}, seed=1, attempts=3)
    assert calm.attempt == 0
    assert not list(calm.warnings())


def test_who_is_not_enriched_keeps_every_bit_and_the_reason_is_given(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    slow = drive(network, entity("slow"), speed=-8.0)
    result = enrich(
        SegmentedRun(together(slow, drive(network, entity("other"))), network),
        {"slow": simulated_profile(), "other": "why not"},
        seed=1,
    )
    assert result.entity("slow").why == "no road-following segment"
    assert result.entity("other").why == "why not"
    assert (result.entity("slow").trajectory.x == slow.x).all()


def test_a_trailer_follows_in_its_tractors_track(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    tractor = drive(network, entity("tractor"), start=60.0)
    trailer = drive(network, entity("trailer"), start=50.0)
    result = enrich(
        SegmentedRun(together(tractor, trailer), network, trailers={"trailer": "tractor"}),
        {"tractor": simulated_profile()},
        seed=2,
    )
    delay = np.interp(distance_driven(tractor) - 10.0, distance_driven(tractor), result.entity("tractor").deviation)
    np.testing.assert_allclose(result.entity("trailer").deviation, delay, atol=1e-9)
    assert result.entity("trailer").deviation.any()


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_a_positive_offset_is_to_the_left_of_travel_in_both_traffic_rules(tmp_path: Path, rule: str) -> None:
    network = two_roads(tmp_path, rule=rule)
    push = (np.array([0.0, 10.0]), np.array([1.0, 1.0]))
    for lane in (-2, 2):
        motion = together(drive(network, entity(), lane=lane, start=100.0))
        home = structs.replace(simulated_profile(), left_hand=rule == "LHT")
        base = enrich(SegmentedRun(motion, network), {"car": home}, seed=1).entity("car").trajectory
        driver = _with(home, Shift(column="push"))
        pushed = (
            enrich(SegmentedRun(motion, network), {"car": driver}, seed=1, context={"push": push})
            .entity("car")
            .trajectory
        )
        heading = motion.entities[0].heading
        left = -np.sin(heading) * (pushed.x - base.x) + np.cos(heading) * (pushed.y - base.y)
        np.testing.assert_allclose(left, 1.0, atol=1e-6)
