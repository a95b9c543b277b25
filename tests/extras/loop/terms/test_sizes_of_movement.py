"""What changes the movement's size by a column."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.kit.coarse import SPREAD, coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Linear
from xosc_lateral.extras.loop import model
from xosc_lateral.extras.loop.model import Fitted, fit_model
from xosc_lateral.extras.loop.terms.column import ColumnTerm
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import (
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


def test_metres_or_centimetres_are_the_same_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    x = column_of(11)
    own = movement(np.random.default_rng(12), SECONDS) * np.exp(LOG_SIZE * x)
    sizes = []
    for factor in (1.0, 100.0):
        monkeypatch.setattr(model, "MEASUREMENT_NOISE", 0.03 * factor)
        fitted = fit_model(coarse_of(factor * own, {"x": x}), (term(SpreadTerm),))
        sizes.append(estimate(fitted)[0].coefficients[0])
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-5)


# ---- what each may take up -------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def acting() -> Fitted:
    """A fit with a column on the mean and another on the spread."""
    rng = np.random.default_rng(19)
    columns = {"m": wander(rng, 6000, 30.0), "s": wander(rng, 6000, 30.0)}
    coarse = coarse_of(movement(rng, 1200.0), columns)
    return fit_model(coarse, (term(MeanTerm, "m"), term(SpreadTerm, "s")))


def test_a_column_acts_on_the_size_once(acting: Fitted) -> None:
    assert SpreadTerm.barred(acting) == SlowSpreadTerm.barred(acting) == {"s"}


def test_what_acts_on_anything_is_no_fine_noise(acting: Fitted) -> None:
    assert FineNoiseTerm.barred(acting) == {"m", "s"}


def test_what_is_known_of_the_size_is_a_column_for_every_term_of_it(acting: Fitted) -> None:
    assert known_log_scale(acting).shape == (len(acting.coarse), 1)
    assert known_log_scale(fit_model(acting.coarse, ())).shape == (len(acting.coarse), 0)


def test_a_twin_acts_on_the_fine_noise_by_the_same_quantity(acting: Fitted) -> None:
    own = acting.terms[1]
    twin = fine_twin(own, acting)  # type: ignore[arg-type]
    assert (twin.acts, twin.columns) == (Acts.FINE, ("s",))


def test_problems_have_a_row_for_each_second_and_finite_numbers(acting: Fitted) -> None:
    problem = SpreadTerm.problem(acting)
    assert len(problem.observed) == problem.whitener.valid.sum() == len(problem.known)
    assert np.isfinite(problem.observed).all()
    assert np.isfinite(problem.known).all()
