"""Drives as units: what all change alike, what differs between them, and what nobody can tell from so few."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, stats

from tests.kit.coarse import PAD, SPREAD, STEP, coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Factor, Linear, Product
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.drives import PRIOR_DRIVES, own_slopes, regress, slope_alike, slopes_where_it_acts
from xosc_lateral.extras.loop.model import Fitted, fit_model
from xosc_lateral.extras.loop.selection import BY_PRODUCT, ERROR_BUDGET, Accepted, Selection, select
from xosc_lateral.extras.loop.shown import Shown, what_drives_show
from xosc_lateral.extras.loop.terms.between import BetweenSpreadTerm, BetweenTerm, whole_drive_columns
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.time import ALIKE, StepTerm, TimeMeanTerm, TimeSpreadTerm, mean_alike, spread_alike
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 360.0
N = round(SECONDS / STEP)
SHARE = np.clip((np.arange(N) - PAD) / (N - 2 * PAD), 0.0, 1.0)
"""Of a drive of five and a half minutes."""


def drives(seed: int, shifts: np.ndarray, factors: np.ndarray, context: dict[str, np.ndarray] | None = None) -> Coarse:
    """One drive per row of the shifts and of the factors on its movement, shape (drives, n)."""
    rng = np.random.default_rng(seed)
    parts = [shift + factor * movement(rng, SECONDS) for shift, factor in zip(shifts, factors, strict=True)]
    return coarse_of(np.concatenate(parts), context, drives=len(parts))


def search_of(coarse: Coarse, *names: str) -> Search:
    columns = [Column(name, Values.NUMBER, False) for name in names]
    return Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET)


def test_a_slope_that_all_drives_have_is_tested_by_how_they_scatter() -> None:
    """By hand: three slopes of equal weight, the prior worth four drives."""
    coarse = drives(1, np.zeros((3, N)), np.ones((3, N)))
    column = np.where(coarse.valid, np.random.default_rng(2).normal(size=len(coarse)), 0.0)
    power = np.bincount(coarse.drive, column**2)
    column /= np.sqrt(power)[coarse.drive]
    slopes = np.array([1.0, 2.0, 3.0])
    pooled = slope_alike(slopes[coarse.drive] * column, column, coarse, 2.0)
    assert pooled is not None
    error = np.sqrt((PRIOR_DRIVES * 2.0 + 2.0) / (PRIOR_DRIVES + 2.0) / 3.0)
    assert (pooled.size, pooled.error) == (pytest.approx(2.0), pytest.approx(error))
    assert pooled.p_value == pytest.approx(2.0 * stats.t.sf(2.0 / error, PRIOR_DRIVES + 2.0))
    assert pooled.within == pytest.approx(stats.f.sf((1.0 + 4.0 + 9.0) / 3.0 / 2.0, 3, PRIOR_DRIVES))


def test_two_drives_do_not_say_whether_drives_change_alike() -> None:
    fitted = fit_model(drives(3, np.zeros((2, N)), np.ones((2, N))), ())
    assert mean_alike(fitted) is None
    assert spread_alike(fitted) is None


@pytest.mark.parametrize("seed", range(10, 14))
def test_short_drives_on_which_nothing_acts_are_silent(seed: int) -> None:
    coarse = drives(seed, np.zeros((5, N)), np.ones((5, N)))
    search, fitted = search_of(coarse), fit_model(coarse, ())
    for kind in (StepTerm, TimeSpreadTerm):
        outcome = kind.test(search, fitted)
        assert outcome is not None
        assert outcome.p_value > 0.01


def test_short_drives_that_drift_alike_have_a_mean_by_time() -> None:
    coarse = drives(21, np.tile(0.3 * SHARE, (6, 1)), np.ones((6, N)))
    (found,) = select(search_of(coarse)).accepted
    assert isinstance(found.term, TimeMeanTerm)


def growing(ways: list[float], seed: int) -> Coarse:
    factors = np.stack([np.exp(way * (SHARE - 0.5)) for way in ways])
    return drives(seed, np.zeros((len(ways), N)), factors)


def test_short_drives_that_grow_restless_alike_have_a_spread_by_time() -> None:
    coarse = growing([1.1] * 5, 22)
    (found,) = select(search_of(coarse)).accepted
    assert isinstance(found.term, TimeSpreadTerm)


def test_drives_that_change_each_in_its_own_way_are_no_common_change() -> None:
    """Both questions have an answer of their own."""
    coarse = growing([1.6, -1.6, 1.5, -1.4, 1.6, -1.7], 23)
    search, fitted = search_of(coarse), fit_model(coarse, ())
    outcome, alike = TimeSpreadTerm.test(search, fitted), spread_alike(fitted)
    assert outcome is not None and alike is not None
    assert outcome.term is None
    assert alike.within < ERROR_BUDGET["time_spread"]
    assert alike.p_value > ALIKE
    selected = select(search)
    assert not [one for one in selected.accepted if isinstance(one.term, TimeSpreadTerm)]
    (told,) = [one for one in selected.rejected if one.component == "time_spread"]
    assert "each in its own way" in told.why


def whole_drives(seed: int, number: int, shift: float, factor: float) -> tuple[Coarse, np.ndarray]:
    """Passengers, 0 to 3, who shift the car and calm its driver."""
    passengers = np.arange(number) % 4
    levels = 0.03 * np.random.default_rng(seed).normal(size=number) + shift * passengers
    shifts = np.repeat(levels[:, None], N, axis=1)
    factors = np.repeat((factor**passengers)[:, None], N, axis=1)
    column = np.repeat(passengers, N).astype(float)
    return drives(seed, shifts, factors.astype(float), {"passengers": column}), passengers


def test_a_column_of_one_value_a_drive_is_tested_on_mean_and_spread() -> None:
    coarse, passengers = whole_drives(31, 12, 0.1, 0.7)
    search, fitted = search_of(coarse, "passengers"), fit_model(coarse, ())
    np.testing.assert_array_equal(whole_drive_columns(search)["passengers"], passengers)
    mean, spread = (kind.test(search, fitted) for kind in (BetweenTerm, BetweenSpreadTerm))
    assert mean is not None and spread is not None
    assert mean.p_value < ERROR_BUDGET["between"]
    assert spread.p_value < ERROR_BUDGET["between_spread"]
    by = BetweenSpreadTerm.of(spread.term.effect)  # type: ignore[union-attr]
    fitted = fit_model(coarse, (by,))
    size = by.describe(fitted, by.estimate(fitted), "between_spread 0").size_m
    assert size == pytest.approx(0.7**3, rel=0.25)


def test_of_four_drives_nothing_between_them_can_be_told() -> None:
    coarse, _ = whole_drives(32, 4, 0.3, 0.5)
    search, fitted = search_of(coarse, "passengers"), fit_model(coarse, ())
    assert BetweenTerm.test(search, fitted) is None
    assert BetweenSpreadTerm.test(search, fitted) is None
    told = [one for one in what_drives_show(search, fitted) if one.what.startswith("passengers")]
    assert [one.tested for one in told] == [False, False]
    assert all("cannot be told" in one.why and "4 drives" in one.why for one in told)


def test_the_regression_over_drives_is_honest_with_five_of_them() -> None:
    rng, column = np.random.default_rng(33), np.array([0.0, 0.0, 1.0, 1.0, 1.0])
    noise = np.array([0.01, 0.02, 0.01, 0.03, 0.02]) ** 2
    p_values = []
    for scatter in (0.0, 0.02, 0.1):
        for _ in range(100):
            values = rng.normal(size=5) * np.sqrt(noise + scatter**2)
            p_values.append(regress(values, noise, column).p_value)
    assert np.mean(np.array(p_values) < 0.05) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 300)


def shown(coarse: Coarse, fitted: Fitted | None = None, *, plan: bool = False) -> dict[tuple[str, str], Shown]:
    search = search_of(coarse, "x")
    looks = what_drives_show(search, fitted or fit_model(coarse, ()), plan=plan)
    return {(one.what, one.acts): one for one in looks}


def test_what_drives_can_show_is_stated_for_every_look() -> None:
    rng = np.random.default_rng(34)
    x = np.repeat(rng.normal(size=5 * N // 50), 50)
    coarse = drives(35, np.zeros((5, N)), np.ones((5, N)), {"x": x})
    looks, plan = shown(coarse), shown(coarse, plan=True)
    assert {what for what, _ in looks} == {
        *("x", "time", "step", "cycle", "regimes", "products of two columns"),
    }
    by_x = looks["x", "mean"]
    assert by_x.smallest is not None and by_x.bound is not None
    assert 0.0 < by_x.smallest < 3.0 * SPREAD
    assert looks["x", "spread"].smallest is not None and looks["x", "spread"].smallest > 1.0  # type: ignore[operator]
    assert looks["time", "mean"].tested and not looks["step", "mean"].tested and not looks["regimes", "spread"].tested
    assert all(one.bound is None for one in plan.values())
    assert plan["x", "mean"].smallest == by_x.smallest


@pytest.mark.pages
def test_an_effect_of_the_stated_size_is_found_in_most_and_of_a_third_in_few() -> None:
    found = {1.0: 0, 0.33: 0}
    for seed in range(40, 44):
        rng = np.random.default_rng(seed)
        x = np.repeat(rng.choice([0.0, 1.0], size=5 * N // 50), 50)
        quiet = drives(seed, np.zeros((5, N)), np.ones((5, N)), {"x": x})
        size = shown(quiet)["x", "mean"].smallest
        assert size is not None
        for share in found:
            offset = quiet.timeline.offset + share * size * x
            coarse = coarse_of(offset, {"x": x}, drives=5)
            selected = select(search_of(coarse, "x"))
            found[share] += any(one.term.columns == ("x",) for one in selected.accepted)
    assert found[1.0] >= 2
    assert found[0.33] <= 1


# ---- what acts in some drives ----
def some_drives(seed: int, slopes: np.ndarray, seconds: float) -> Coarse:
    """A column that moves each drive by its own slope, answered within two seconds, and one that moves none."""
    rng, n = np.random.default_rng(seed), round(seconds / STEP)
    x, idle = (np.concatenate([wander(rng, n, 10.0) for _ in slopes]) for _ in range(2))
    answered = np.concatenate([respond(part, STEP, 0.0, 2.0) for part in x.reshape(len(slopes), n)])
    own = np.concatenate([movement(rng, seconds) for _ in slopes])
    return coarse_of(np.repeat(slopes, n) * answered + own, {"x": x, "idle": idle}, drives=len(slopes))


@pytest.mark.parametrize("seed", range(3))
def test_what_acts_in_some_drives_is_named_with_them_and_the_size_that_it_has_there(seed: int) -> None:
    coarse = some_drives(seed, 0.15 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]), 240.0)
    found = MeanTerm.test(search_of(coarse, "x", "idle"), fit_model(coarse, ()))
    assert found is not None and found.term is not None and found.columns == ("x",)
    fitted = found.after or fit_model(coarse, (found.term,))
    told = found.term.describe(fitted, fitted.effects_of(found.term), "mean 0")
    assert told.own_slopes is not None
    assert {"d0", "d3", "d6"} <= set(told.own_slopes.there)
    assert len(told.own_slopes.there) <= 4
    reach = np.subtract(*np.quantile(coarse.context["x"], [0.95, 0.05]))
    assert told.size_m == pytest.approx(0.15 * reach, rel=0.25)
    assert abs(told.size_m - 0.15 * reach) < 2.0 * told.size_error < 0.3 * reach
    assert not found.term.predictable(fitted)  # so no held-out drive is a veto: each has a slope of its own
    assert fitted.effects_of(found.term)[0].between_drivers[0] > 0.02  # type: ignore[attr-defined]


def test_a_size_where_it_acts_is_not_drawn_to_where_it_does_not() -> None:
    """Quicker responses stand out where what half of the drives do not show counts as slow noise: a sixth was lost."""
    slopes, sizes = 0.2 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]), []
    for seed in range(4):
        coarse = some_drives(seed, slopes, 240.0)
        found = MeanTerm.test(search_of(coarse, "x", "idle"), fit_model(coarse, ()))
        assert found is not None and found.term is not None and found.after is not None
        told = found.term.describe(found.after, found.after.effects_of(found.term), "mean 0")
        sizes.append(told.size_m / (0.2 * np.subtract(*np.quantile(coarse.context["x"], [0.95, 0.05]))))
        assert found.term.effect.response_s == pytest.approx(2.0, abs=0.7)  # type: ignore[attr-defined]
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.08)


def test_slopes_of_some_drives_are_likeliest_of_two_groups() -> None:
    """By an optimiser that knows nothing of expectation and maximisation."""
    slopes = np.array([1.25, 0.9, 0.05, -0.1, 0.75, 0.12, -0.04, 0.0])
    noise = 0.01 * np.linspace(0.7, 1.4, 8)

    def unlikely(x: np.ndarray) -> float:
        share = 1.0 / (1.0 + np.exp(-x[2]))
        acts = share * stats.norm.pdf(slopes, x[0], np.sqrt(np.exp(x[1]) + noise))
        return -float(np.log(acts + (1.0 - share) * stats.norm.pdf(slopes, 0.0, np.sqrt(noise))).sum())

    usual, scatter = (best := optimize.minimize(unlikely, [0.8, -3.0, 0.0], method="Nelder-Mead").x)[0], np.exp(best[1])
    likely = slopes_where_it_acts(slopes, noise, 1.0)
    expected = usual + scatter / (scatter + noise) * (slopes - usual)
    np.testing.assert_allclose(likely[[0, 1, 4]], expected[[0, 1, 4]], rtol=0.01)
    assert np.abs(likely[[2, 3, 5, 6, 7]]).max() < 0.1


@pytest.mark.parametrize("drives", [8, 24])
def test_slopes_that_cancel_over_drives_are_found_and_none_where_there_are_none(drives: int) -> None:
    """To the left in one drive as to the right in the next: no common slope."""
    to_and_fro = 0.15 * (-1.0) ** np.arange(drives)
    coarse = some_drives(5, to_and_fro, 180.0)
    found = MeanTerm.test(search_of(coarse, "x", "idle"), fit_model(coarse, ()))
    assert found is not None and found.term is not None and found.columns == ("x",)
    none = some_drives(6, np.zeros(drives), 180.0)
    silent = MeanTerm.test(search_of(none, "x", "idle"), fit_model(none, ()))
    assert silent is not None and silent.term is None


def test_drives_that_are_all_alike_are_not_said_to_differ() -> None:
    """60 sets in the laboratory: p below 0.05 on a tenth, below 0.01 on one in forty; here of eight none below 1e-3."""
    term = MeanTerm.of(Linear(acts=Acts.LOCATION, column="x", response_s=2.0))
    for seed in range(8):
        own = term.own_slopes(fit_model(some_drives(20 + seed, np.full(6, 0.15), 180.0), (term,)))
        assert own is not None and own.p_value > 1e-3


def test_where_nothing_surely_acts_no_drive_is_named() -> None:
    coarse, rng = some_drives(8, np.zeros(4), 240.0), np.random.default_rng(9)
    rows, path = rng.normal(size=(2, len(coarse)))
    own = own_slopes(rows, path, coarse)
    assert own is not None and not own.differ and own.there == ()


def test_a_column_comes_back_where_the_product_that_stood_for_it_goes() -> None:
    coarse = some_drives(7, np.full(3, 0.15), 180.0)
    factors = (Factor(column="x"), Factor(column="idle"))
    alone = MeanTerm.of(Linear(acts=Acts.LOCATION, column="x"))
    both = MeanTerm.of(Product(acts=Acts.LOCATION, factors=factors))
    start, fitted = fit_model(coarse, ()), fit_model(coarse, (alone, both))
    found = Selection((Accepted(alone, 1e-9), Accepted(both, 1e-6)), (), start, fitted)
    by_product = found.without([alone], BY_PRODUCT)
    assert [one.term for one in by_product.accepted] == [both]
    again = by_product.without([both], "it does not help")
    assert [(one.term, one.p_value) for one in again.accepted] == [(alone, 1e-9)]
    assert again.final.terms == (alone,)
    assert [one.columns for one in again.rejected] == [("x", "idle")]
