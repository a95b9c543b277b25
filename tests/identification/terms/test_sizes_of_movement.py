"""What changes the movement's size by a column: all of it, its slow part, its fine part, or how fast it returns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.identification.made_coarse import SPREAD, coarse_of, movement, wander
from xosc_lateral.driver.effects import Acts, ColumnEffect, Linear
from xosc_lateral.identification import regression
from xosc_lateral.identification.regression import Coarse, Fitted, fit_model
from xosc_lateral.identification.terms.column import ColumnTerm
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.restoring import MAX_FACTOR, RestoringTerm, recent_offset
from xosc_lateral.identification.terms.spread import (
    FineNoiseTerm,
    SlowSpreadTerm,
    SpreadTerm,
    fine_twin,
    known_log_scale,
)

SECONDS = 2400.0
N = round(SECONDS / 0.2)
LOG_SIZE = 0.4
"""Per unit of a column of variance 1: half as much again. [-]"""

KINDS: tuple[type[ColumnTerm], ...] = (SpreadTerm, SlowSpreadTerm, FineNoiseTerm, RestoringTerm)


def term(kind: type[ColumnTerm], column: str = "x") -> ColumnTerm:
    return kind.of(Linear(acts=Acts.LOCATION, column=column))


def column_of(seed: int) -> np.ndarray:
    return wander(np.random.default_rng(seed), N, 60.0)


def estimate(fitted: Fitted) -> tuple[ColumnEffect, ...]:
    return fitted.terms[0].estimate(fitted)  # type: ignore[attr-defined,no-any-return]


def test_all_movement_larger_is_a_spread_and_the_fine_noise_goes_along() -> None:
    x = column_of(1)
    own = movement(np.random.default_rng(2), SECONDS) * np.exp(LOG_SIZE * x)
    spread, fine = estimate(fit_model(coarse_of(own, {"x": x}), (term(SpreadTerm),)))
    for effect, acts in ((spread, Acts.SPREAD), (fine, Acts.FINE)):
        assert effect.acts is acts
        # per unit within the inner nine tenths of the column, beyond which the movement goes on growing
        assert effect.coefficients[0] == pytest.approx(1.05 * LOG_SIZE, rel=0.12)
        assert effect.errors[0] < 0.25 * LOG_SIZE


def test_fine_noise_that_stays_the_same_has_no_effect_of_its_own() -> None:
    """Half of the movement's variance within a second is a camera's, which no column changes."""
    x, rng = column_of(3), np.random.default_rng(4)
    own = SPREAD * wander(rng, N, 8.0) * np.exp(0.2 * x)
    found = estimate(fit_model(coarse_of(own + 0.1 * rng.normal(size=N), {"x": x}), (term(SpreadTerm),)))
    assert len(found) == 1


def test_a_camera_that_shakes_is_fine_noise_of_the_size_planted() -> None:
    x, rng = column_of(5), np.random.default_rng(6)
    offset = movement(rng, SECONDS, 8.0) + 0.1 * rng.normal(size=N) * np.exp(LOG_SIZE * x)
    (fine,) = estimate(fit_model(coarse_of(offset, {"x": x}), (term(FineNoiseTerm),)))
    assert fine.acts is Acts.FINE
    assert fine.coefficients[0] == pytest.approx(LOG_SIZE, rel=0.2)  # the movement's own innovations dilute it a little


def test_slow_movement_that_grows_is_sized_beside_quick_that_does_not() -> None:
    x, rng = column_of(7), np.random.default_rng(8)
    slow = lfilter(np.ones(40) / 40.0, [1.0], rng.normal(size=N)) * np.exp(LOG_SIZE * x)
    offset = 0.5 * np.cumsum(slow - 0.002 * np.cumsum(slow)) * 0.01 + 0.02 * rng.normal(size=N)
    fitted = fit_model(coarse_of(offset, {"x": x}), (term(SlowSpreadTerm),))
    (effect,) = estimate(fitted)
    assert effect.acts is Acts.SPREAD
    assert effect.coefficients[0] > 4.0 * effect.errors[0]


def test_the_sign_of_a_spread_is_that_of_its_column() -> None:
    x = column_of(9)
    own = movement(np.random.default_rng(10), SECONDS) * np.exp(LOG_SIZE * x)
    there = estimate(fit_model(coarse_of(own, {"x": x}), (term(SpreadTerm),)))[0]
    back = estimate(fit_model(coarse_of(own, {"x": -x}), (term(SpreadTerm),)))[0]
    assert back.coefficients[0] == pytest.approx(-there.coefficients[0], rel=1e-6)


@pytest.mark.parametrize("kind", [SpreadTerm, SlowSpreadTerm, FineNoiseTerm, RestoringTerm])
def test_metres_or_centimetres_are_the_same_factor(kind: type[ColumnTerm], monkeypatch: pytest.MonkeyPatch) -> None:
    x = column_of(11)
    own = movement(np.random.default_rng(12), SECONDS) * np.exp(LOG_SIZE * x)
    sizes = []
    for factor in (1.0, 100.0):
        monkeypatch.setattr(regression, "FLOOR", 0.03 * factor)
        fitted = fit_model(coarse_of(factor * own, {"x": x}), (term(kind),))
        sizes.append(estimate(fitted)[0].coefficients[0])
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-5)


# ---- restoring -------------------------------------------------------------------------------------------------------
def returning(seed: int, log_rate: float) -> Coarse:
    """Movement whose rate of return of 1 / 6 s changes with a column; the kicks stay the same."""
    x, rng = column_of(seed), np.random.default_rng(seed + 100)
    keep = np.exp(-0.2 / 6.0 * np.exp(log_rate * x))
    kicks, path, last = 0.02 * rng.normal(size=N), np.empty(N), 0.0
    for row in range(N):
        last = keep[row] * last + kicks[row]
        path[row] = last
    return coarse_of(path, {"x": x})


def test_a_stronger_return_has_the_sign_of_its_column_and_narrows_the_spread_by_its_square_root() -> None:
    fitted = fit_model(returning(13, 0.6), (term(RestoringTerm),))
    rate, spread = estimate(fitted)
    assert (rate.acts, spread.acts) == (Acts.RATE, Acts.SPREAD)
    assert rate.coefficients[0] > 0.0
    assert spread.coefficients[0] == pytest.approx(-0.5 * rate.coefficients[0])
    mirrored = estimate(fit_model(returning(13, -0.6), (term(RestoringTerm),)))
    assert mirrored[0].coefficients[0] < 0.0


def test_a_return_that_stays_the_same_is_of_no_size_that_chance_does_not_give() -> None:
    sizes, errors = [], []
    for seed in (14, 15, 16):
        rate, _ = estimate(fit_model(returning(seed, 0.0), (term(RestoringTerm),)))
        sizes.append(rate.coefficients[0])
        errors.append(rate.errors[0])
    assert np.abs(sizes).max() < 4.0 * max(errors)


def test_no_return_is_believed_to_change_by_more_than_the_limit() -> None:
    rate, _ = estimate(fit_model(returning(17, 3.0), (term(RestoringTerm),)))
    low, high = np.quantile(column_of(17), [0.05, 0.95])
    assert abs(rate.coefficients[0]) * (high - low) <= np.log(MAX_FACTOR) * 1.05


def test_the_recent_offset_is_the_past_alone() -> None:
    fitted = fit_model(returning(18, 0.0), ())
    recent = recent_offset(fitted)
    assert recent[fitted.coarse.valid].std() == pytest.approx(1.0)
    assert (recent[~fitted.coarse.valid] == 0.0).all()
    weights = np.exp(-np.arange(60) / 3.0)
    expected = np.array([weights @ fitted.movement[row - 1 : row - 61 : -1] for row in range(200, 400)])
    assert np.corrcoef(recent[200:400], expected)[0, 1] > 1.0 - 1e-9


# ---- what each may take up -------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def acting() -> Fitted:
    """A fit with a column on the mean and another on the spread."""
    rng = np.random.default_rng(19)
    columns = {"m": wander(rng, 6000, 30.0), "s": wander(rng, 6000, 30.0)}
    coarse = coarse_of(movement(rng, 1200.0), columns)
    return fit_model(coarse, (term(MeanTerm, "m"), term(SpreadTerm, "s")))


def test_a_column_acts_on_the_size_once(acting: Fitted) -> None:
    for kind in (SpreadTerm, SlowSpreadTerm):
        assert kind.barred(acting) == {"s"}


def test_what_acts_on_anything_is_no_fine_noise_and_no_return(acting: Fitted) -> None:
    for kind in (FineNoiseTerm, RestoringTerm):
        assert kind.barred(acting) == {"m", "s"}


def test_what_is_known_of_the_size_is_a_column_for_every_term_of_it(acting: Fitted) -> None:
    assert known_log_scale(acting).shape == (len(acting.coarse), 1)
    assert known_log_scale(fit_model(acting.coarse, ())).shape == (len(acting.coarse), 0)


def test_a_twin_acts_on_the_fine_noise_by_the_same_quantity(acting: Fitted) -> None:
    own = acting.terms[1]
    twin = fine_twin(own, acting)  # type: ignore[arg-type]
    assert (twin.acts, twin.columns) == (Acts.FINE, ("s",))


@pytest.mark.parametrize("kind", KINDS)
def test_problems_have_a_row_for_each_second_and_finite_numbers(acting: Fitted, kind: type[ColumnTerm]) -> None:
    problem = kind.problem(acting)
    assert len(problem.observed) == problem.valid.sum() == len(problem.known)
    assert np.isfinite(problem.observed).all()
    assert np.isfinite(problem.known).all()
