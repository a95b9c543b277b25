"""The one model of a drive: sizes by generalised least squares, against closed forms and planted shifts of 0.15 m."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import SPREAD, coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear, Magnitude
from xosc_lateral.extras.loop import model
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 900.0
SIZE = 0.15


def mean_term(column: str = "x", **timing: float) -> MeanTerm:
    return MeanTerm.of(Linear(acts=Acts.LOCATION, column=column, **timing))


def spread_term(column: str = "x") -> SpreadTerm:
    return SpreadTerm.of(Linear(acts=Acts.SPREAD, column=column))


def planted(seed: int, size: float = SIZE, *, scale: float = 1.0, drives: int = 1, log_spread: float = 0.0) -> Coarse:
    """A shift of `size` per unit of a column that varies by 1 within half a minute; another column does nothing."""
    rng = np.random.default_rng(seed)
    n = round(SECONDS / 0.2) * drives
    x, idle = wander(rng, n, 30.0), wander(rng, n, 30.0)
    own = SPREAD * wander(rng, n, 5.0) * np.exp(log_spread * x)
    places = np.repeat(0.3 * rng.normal(size=drives), n // drives)
    return coarse_of(scale * (places + size * x + own), {"x": x, "idle": idle}, drives=drives)


# ---- the coarse grid -------------------------------------------------------------------------------------------------
def test_columns_are_clipped_to_what_occurs_while_road_following() -> None:
    n = 3000
    x = np.linspace(0.0, 10.0, n)
    valid = (x > 2.0) & (x < 7.0)
    coarse = coarse_of(np.zeros(n), {"x": x}, valid=valid)
    seen = coarse.context["x"]
    assert seen.min() == pytest.approx(2.0, abs=0.01)
    assert seen.max() == pytest.approx(7.0, abs=0.01)


def test_a_response_is_about_its_mean_over_the_valid_seconds() -> None:
    coarse = planted(1)
    response = coarse.response(mean_term().effect)
    assert response[coarse.valid].mean() == pytest.approx(0.0, abs=1e-12)
    assert response.shape == (len(coarse), 1)


def test_responses_are_kept_by_what_is_asked_and_not_by_sizes() -> None:
    coarse = planted(1)
    bare = mean_term().effect
    first = coarse.response(bare, keep=True)
    sized = Linear(acts=Acts.SPREAD, column="x", coefficients=(0.3,), errors=(0.1,), reference=(5.0,))
    assert coarse.response(sized) is first
    assert coarse.response(mean_term(lag_s=-1.0).effect) is not first
    assert coarse.only(coarse.valid).response(bare) is not first


def test_fewer_rows_are_those_of_both() -> None:
    coarse = planted(2)
    half = np.arange(len(coarse)) < len(coarse) // 2
    np.testing.assert_array_equal(coarse.only(half).valid, coarse.valid & half)


def test_drives_are_counted_and_long_ones_known() -> None:
    assert planted(1, drives=3).drives == 3
    assert planted(1).lasts
    assert not coarse_of(np.zeros(2000)).lasts  # 400 s


# ---- sizes -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_shift_is_sized_within_its_error_and_an_idle_column_at_nothing(seed: int) -> None:
    fitted = fit_model(planted(seed), (mean_term(), mean_term("idle")))
    errors = np.sqrt(np.diag(fitted.covariance))
    assert abs(fitted.sizes[0] - SIZE) < 4.0 * errors[0]
    assert abs(fitted.sizes[1]) < 4.0 * errors[1]
    assert 8.0 * errors[0] < SIZE


def test_errors_are_the_scatter_of_replicates() -> None:
    fits = [fit_model(planted(seed), (mean_term(),)) for seed in range(100, 124)]
    scatter = np.std([fit.sizes[0] for fit in fits], ddof=1)
    told = np.median([np.sqrt(fit.covariance[0, 0]) for fit in fits])
    assert told == pytest.approx(scatter, rel=4.0 / np.sqrt(2.0 * 23))


def test_sizes_are_least_squares_on_the_white_rows() -> None:
    fitted = fit_model(planted(3), (mean_term(), mean_term("idle")))
    rows = fitted.whitener.rows
    sizes, *_ = np.linalg.lstsq(rows(fitted.columns), rows(fitted.coarse.offset), rcond=None)
    np.testing.assert_allclose(fitted.sizes, sizes, rtol=1e-6)


def test_innovations_are_white() -> None:
    fitted = fit_model(planted(4), (mean_term(),))
    rows = fitted.innovations[fitted.coarse.valid]
    assert rows.var() == pytest.approx(1.0, rel=0.02)
    for lag in (1, 2, 5):
        assert abs(float(rows[lag:] @ rows[:-lag])) / len(rows) < 4.0 / np.sqrt(len(rows))


@pytest.mark.parametrize("factor", [-1.0, 10.0, 1e-3])
def test_the_unit_of_the_offset_scales_the_sizes_and_nothing_else(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = fit_model(planted(5), (mean_term(),))
    monkeypatch.setattr(model, "MEASUREMENT_NOISE", abs(factor) * model.MEASUREMENT_NOISE)
    other = fit_model(planted(5, scale=factor), (mean_term(),))
    np.testing.assert_allclose(other.sizes, factor * one.sizes, rtol=1e-6)
    np.testing.assert_allclose(other.innovations, np.sign(factor) * one.innovations, atol=1e-6)


def test_the_order_of_terms_does_not_matter() -> None:
    coarse = planted(6)
    x, idle = mean_term(), mean_term("idle")
    one, other = fit_model(coarse, (x, idle)), fit_model(coarse, (idle, x))
    np.testing.assert_allclose(one.sizes, other.sizes[::-1], rtol=1e-8)
    assert (one.mean_part(x), other.mean_part(x)) == (slice(0, 1), slice(1, 2))
    assert one.log_likelihood == pytest.approx(other.log_likelihood, abs=1e-6)


def test_every_drive_has_a_level_of_its_own() -> None:
    """Places 0.3 m apart: the size is found all the same, and levels are where the drives keep."""
    coarse = planted(7, drives=3)
    fitted = fit_model(coarse, (mean_term(),))
    assert fitted.sizes[0] == pytest.approx(SIZE, abs=4.0 * np.sqrt(fitted.covariance[0, 0]))
    means = coarse.by_drive(coarse.offset - fitted.columns @ fitted.sizes)
    np.testing.assert_allclose(fitted.levels, means, atol=0.05)


def test_what_is_explained_and_what_is_left_are_the_offset() -> None:
    fitted = fit_model(planted(8), (mean_term(),))
    coarse = fitted.coarse
    whole = fitted.columns @ fitted.sizes + fitted.levels[coarse.drive] + fitted.movement * fitted.scale
    np.testing.assert_allclose(whole[coarse.valid], coarse.offset[coarse.valid], atol=1e-12)
    assert len(fitted.explained) == len(coarse.timeline)


@pytest.mark.parametrize("log_spread", [0.0, 0.3])
def test_a_spread_by_a_column_is_sized_in_logarithms(log_spread: float) -> None:
    coarse = planted(9, size=0.0, log_spread=log_spread)
    term = spread_term()
    fitted = fit_model(coarse, (term,))
    error = float(np.sqrt(fitted.log_covariance[0, 0]))
    assert fitted.log_sizes[fitted.scale_part(term)][0] == pytest.approx(log_spread, abs=4.0 * error)
    assert error < 0.1


def test_a_term_of_the_right_column_is_likelier_than_an_idle_one() -> None:
    coarse = planted(10)
    bare, right, idle = (
        fit_model(coarse, terms).log_likelihood for terms in ((), (mean_term(),), (mean_term("idle"),))
    )
    assert right > bare + 20.0
    assert idle < bare + 8.0


def test_magnitudes_and_lines_are_told_apart_by_likelihood() -> None:
    rng = np.random.default_rng(17)
    n = round(SECONDS / 0.2)
    x = wander(rng, n, 20.0)
    coarse = coarse_of(SIZE * np.abs(x) + movement(rng, SECONDS), {"x": x})
    line, size = mean_term(), MeanTerm.of(Magnitude(acts=Acts.LOCATION, column="x"))
    assert fit_model(coarse, (size,)).log_likelihood > fit_model(coarse, (line,)).log_likelihood + 10.0


@pytest.mark.parametrize("place", [0.0, 0.3])
def test_a_drive_that_stands_still_is_fitted_with_nothing_left(place: float) -> None:
    """Without a warning, which the tests take for an error."""
    fitted = fit_model(coarse_of(np.full(4500, place)), ())
    assert fitted.levels[0] == pytest.approx(place)
    assert np.isfinite(fitted.innovations).all()
    assert np.abs(fitted.movement).max() < 1e-9
