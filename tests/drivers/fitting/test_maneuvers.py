"""The law of lane changes against textbook figures of the same numbers."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, sqrt
from statistics import mean, stdev

import numpy as np
import pytest
from scipy.stats import binomtest, linregress

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.fitting.maneuvers import LEAST_CHANGES, MeasuredChanges, fit_maneuvers
from xosc_lateral.drivers.model.profile import Figure, Maneuvers

ALONE, BEHIND, HOURS, GIVEN_UP = 17, 23, 12.5, 6


@dataclass(frozen=True)
class Drawn:
    """Lane changes of which everything is known."""

    changes: MeasuredChanges
    law: Maneuvers


@pytest.fixture(scope="module")
def drawn() -> Drawn:
    rng = np.random.default_rng(3)
    gap = np.r_[np.full(ALONE, np.nan), rng.uniform(8.0, 80.0, BEHIND)]
    duration = np.exp(rng.normal(log(5.0), 0.3, ALONE + BEHIND))
    duration[ALONE:] *= (gap[ALONE:] / 30.0) ** 0.2
    left = rng.random(ALONE + BEHIND) < 0.4
    end = np.where(left, 0.1, -0.3) + 0.2 * rng.normal(size=len(left))
    end[3] = np.nan  # nobody saw where it ended
    changes = MeasuredChanges(duration, gap, rng.normal(0.5, 1.0, len(left)), end, left)
    before = {"left": np.array([[0.0, 0.1, 0.3], [0.0, 0.3, 0.5]]), "right": np.empty((0, 3))}
    law = fit_maneuvers(changes, before=before, hours=HOURS, aborted=GIVEN_UP, recording="made")
    return Drawn(changes, law)


def is_about(figure: Figure, value: float, error: float) -> bool:
    return tuple(figure) == pytest.approx((value, value - 1.96 * error, value + 1.96 * error), rel=1e-3, abs=1e-3)


def test_durations_are_medians_with_the_error_of_a_mean_logarithm(drawn: Drawn) -> None:
    logs = np.log(drawn.changes.duration[:ALONE]).tolist()
    error = 1.96 * stdev(logs) / sqrt(ALONE)
    wanted = [exp(mean(logs) + way * error) for way in (0, -1, 1)]
    assert tuple(drawn.law.duration_alone) == pytest.approx(wanted, rel=1e-3)
    assert is_about(drawn.law.spread_alone, stdev(logs), stdev(logs) / sqrt(2 * ALONE))


def test_behind_somebody_they_grow_with_a_power_of_the_gap_by_least_squares(drawn: Drawn) -> None:
    gaps, logs = np.log(drawn.changes.gap[ALONE:]), np.log(drawn.changes.duration[ALONE:])
    line = linregress(gaps, logs)
    assert is_about(drawn.law.gap_exponent, line.slope, line.stderr * sqrt((BEHIND - 2) / (BEHIND - 1)))
    rest = (logs - line.slope * (gaps - gaps.mean())).tolist()
    assert drawn.law.duration_behind.value == pytest.approx(exp(mean(rest)), rel=1e-3)
    assert is_about(drawn.law.spread_behind, stdev(rest), stdev(rest) / sqrt(2 * BEHIND))
    known = drawn.changes.gap[ALONE:]
    wanted = (exp(gaps.mean()), *np.quantile(np.log(known), (0.05, 0.95)))
    assert (drawn.law.gap.value, log(drawn.law.gap.low), log(drawn.law.gap.high)) == pytest.approx(wanted, rel=1e-3)


def test_shares_have_wilsons_interval_and_the_rate_that_of_a_count(drawn: Drawn) -> None:
    n, lefts = ALONE + BEHIND, int(drawn.changes.left.sum())
    counts = ((drawn.law.behind, BEHIND, n), (drawn.law.left, lefts, n), (drawn.law.given_up, GIVEN_UP, n + GIVEN_UP))
    for figure, count, of in counts:
        interval = binomtest(count, of).proportion_ci(method="wilson")
        assert tuple(figure) == pytest.approx((count / of, interval.low, interval.high), rel=1e-3)
    assert is_about(drawn.law.rate, n / HOURS, sqrt(n) / HOURS)
    assert (drawn.law.changes, drawn.law.hours, drawn.law.recording) == (n, HOURS, "made")


def test_ends_speeds_and_ways_are_those_of_their_side(drawn: Drawn) -> None:
    for side, rows in (("left", drawn.changes.left), ("right", ~drawn.changes.left)):
        for had, values in ((drawn.law.end, drawn.changes.end), (drawn.law.speed_change, drawn.changes.speed_change)):
            known = [value for value in values[rows].tolist() if value == value]
            assert is_about(had[side].mean, mean(known), stdev(known) / sqrt(len(known)))
            assert is_about(had[side].deviation, stdev(known), stdev(known) / sqrt(2 * len(known)))
    assert {side: list(way) for side, way in drawn.law.before.items()} == {"left": pytest.approx([0.0, 0.2, 0.4])}


@pytest.mark.parametrize("gap", [np.nan, 40.0], ids=["nobody ahead", "all behind somebody"])
def test_where_all_are_alike_both_durations_are_those_of_all(gap: float) -> None:
    n = LEAST_CHANGES
    duration = np.linspace(3.0, 7.0, n)
    changes = MeasuredChanges(duration, np.full(n, gap), np.zeros(n), np.full(n, np.nan), np.ones(n, dtype=np.bool_))
    law = fit_maneuvers(changes, before={}, hours=1.0, aborted=0.0, recording="")
    median = exp(np.log(duration).mean())
    assert law.duration_alone.value == law.duration_behind.value == pytest.approx(median, rel=1e-3)
    assert abs(law.gap_exponent.value) < 1e-3 and law.left.value == law.left.high == 1.0 and not law.end
    assert law.gap.value == pytest.approx(1.0 if np.isnan(gap) else gap)
    with pytest.raises(NotEnoughDataError, match=f"{n - 1} lane changes .* takes {n}"):
        fit_maneuvers(changes._make(part[1:] for part in changes), before={}, hours=1.0, aborted=0.0, recording="")
