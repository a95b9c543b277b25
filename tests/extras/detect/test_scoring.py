"""Counts against loops, intervals against closed forms, curves that can't flatter."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.lane_tracks import LANE, lane_change, scene, track, weave
from xosc_lateral.extras.detect.detectors import LateralSpeed, MarkingDistance, WanderingZone
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, RATE_WINDOW, Sensor, views_of
from xosc_lateral.extras.detect.scoring import Tally, count_onsets, lead_times
from xosc_lateral.extras.detect.tracks import MARGIN_ROWS, STEP, LaneChange


def curve_of(detector, *scenes, sensor=PERFECT_SENSOR):
    tally = Tally(detector, "made")
    for one in scenes:
        tally.add(one, views_of(one, sensor, 0))
    return tally.curve()


def test_onsets_are_those_of_a_loop_over_rows():
    rng = np.random.default_rng(1)
    score, keeping = np.cumsum(rng.standard_normal(500)) * 0.2, rng.random(500) < 0.7
    limits = np.linspace(-3.0, 3.0, 25)
    looped = [
        sum(keeping[k] and score[k - 1] <= limit < score[k] for k in range(1, len(score))) for limit in limits.tolist()
    ]
    assert count_onsets(score, keeping, limits).tolist() == looped


def test_lead_times_are_those_of_a_loop_over_rows():
    rng = np.random.default_rng(2)
    limits = np.linspace(-2.0, 2.0, 21)
    change = LaneChange(1, begin=60, crossing=90, centre=110, end=150)
    for _ in range(20):
        score = np.cumsum(rng.standard_normal(200)) * 0.3
        for limit, lead in zip(limits.tolist(), lead_times(score, change, limits).tolist(), strict=True):
            row = 60
            if score[row] > limit:  # it stands: since when
                while row > 60 - MARGIN_ROWS and score[row - 1] > limit:
                    row -= 1
            else:
                row = next((k for k in range(60, 111) if score[k] > limit), -1)
            assert np.isnan(lead) if row < 0 else lead == pytest.approx((90 - row) * STEP)


def test_a_weave_alarms_once_a_period_on_each_side():
    period, amplitude = 10.0, 0.4  # largest lateral speed 0.25 m/s
    curve = curve_of(LateralSpeed(threshold=0.2, hold=0.4), scene(track(weave(600.0, amplitude, period))))
    k = curve.detector.chosen
    assert curve.rate[k] == pytest.approx(3600.0 / period, rel=0.02)  # seen from one neighbouring lane
    assert curve.hours.sum() == pytest.approx(2 * (600.0 - 4.0) / 3600.0, rel=1e-3)
    fastest = amplitude * 2.0 * np.pi / period * np.sinc(RATE_WINDOW / period)
    assert curve.rate[np.searchsorted(curve.detector.thresholds, fastest)] == 0.0


def test_a_hold_longer_than_the_time_above_the_threshold_is_silent():
    period, amplitude, threshold = 10.0, 0.4, 0.2
    fastest = amplitude * 2.0 * np.pi / period * np.sinc(RATE_WINDOW / period)
    above = period / np.pi * np.arccos(threshold / fastest)
    made = scene(track(weave(300.0, amplitude, period)))
    for hold, silent in ((above - 0.2, False), (above + 0.2, True)):
        curve = curve_of(LateralSpeed(threshold=threshold, hold=hold), made)
        assert (curve.rate[curve.detector.chosen] == 0.0) == silent


def test_leads_are_those_of_a_lane_change_in_closed_form():
    time = 0.1 * np.arange(600)
    made = scene(track(lane_change(time, 25.0, 6.0)))
    for detector in (MarkingDistance(threshold=0.3), WanderingZone()):
        curve = curve_of(detector, made)
        assert curve.seen()[detector.chosen] == 1.0 and len(curve.leads) == 1
        towards = detector.threshold
        if isinstance(detector, MarkingDistance):
            towards += 0.5 * LANE - 0.95
        moments = [6.0 / np.pi * np.arccos(1.0 - 2.0 * way / LANE) for way in (towards, 0.5 * LANE - 0.95)]
        assert curve.lead(0.5)[detector.chosen] == pytest.approx(moments[1] - moments[0], abs=0.11)


def test_an_ego_hears_of_its_own_lane_alone():
    time = 0.1 * np.arange(600)
    ego = track(np.zeros(600), name="Ego", lane=1)
    beside = track(lane_change(time, 25.0, 6.0), name="A", lane=0, x=40.0)
    behind = track(lane_change(time, 25.0, 6.0), name="B", lane=0, x=-60.0)
    away = track(lane_change(time, 25.0, 6.0), name="C", lane=1, x=300.0)
    views = views_of(scene(ego, beside, behind, away, ego="Ego"), PERFECT_SENSOR, 0)
    assert [(view.track.name, view.side) for view in views] == [("A", 1)]
    curve = curve_of(LateralSpeed(), scene(ego, beside, behind, away, ego="Ego"))
    assert len(curve.leads) == 1
    observer = views[0].observer
    assert observer is not None
    assert observer.gap[100] == pytest.approx(40.0 - 4.6) and observer.closing[100] == 0.0
    assert observer.clearance[100] == pytest.approx(LANE - 1.9)


def test_without_an_ego_the_nearest_behind_in_the_next_lane_looks_on():
    one, near, far = (track(np.zeros(200), name=name, lane=lane, x=x) for name, lane, x in (
        ("A", 1, 100.0), ("near", 2, 70.0), ("far", 2, 10.0)))  # fmt: skip
    views = [view for view in views_of(scene(one, near, far), PERFECT_SENSOR, 0) if view.track.name == "A"]
    gaps = {view.side: view.observer.gap[50] for view in views if view.observer is not None}
    assert gaps[1] == pytest.approx(30.0 - 4.6) and np.isnan(gaps[-1])


def test_intervals_shrink_with_vehicles_and_cover_a_poisson_bound():
    rng = np.random.default_rng(3)
    many = [scene(track(weave(200.0, float(a), 9.0), name=f"v{k}")) for k, a in enumerate(rng.uniform(0.1, 0.5, 40))]
    detector = LateralSpeed()
    few, all_of_them = (curve_of(detector, *part) for part in (many[:8], many))
    widths = [np.diff(curve.rate_interval()[:, detector.chosen], axis=0).item() for curve in (few, all_of_them)]
    assert widths[1] < 0.75 * widths[0]
    low, high = all_of_them.rate_interval()[:, detector.chosen]
    assert low < all_of_them.rate[detector.chosen] < high
    silent = curve_of(detector, *(scene(track(np.zeros(2000), name=f"v{k}")) for k in range(3)))
    hours = silent.hours.sum()
    np.testing.assert_allclose(silent.rate_interval()[:, detector.chosen], [0.0, -np.log(0.025) / hours], rtol=1e-3)


def test_a_limit_that_is_always_exceeded_is_not_taken_for_a_quiet_one():
    curve = curve_of(WanderingZone(), scene(track(1.0 + weave(300.0, 0.3, 9.0))))
    rate = curve.sensitive_rate()
    assert (np.diff(rate) <= 0.0).all()
    assert curve.tuned(0.0) > 0 and rate[curve.tuned(0.0)] == 0.0


@pytest.mark.parametrize("sensor", [Sensor(delay=0.5), Sensor(rate=2.0), Sensor(delay=0.3, rate=5.0)])
def test_delay_and_rate_shift_and_hold_what_is_seen(sensor):
    lateral = weave(60.0, 0.5, 12.0)
    (view, _) = views_of(scene(track(lateral)), sensor, 0)
    time = view.track.time
    known = np.floor((time - sensor.delay) * sensor.rate + 1e-6) / sensor.rate
    wanted = np.interp(np.maximum(known, 0.0), time, view.track.lateral)
    later = time > 1.5
    np.testing.assert_allclose(view.towards[later], wanted[later], atol=1e-9)


def test_noise_has_its_spread_and_is_the_same_for_the_same_seed():
    made = scene(track(np.zeros(6000)))
    one, same, other = (views_of(made, Sensor(noise=0.05), seed)[0].towards for seed in (1, 1, 2))
    assert one.std() == pytest.approx(0.05, rel=0.03)
    assert (one == same).all() and (one != other).any()
