"""Criteria and models against what the regulation's numbers say by hand."""

from __future__ import annotations

import numpy as np
import pytest

from laboratory.r157.braking import evaluate_braking
from laboratory.r157.competent_driver import CompetentDriver
from laboratory.r157.cut_in import (
    CRITERIA,
    Encounter,
    alarms,
    crosses_in_time,
    first_alarm,
    intrudes,
    is_perceived,
    leaves_wandering_zone,
)
from laboratory.r157.encounters import Ego, Traffic
from laboratory.r157.fuzzy_safety import FuzzySafetyModel, critical_metric, proactive_metric
from laboratory.r157.reaction_time import required_by_reaction_time

STEP, LANE = 0.02, 3.5


def _cut_in(
    gap: float, ego: float, target: float, *, lateral: float = 1.0, seconds: float = 12.0
) -> tuple[Traffic, Ego]:
    """A car in the next lane moves over at an even lateral speed from the first moment on."""
    time = STEP * np.arange(round(seconds / STEP))
    towards = np.minimum(lateral * time, LANE)[None]
    me = Ego(0.0, ego)
    place = gap + 0.5 * (me.length + 4.5) + target * time
    return Traffic(place[None], np.full((1, len(time)), target), towards, LANE - towards, LANE, 1.9, 4.5, STEP), me


def _seen(**given: float) -> Encounter:
    known = {"towards": 0.0, "lateral_speed": 0.0, "clearance": 1.6, "gap": 20.0, "closing": 5.0}
    values = {name: np.array([value]) for name, value in {**known, **given}.items()}
    return Encounter(**values, lane_width=LANE, width=1.9, length=4.5, ego_length=4.5)


def test_a_vehicle_leaves_its_wandering_zone_beyond_0_375_m_towards_the_ego_lane() -> None:
    assert leaves_wandering_zone(_seen(towards=0.376, lateral_speed=0.1))[0]
    assert not leaves_wandering_zone(_seen(towards=0.374, lateral_speed=0.1))[0]
    assert not leaves_wandering_zone(_seen(towards=0.5, lateral_speed=-0.1))[0]
    assert not leaves_wandering_zone(_seen(towards=-0.5, lateral_speed=0.1))[0]


def test_intrusion_is_the_side_0_3_m_beyond_the_marking() -> None:
    edge = LANE / 2 + 0.3 - 0.95
    assert not intrudes(_seen(towards=edge - 0.01))[0]
    assert intrudes(_seen(towards=edge + 0.01))[0]


def test_the_fsm_compares_lateral_with_longitudinal_headway() -> None:
    # Clearance 1.6 m at 0.2 m/s: 8 s. The ego has passed after (20 + 9) / 5 = 5.8 s: no danger. At 0.3 m/s: 5.3 s.
    assert not crosses_in_time(_seen(lateral_speed=0.2))[0]
    assert crosses_in_time(_seen(lateral_speed=0.3))[0]
    assert not crosses_in_time(_seen(lateral_speed=0.3, closing=-1.0))[0]
    assert crosses_in_time(_seen(clearance=-0.1))[0]


def test_the_fsm_adds_a_tenth_of_a_second_to_the_time_that_the_ego_needs() -> None:
    """The ego has passed after (20 + 9) / 5 = 5.8 s: whoever needs 5.89 s is too near, 5.91 s is far enough."""
    assert crosses_in_time(_seen(lateral_speed=1.6 / 5.89))[0]
    assert not crosses_in_time(_seen(lateral_speed=1.6 / 5.91))[0]
    # side by side counts until the middles have passed each other, and from then on no more
    assert crosses_in_time(_seen(clearance=-0.1, gap=-4.49))[0]
    assert not crosses_in_time(_seen(clearance=-0.1, gap=-4.51))[0]


def test_a_cut_in_is_perceived_beyond_what_one_covers_while_the_risk_is_weighed() -> None:
    """0.375 m of wandering and 0.72 m more: 1.8 m/s for 0.4 s."""
    assert is_perceived(_seen(towards=1.096, lateral_speed=0.1))[0]
    assert not is_perceived(_seen(towards=1.094, lateral_speed=0.1))[0]
    assert not is_perceived(_seen(towards=1.5, lateral_speed=0.0))[0]


def test_who_has_left_his_zone_further_has_left_it_for_every_criterion_that_did_so_before() -> None:
    """Nearer, faster and more overlapping never ends an alarm."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        towards, lateral, gap, closing = rng.uniform([0.0, 0.01, 1.0, 0.5], [3.0, 1.5, 60.0, 15.0])
        here = _seen(towards=towards, lateral_speed=lateral, clearance=1.6 - towards, gap=gap, closing=closing)
        more = _seen(
            towards=towards + 0.2, lateral_speed=lateral + 0.2, clearance=1.4 - towards, gap=gap, closing=closing
        )
        for name, criterion in CRITERIA.items():
            assert bool(criterion(more)[0]) >= bool(criterion(here)[0]), name


def test_alarms_are_beginnings() -> None:
    flags = np.array([[0, 1, 1, 0, 1], [1, 0, 0, 0, 0], [0, 0, 0, 0, 0]], dtype=bool)
    assert alarms(flags).tolist() == [2, 1, 0]
    np.testing.assert_array_equal(first_alarm(flags, 0.5), [0.5, 0.0, np.nan])


def test_paragraph_5_2_5_2_asks_for_what_its_formula_says() -> None:
    """At 20 km/h of difference the limit is 0.81 s: v / 12 + 0.35."""
    difference = 20 / 3.6
    limit = difference / 12 + 0.35
    assert limit == pytest.approx(0.81, abs=0.005)
    until = (LANE / 2 + 0.3 - 0.95) / 1.0  # s until intrusion at 1 m/s
    for margin, asked in ((0.08, True), (-0.08, False)):
        traffic, ego = _cut_in(difference * (limit + until + margin), 16.0, 16.0 - difference)
        outcome = required_by_reaction_time(traffic, ego)
        assert bool(outcome.prevented[0]) is asked
        assert outcome.noticed[0] == pytest.approx(until, abs=2 * STEP)


def test_the_competent_driver_brakes_after_wandering_evaluation_and_delay() -> None:
    traffic, ego = _cut_in(15.0, 20.0, 12.0)
    outcome = evaluate_braking(CompetentDriver(), traffic, ego)
    assert outcome.noticed[0] == pytest.approx(0.375 + 0.4, abs=0.05)  # TTC is 15 / 8 s, below 2 s from the start
    assert outcome.braking[0] == pytest.approx(0.375 + 0.4 + 0.75, abs=0.06)


def test_the_competent_drivers_limit_is_the_way_that_braking_takes() -> None:
    """Closed form: coasting 0.75 s, jerk for 0.58 s, then 0.774 g until the speeds are equal."""
    difference, time = 10.0, 1e-4 * np.arange(60_000)
    ramp = np.clip(0.4 + 12.65 * (time - 1.525), 0.4, 0.774 * 9.81)
    brake = np.where(time < 0.775, 0.0, np.where(time < 1.525, 0.4, ramp))
    relative = np.maximum(difference - np.cumsum(brake) * 1e-4, 0.0)
    needed = float(relative.sum() * 1e-4)
    for margin, prevented in ((0.6, True), (-0.6, False)):
        traffic, ego = _cut_in(needed + margin, 25.0, 15.0)
        assert bool(evaluate_braking(CompetentDriver(), traffic, ego).prevented[0]) is prevented, margin


def test_fuzzy_metrics_at_their_corners() -> None:
    ego, target = np.array([20.0]), np.array([15.0])
    safe = 20 * 0.75 + 400 / 8 - 225 / 14 + 2 + 2
    unsafe = 20 * 0.75 + 400 / 12 - 225 / 14 + 2
    for gap, value in ((safe, 0.0), (unsafe, 1.0), ((safe + unsafe) / 2, 0.5)):
        assert proactive_metric(np.array([gap]), ego, target)[0] == pytest.approx(value, abs=1e-9)
    still = np.zeros(1)
    near, far = 5 * 0.75 + 25 / 12, 5 * 0.75 + 25 / 8
    for gap, value in ((far, 0.0), (near, 1.0), ((near + far) / 2, 0.5)):
        assert critical_metric(np.array([gap]), ego, target, still)[0] == pytest.approx(value, abs=1e-9)
    assert critical_metric(np.array([1.0]), target, ego, still)[0] == 0.0  # the other one is faster


def test_the_fsm_prevents_more_than_the_competent_driver() -> None:
    """The published finding: anticipation reduces the number of unpreventable cut-ins (Mattas et al. 2022)."""
    cases = [_cut_in(gap, 16.7, 5.6, lateral=v, seconds=10.0)[0] for gap in range(4, 40, 2) for v in (0.5, 1.0, 1.5)]
    stacked = {
        name: np.concatenate([getattr(case, name) for case in cases])
        for name in ("position", "speed", "towards", "distance")
    }
    traffic, ego = Traffic(**stacked, lane_width=LANE, width=1.9, length=4.5, step=STEP), Ego(0.0, 16.7)
    fsm, driver = (evaluate_braking(model, traffic, ego).prevented for model in (FuzzySafetyModel(), CompetentDriver()))
    assert fsm.sum() > driver.sum() > 0


def test_a_vehicle_that_stays_in_its_lane_harms_nobody() -> None:
    traffic, ego = _cut_in(10.0, 20.0, 10.0, lateral=0.0)
    for model in (FuzzySafetyModel(), CompetentDriver()):
        outcome = evaluate_braking(model, traffic, ego)
        assert outcome.prevented[0] and np.isnan(outcome.smallest_gap[0]) and np.isnan(outcome.braking[0])
    assert len(CRITERIA) == 4
