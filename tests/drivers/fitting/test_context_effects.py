"""What class, lane and speed do is found where it is planted, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.kit.runs import made_run, smooth_runs
from xosc_lateral.base.errors import DriverProfileError, NotEnoughDataError
from xosc_lateral.drivers.drives.drive import CutRules, Drive, Run
from xosc_lateral.drivers.fitting.context_effects import (
    FADING_DISTANCE,
    LEAST_DRIVES,
    _shapes,
    _shrunk,
    fit_context_effects,
    without_effects,
)
from xosc_lateral.drivers.fitting.fitting import fit_population, fit_profile
from xosc_lateral.drivers.model.core.autoregressive.parameters import split_bands
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.drivers.model.sampled_offsets import segment_of
from xosc_lateral.drivers.model.sampling import sample_offsets


def population(
    seed: int, *, truck: float = 0.0, lane: float = 0.0, spread: float = 0.0, fine: float = 0.0, drivers: int = 60
) -> list[Run]:
    """Drivers of 60 s: every third a truck, at most 25 m/s; lanes at random, overtaking ones faster. [m], [-]

    Fine movement is white and has a standard deviation of 1 cm at 28 m/s.
    """
    rng = np.random.default_rng([seed, 1])
    runs = []
    for k, run in enumerate(smooth_runs(drivers, 60.0, seed=seed)):
        is_truck, in_right = float(k % 3 == 0), float(rng.random() < 0.5)
        speed = 22.0 + 3.0 * rng.random() if is_truck else 26.0 + 6.0 * rng.random() + 6.0 * (1.0 - in_right)
        level = run.offset.mean()
        moved = level + (run.offset - level) * np.exp(spread * (speed - 28.0)) + truck * is_truck + lane * in_right
        n = len(run)
        moved += 0.01 * np.exp(fine * (speed - 28.0)) * rng.normal(size=n)
        context = {"is_truck": np.full(n, is_truck), "lane_index": np.full(n, 1.0 - in_right)}
        runs.append(made_run(moved, drive=run.drive, speed=speed, **context))
    return runs


def test_what_is_planted_is_found_with_its_size():
    found = fit_context_effects(population(1, truck=-0.5, lane=0.35, spread=0.08, fine=-0.05))
    by = {(effect.acts, effect.columns): effect for effect in found}
    for key, size in (
        ((Acts.LOCATION, ("is_truck",)), -0.5),
        ((Acts.LOCATION, ("lane_index",)), 0.35),
        ((Acts.SPREAD, ("speed",)), 0.08),
        ((Acts.FINE, ("speed",)), -0.05),
    ):
        effect = by[key]
        slope, error = effect.coefficients[-1], effect.errors[-1]
        slope = -slope if key[1] == ("speed",) else slope  # the last knot takes the slope back
        assert abs(slope - size) < 4.0 * error
        assert error < 0.3 * abs(size)


def test_where_nothing_is_most_find_nothing_and_none_finds_much():
    # The three slopes of a response are kept when their squared size is above three, by chance with p = 0.39; of 60
    # responses 23 on average, with a standard deviation of 4.
    found = [fit_context_effects(population(seed)) for seed in range(10, 30)]
    assert sum(map(len, found)) <= 3 * (23 + 3 * 4)
    # Shrunk by three over that size, one of 180 slopes is hardly ever beyond two and a half of its own errors.
    assert sum(abs(effect.coefficients[-1]) > 2.5 * effect.errors[-1] for one in found for effect in one) <= 2


@pytest.mark.parametrize(("size", "share"), [(1.0, 0.0), (3.0, 0.0), (4.0, 0.25), (300.0, 0.99)])
def test_slopes_lose_what_chance_makes_of_their_squared_size(size: float, share: float):
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]])
    slopes = np.linalg.cholesky(covariance) @ np.full(3, np.sqrt(size / 3.0))
    np.testing.assert_allclose(_shrunk(slopes, covariance), share * slopes, atol=1e-12)


def test_too_few_drives_and_missing_columns_give_none():
    assert fit_context_effects(population(2, truck=-0.5, drivers=LEAST_DRIVES - 1)) == ()
    assert fit_context_effects([]) == ()
    bare = [made_run(run.offset, drive=run.drive) for run in population(2, truck=-0.5)]
    assert fit_context_effects(bare) == ()  # everybody at one speed


def test_a_speed_that_only_jitters_acts_on_nothing():
    """Everybody at 24 m/s, known by positions: an effect of that noise would make every row jitter."""
    for seed in range(5):
        rng = np.random.default_rng([seed, 7])
        still = smooth_runs(40, 60.0, seed)
        runs = [replace(run, context={"speed": rng.normal(24.0, 0.15, len(run))}) for run in still]
        assert fit_context_effects(runs) == ()
        drives = [replace(run, context={"speed": run.context["speed"] + rng.normal(0.0, 1.0)}) for run in runs]
        assert _shapes(drives), "drives at different speeds are asked"


def test_what_is_taken_out_is_gone():
    runs = population(3, truck=-0.5, lane=0.35, spread=0.08, fine=-0.05)
    for effect in fit_context_effects(without_effects(runs, fit_context_effects(runs))):
        assert abs(effect.coefficients[-1]) < 2.5 * effect.errors[-1]


def test_slow_and_fast_movement_are_freed_each_of_its_own():
    run = population(5)[0]
    shape = {"column": "is_truck", "reference": (0.0,), "errors": (0.1,)}
    context = {**run.context, "is_truck": np.ones(len(run))}
    effects = [
        Linear(acts=Acts.SPREAD, coefficients=(0.7,), **shape),
        Linear(acts=Acts.FINE, coefficients=(-0.4,), **shape),
    ]
    (freed,) = without_effects([replace(run, context=context)], effects)
    level = run.offset.mean()
    slow, fast = split_bands(run.offset - level, 0.2)
    np.testing.assert_allclose(freed.offset - level, slow * np.exp(-0.7) + fast * np.exp(0.4), atol=1e-12)


@pytest.mark.parametrize("is_truck", [0.0, 1.0])
def test_one_profile_gives_trucks_and_cars_their_own_level(is_truck: float):
    runs = population(4, truck=-0.5)
    profile = fit_population(runs, name="all")
    n = len(runs[0])
    like = made_run(np.zeros(n), is_truck=np.full(n, is_truck), lane_index=np.zeros(n), speed=24.0)
    sampled = [sample_offsets(profile, segment_of(like), np.random.SeedSequence(k)).mean() for k in range(60)]
    measured = [run.offset.mean() for run in runs if run.context["is_truck"][0] == is_truck]
    error = np.hypot(np.std(sampled) / np.sqrt(len(sampled)), np.std(measured) / np.sqrt(len(measured)))
    assert abs(np.mean(sampled) - np.mean(measured)) < 3.5 * error


def beside_others(seed: int, left: float, right: float) -> list[Run]:
    """Drivers of 60 s whom others overtake on the left, or whom they overtake on the right, once each. [m]"""
    rng, runs = np.random.default_rng([seed, 2]), []
    for k, run in enumerate(smooth_runs(60, 60.0, seed=seed)):
        side, strength = ("left_distance", left) if k % 2 else ("right_distance", right)
        distance = np.maximum(np.abs(rng.uniform(3.0, 8.0) * (run.time - run.time[0] - rng.uniform(10.0, 50.0))) - 5, 0)
        distance[distance > 150.0] = np.inf if k % 3 else np.nan
        moved = run.offset + strength * np.exp(-np.nan_to_num(distance, nan=np.inf) / FADING_DISTANCE)
        runs.append(made_run(moved, drive=run.drive, speed=30.0, **{side: distance}))
    return runs


def test_what_neighbours_do_is_found_with_its_size_and_is_nothing_where_there_are_none():
    runs = beside_others(5, left=-0.3, right=0.5)
    found = {effect.columns[0]: effect for effect in fit_context_effects(runs)}
    for column, size in (("left_distance", -0.3), ("right_distance", 0.5)):
        assert found[column].acts is Acts.LOCATION
        assert found[column].coefficients[0] == pytest.approx(size, abs=4.0 * found[column].errors[0])
        assert found[column].errors[0] < 0.3 * abs(size)
        assert not found[column].strength(0.2, {column: np.full(9, np.inf)}).any()
        assert not found[column].strength(0.2, {column: np.full(9, np.nan)}).any()
    assert tuple(found.values()) == fit_context_effects(runs, neighbours=True)
    assert fit_context_effects(runs, neighbours=False) == ()


def test_a_side_on_which_few_drives_had_anybody_is_left_alone():
    lonely = {run.drive for run in beside_others(5, -0.3, 0.5)[1:4:2]}  # two of those with somebody on the left
    runs = [
        run if run.drive not in lonely else replace(run, context={"speed": run.context["speed"]})
        for run in beside_others(5, -0.3, 0.5)
    ]
    assert [effect.columns for effect in fit_context_effects(runs)] == [("right_distance",)]
    far = [
        replace(run, context={**run.context, "left_distance": np.full(len(run), FADING_DISTANCE + 1.0)}) for run in runs
    ]
    assert [effect.columns for effect in fit_context_effects(far)] == [("right_distance",)]


def test_neighbours_that_cannot_be_fitted_are_refused_where_asked_for_and_passed_over_where_not():
    few = beside_others(5, -0.3, 0.5)[: LEAST_DRIVES - 1]
    rare = [run if k < 9 else replace(run, context={}) for k, run in enumerate(beside_others(5, -0.3, 0.5))]
    for runs, why in (
        (population(1), "no drive has a neighbour"),
        (few, "takes 30 drives at least, these are 29"),
        (rare, "takes 30 drives that have one within 40 m on the same side, these are 5"),
    ):
        with pytest.raises(NotEnoughDataError, match=why):
            fit_context_effects(runs, neighbours=True)
        assert fit_context_effects(runs) == fit_context_effects(runs, neighbours=False)


def test_the_paper_s_model_has_no_neighbours():
    drive = Drive("a", *(np.arange(100.0), np.zeros(100), np.full(100, 3.5)), {"speed": np.full(100, 30.0)})
    rules = CutRules(max_gap=2.0)
    with pytest.raises(DriverProfileError, match="without what neighbours do"):
        fit_profile([drive], name="paper", model="two-level", rules=rules, neighbours=True)
    assert not fit_profile([drive], name="paper", model="two-level", rules=rules).effects


MEAN_OF_HALF_A_WAVE = 2.0 / np.pi
