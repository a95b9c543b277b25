"""A spread that grows with time: honest under the null, found and sized where it was planted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.identification.made_coarse import coarse_of, movement
from xosc_lateral.driver.effects import VarianceTrend
from xosc_lateral.identification.regression import Coarse, Fitted, fit_model
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.stages import ERROR_BUDGET
from xosc_lateral.identification.terms.base import Removal
from xosc_lateral.identification.terms.variance_trend import VarianceTrendTerm, _probability

SECONDS = 2400.0
N = round(SECONDS / 0.2)


def growing(factor: float, seed: int) -> Coarse:
    """0.1 m of movement that is `factor` times as large at the end as at the beginning."""
    own = movement(np.random.default_rng(seed), SECONDS)
    return coarse_of(own * factor ** (np.arange(N) / N - 0.5))


def search_of(coarse: Coarse) -> Search:
    return Search.over(coarse, [], np.random.SeedSequence(1), ERROR_BUDGET)


def outcome_of(coarse: Coarse) -> tuple[VarianceTrendTerm, float]:
    outcome = VarianceTrendTerm.test(search_of(coarse), fit_model(coarse, ()))
    assert outcome is not None
    assert isinstance(outcome.term, VarianceTrendTerm)
    return outcome.term, outcome.p_value


@pytest.fixture(scope="module")
def fitted() -> Fitted:
    return fit_model(growing(1.8, 71), (VarianceTrendTerm(),))


def test_p_values_of_white_rows_are_even() -> None:
    coarse = growing(1.0, 72)
    rng, nothing = np.random.default_rng(73), np.zeros((len(coarse), 0))
    values = [
        _probability(SimpleNamespace(coarse=coarse, innovations=rng.normal(size=len(coarse))), False, nothing)  # type: ignore[arg-type]
        for _ in range(300)
    ]
    assert stats.kstest(values, "uniform").pvalue > 0.001


def test_loudness_in_clusters_is_no_trend_more_often_than_it_is_said() -> None:
    """A quarter of an hour of seconds whose loudness lasts for 20 s: counted as independent, a third would be sure."""
    coarse = growing(1.0, 74)
    n = len(coarse)
    rng, nothing = np.random.default_rng(75), np.zeros((n, 0))
    values = []
    for _ in range(200):
        loud = np.repeat(np.exp(0.6 * rng.normal(size=n // 20 + 1)), 20)[:n]
        values.append(
            _probability(SimpleNamespace(coarse=coarse, innovations=loud * rng.normal(size=n)), False, nothing)
        )  # type: ignore[arg-type]
    assert np.mean(np.array(values) < 0.05) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 200)


def test_a_steady_growth_is_sure_and_a_steady_drive_is_not() -> None:
    assert outcome_of(growing(1.8, 76))[1] < ERROR_BUDGET.level_of("variance_trend", 1)
    assert outcome_of(growing(1.0, 77))[1] > ERROR_BUDGET.level_of("variance_trend", 1)


def test_the_factor_is_sized_within_its_error(fitted: Fitted) -> None:
    (effect,) = fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined]
    assert isinstance(effect, VarianceTrend)
    assert effect.factor == pytest.approx(1.8, abs=4.0 * effect.factor_error)
    assert effect.factor_error < 0.25
    assert effect.fine_factor == pytest.approx(1.8, rel=0.1)
    seen = fitted.coarse.time[fitted.coarse.valid]
    assert (effect.from_s, effect.to_s) == (seen.min(), seen.max())


def test_backwards_it_shrinks_by_the_inverse() -> None:
    there, back = (fit_model(coarse, (VarianceTrendTerm(),)) for coarse in (growing(1.8, 78), growing(1.0 / 1.8, 78)))
    grown, shrunk = (one.terms[0].estimate(one)[0] for one in (there, back))  # type: ignore[attr-defined]
    assert grown.factor * shrunk.factor == pytest.approx(1.0, abs=0.15)


def test_taken_out_it_is_a_function_of_time_alone(fitted: Fitted) -> None:
    term, timeline = fitted.terms[0], fitted.coarse.timeline
    effects = term.estimate(fitted)  # type: ignore[attr-defined]
    removal = Removal(np.zeros(len(timeline)))
    term.remove(fitted, effects, removal)  # type: ignore[attr-defined]
    inside = removal.spread[timeline.valid]
    assert inside[-1] - inside[0] == pytest.approx(np.log(effects[0].factor), rel=1e-3)
    np.testing.assert_allclose(np.diff(inside, 2)[10:-10], 0.0, atol=1e-9)  # its ends are those of whole seconds
    assert (removal.location == 0.0).all()


@pytest.mark.parametrize(("factor", "name"), [(1.5, "growing spread"), (0.7, "shrinking spread")])
def test_it_is_told_by_which_way_it_goes(factor: float, name: str) -> None:
    told = VarianceTrendTerm().describe(None, (VarianceTrend(factor=factor, factor_error=0.1),), "")  # type: ignore[arg-type]
    assert (told.name, told.size, told.error) == (name, factor, 0.1)


def test_slow_and_quick_growth_are_one_finding_and_looked_for_once(fitted: Fitted) -> None:
    assert VarianceTrendTerm().matches(VarianceTrendTerm(slow=True))
    assert VarianceTrendTerm.test(search_of(fitted.coarse), fitted) is None


def test_only_growth_of_the_innovations_can_be_predicted() -> None:
    assert VarianceTrendTerm().predictable
    assert not VarianceTrendTerm(slow=True).predictable


def test_drives_of_minutes_have_no_trend() -> None:
    coarse = coarse_of(movement(np.random.default_rng(79), 400.0))
    assert VarianceTrendTerm.test(search_of(coarse), fit_model(coarse, ())) is None
