"""What changes with time: honest where nothing does, found, sized and sampled in its place where something does."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.kit.coarse import coarse_of, movement
from tests.kit.profiles import whole_terms
from xosc_lateral.drivers.model.effects import Step, TimeSmooth
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.low_frequencies import (
    SHORTEST_S,
    SPREAD_ORDERS,
    half_cosines_of,
    low_frequencies,
    mean_probability,
    smooth_probabilities,
)
from xosc_lateral.extras.loop.model import Fitted, fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.terms.time import StepTerm, TimeMeanTerm, TimeSpreadTerm, penalised_cosines
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 2400.0
N = round(SECONDS / 0.2)
SHARE = np.arange(N) / N


def search_of(coarse: Coarse) -> Search:
    return Search.over(coarse, [], np.random.SeedSequence(1), ERROR_BUDGET)


def mean_test(shift: np.ndarray, seed: int) -> tuple[object, float]:
    coarse = coarse_of(shift + movement(np.random.default_rng(seed), SECONDS))
    outcome = StepTerm.test(search_of(coarse), fit_model(coarse, ()))
    assert outcome is not None
    return outcome.term, outcome.p_value


def spread_test(log_spread: np.ndarray, seed: int) -> tuple[TimeSpreadTerm, float, Coarse]:
    coarse = coarse_of(np.exp(log_spread) * movement(np.random.default_rng(seed), SECONDS))
    outcome = TimeSpreadTerm.test(search_of(coarse), fit_model(coarse, ()))
    assert outcome is not None
    assert isinstance(outcome.term, TimeSpreadTerm)
    return outcome.term, outcome.p_value, coarse


RISE_AND_FALL = 0.4 * np.cos(2.0 * np.pi * (SHARE - 0.5))
LEARNING = 0.8 * np.exp(-5.0 * SHARE)


@pytest.mark.parametrize("shape", [RISE_AND_FALL, LEARNING], ids=["rises and falls", "dies away"])
def test_a_spread_of_any_smooth_shape_is_found_and_put_where_it_was(shape: np.ndarray) -> None:
    term, p_value, coarse = spread_test(shape, 71)
    assert p_value < ERROR_BUDGET["time_spread"]
    fitted = fit_model(coarse, (term,))
    (effect,) = fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined]
    assert isinstance(effect, TimeSmooth)
    inside = coarse.timeline.valid
    path = effect.path(effect.spread, coarse.timeline.time)[inside]
    assert np.corrcoef(path, shape[inside])[0, 1] > 0.85
    assert np.ptp(path) == pytest.approx(np.ptp(shape[inside]), rel=0.35)


def test_a_mean_that_dies_away_is_a_smooth_and_a_jump_a_step() -> None:
    smooth, p_smooth = mean_test(0.3 * np.exp(-3.0 * SHARE), 72)
    step, p_step = mean_test(0.25 * (SHARE > 0.4), 73)
    level = ERROR_BUDGET["time_mean"]
    assert isinstance(smooth, TimeMeanTerm)
    assert p_smooth < level
    assert isinstance(step, StepTerm)
    assert p_step < level
    assert step.at == pytest.approx(0.4 * SECONDS, abs=5.0)


@pytest.mark.parametrize("seed", [74, 75])
def test_a_mean_and_a_spread_that_stay_are_not_found(seed: int) -> None:
    assert mean_test(np.zeros(N), seed)[1] > 0.01
    assert spread_test(np.zeros(N), seed)[1] > 0.01


def test_p_values_of_white_rows_are_even() -> None:
    coarse = coarse_of(movement(np.random.default_rng(76), SECONDS))
    rng = np.random.default_rng(77)
    columns = low_frequencies(half_cosines_of(coarse, 4), coarse, coarse.valid, SHORTEST_S)
    values = [smooth_probabilities(rng.normal(size=len(columns)), columns, (4,))[4] for _ in range(300)]
    assert stats.kstest(values, "uniform").pvalue > 0.001


def test_loudness_in_clusters_changes_with_time_no_more_often_than_it_is_said() -> None:
    coarse = coarse_of(movement(np.random.default_rng(78), SECONDS))
    rng, n = np.random.default_rng(79), len(coarse)
    columns = low_frequencies(half_cosines_of(coarse, 4), coarse, coarse.valid, SHORTEST_S)
    values = []
    for _ in range(200):
        squares = np.square(np.repeat(np.exp(0.6 * rng.normal(size=n // 20 + 1)), 20)[:n] * rng.normal(size=n))
        own = low_frequencies(squares[:, None], coarse, coarse.valid, SHORTEST_S)[:, 0]
        values.append(min(smooth_probabilities(own, columns, SPREAD_ORDERS).values()) * len(SPREAD_ORDERS))
    assert np.mean(np.array(values) < 0.05) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 200)


def test_the_best_of_many_steps_is_no_surer_than_chance_makes_it() -> None:
    rng = np.random.default_rng(80)
    jumps = np.cumsum(rng.normal(size=(30, 40)), axis=1)
    values = [mean_probability(rng.normal(size=30), jumps[:, :8], jumps, rng) for _ in range(100)]
    assert np.mean(np.array(values) < 0.1) < 0.1 + 4.0 * np.sqrt(0.1 * 0.9 / 100)


def test_rough_sizes_are_penalised_more_than_smooth_ones() -> None:
    sizes, errors = penalised_cosines(np.array([1.0, 0.1, 0.1, 0.1]), 0.01 * np.eye(4))
    kept = sizes / np.array([1.0, 0.1, 0.1, 0.1])
    assert (np.diff(kept) < 0.0).all()
    assert kept[0] > 0.95
    assert (np.square(errors) <= 0.01).all()
    assert penalised_cosines(np.zeros(3), np.eye(3))[0].tolist() == [0.0, 0.0, 0.0]


def fitted_with(term: object, offset: np.ndarray) -> Fitted:
    return fit_model(coarse_of(offset), (term,))  # type: ignore[arg-type]


def test_what_is_removed_is_what_the_profile_gets() -> None:
    rng = np.random.default_rng(81)
    fitted = fitted_with(TimeMeanTerm(4), 0.3 * np.exp(-3.0 * SHARE) + movement(rng, SECONDS))
    term, timeline = fitted.terms[0], fitted.coarse.timeline
    effects = term.estimate(fitted)  # type: ignore[attr-defined]
    ((acts, removed),) = term.removed(fitted, effects)  # type: ignore[attr-defined]
    inside = timeline.valid
    sampled = whole_terms(effects[0], timeline.time, {}, rng).location
    np.testing.assert_allclose(np.diff(removed[inside]), np.diff(sampled[inside]), atol=1e-12)
    assert removed[inside].mean() == pytest.approx(0.0, abs=1e-9)
    assert acts == "location"


def test_mirrored_drives_have_mirrored_smooths() -> None:
    offset = 0.3 * np.exp(-3.0 * SHARE) + movement(np.random.default_rng(82), SECONDS)
    there, back = (fitted_with(TimeMeanTerm(4), sign * offset) for sign in (1.0, -1.0))
    first, second = (one.terms[0].estimate(one)[0] for one in (there, back))  # type: ignore[attr-defined]
    np.testing.assert_allclose(first.location, -np.asarray(second.location), rtol=1e-9)


def test_a_step_is_sized_in_its_place() -> None:
    fitted = fitted_with(
        StepTerm(at=1000), 0.2 * (SHARE * SECONDS > 1000.0) + movement(np.random.default_rng(83), SECONDS)
    )
    (effect,) = fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined]
    assert isinstance(effect, Step)
    assert effect.size == pytest.approx(0.2, abs=4.0 * effect.size_error)


def test_they_are_described_from_extreme_to_extreme_in_the_order_of_time() -> None:
    coarse = coarse_of(movement(np.random.default_rng(84), SECONDS))
    fitted = SimpleNamespace(coarse=coarse)
    seen = coarse.time[coarse.valid]
    ends = {"from_s": float(seen.min()), "to_s": float(seen.max())}
    effect = TimeSmooth(location=(0.1,), location_errors=(0.01,), **ends)
    told = TimeMeanTerm(1).describe(fitted, (effect,), "drift 0")  # type: ignore[arg-type]
    assert (told.size_m, told.size_error) == (pytest.approx(-0.2, rel=1e-3), pytest.approx(0.02, rel=1e-3))
    louder = TimeSmooth(spread=(-0.2,), spread_errors=(0.01,), **ends)
    told = TimeSpreadTerm(1).describe(fitted, (louder,), "time_spread 0")  # type: ignore[arg-type]
    assert told.size_m == pytest.approx(np.exp(0.4), rel=1e-3)


def test_drives_of_minutes_do_not_change_with_time() -> None:
    coarse = coarse_of(movement(np.random.default_rng(85), 400.0))
    fitted = fit_model(coarse, ())
    assert StepTerm.test(search_of(coarse), fitted) is None
    assert TimeSpreadTerm.test(search_of(coarse), fitted) is None


def test_drives_of_one_driver_change_alike() -> None:
    """Two drives, each louder in its middle."""
    rng = np.random.default_rng(86)
    shape = np.tile(RISE_AND_FALL, 2)
    own = np.concatenate([movement(rng, SECONDS), movement(rng, SECONDS)])
    coarse = coarse_of(np.exp(shape) * own, drives=2)
    outcome = TimeSpreadTerm.test(search_of(coarse), fit_model(coarse, ()))
    assert outcome is not None
    assert outcome.p_value < ERROR_BUDGET["time_spread"]


def change(form: str, size: float) -> Coarse:
    """40 min of 0.1 m of movement whose mean changes in a form, and a switch that goes on when a step would be."""
    rng = np.random.default_rng(71)
    n = round(2400.0 / 0.2)
    time = 0.2 * np.arange(n)
    switch = (time > 1000.0).astype(float)
    course = {"step": switch, "settling": np.exp(-time / 300.0), "smooth": 0.5 * np.cos(np.pi * time / 2400.0)}[form]
    return coarse_of(size * course + movement(rng, 2400.0, 3.0), {"switch": switch})


@pytest.mark.parametrize("form", ["step", "settling", "smooth"])
def test_the_true_form_of_a_change_is_never_ruled_out(form: str) -> None:
    coarse = change(form, 0.2)
    columns = [Column("switch", Values.SWITCH, False, levels=(0.0, 1.0))]
    test = StepTerm.test(Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET), fit_model(coarse, ()))
    assert test is not None and test.term is not None
    assert test.p_value < ERROR_BUDGET["time_mean"]
    named = "step" if isinstance(test.term, StepTerm) else test.term.form
    assert form in (named, *test.term.others)
    # a column that changes once, just then, is a candidate as well
    assert (("switch",) in test.term.alike) is (form == "step")
