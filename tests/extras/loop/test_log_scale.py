"""Regression of the log scale against statsmodels' generalised linear models, and its errors against replicates."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of
from xosc_lateral.extras.loop.model import (
    CLIP,
    MOST_LOG_SCALE,
    OWN_LEVEL_S,
    bounded,
    fit_model,
    own_levels,
    scoring_step,
)
from xosc_lateral.extras.loop.terms.spread import Squares, log_sizes
from xosc_lateral.extras.loop.timeline import Coarse


def by_second(drive: np.ndarray) -> Coarse:
    """All rows valid, of which only the drives are known."""
    n = len(drive)
    return Coarse(None, np.zeros(n), np.ones(n, dtype=bool), drive, np.arange(n, dtype=float), {})  # type: ignore[arg-type]


def test_log_sizes_are_those_of_a_gamma_regression() -> None:
    """Mean squares with a log link: half of statsmodels' coefficients, for a variance is a squared deviation."""
    api = pytest.importorskip("statsmodels.api")
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(4000, 2))
    squares = np.exp(2.0 * columns @ [0.2, -0.1]) * rng.chisquare(12, 4000) / 12.0
    valid = rng.random(4000) > 0.1
    sizes, errors = log_sizes(Squares(np.where(valid, squares, 0.0), valid), columns)
    model = api.GLM(
        squares[valid], api.add_constant(columns[valid]), family=api.families.Gamma(api.families.links.Log())
    )
    fit = model.fit()
    np.testing.assert_allclose(sizes, fit.params[1:] / 2.0, rtol=2e-3, atol=2e-5)
    np.testing.assert_allclose(errors, fit.bse[1:] / 2.0, rtol=0.05)


def test_a_single_wild_second_is_clipped() -> None:
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(2000, 1))
    squares = rng.chisquare(1, 2000)
    calm, _ = log_sizes(Squares(squares, np.ones(2000, dtype=bool)), columns)
    squares[np.argmax(columns[:, 0])] = 300.0
    wild, _ = log_sizes(Squares(squares, np.ones(2000, dtype=bool)), columns)
    free = 300.0 * columns.max() / (2.0 * float((columns**2).sum()))  # what it would weigh unclipped
    assert abs(wild[0] - calm[0]) < 0.1 * free


def test_scoring_steps_end_where_the_likelihood_does() -> None:
    rng = np.random.default_rng(3)
    scales = rng.normal(size=(6000, 1))
    rows = np.exp(0.15 * scales[:, 0]) * rng.normal(size=6000)
    coarse = by_second(np.zeros(6000, dtype=np.intp))
    size = np.zeros(1)
    for _ in range(20):
        size = size + scoring_step(scales, rows / np.exp(scales @ size), coarse)[0]
    assert size[0] == pytest.approx(0.15, abs=4.0 / np.sqrt(2.0 * 6000))
    assert abs(scoring_step(scales, rows / np.exp(scales @ size), coarse)[0][0]) < 1e-6


def test_a_scale_that_only_differs_between_drives_is_not_told_from_the_drives() -> None:
    drive = np.repeat(np.arange(2), 500).astype(np.intp)
    scales, rows = (
        drive[:, None].astype(float),
        np.where(drive == 1, 3.0, 1.0) * np.random.default_rng(4).normal(size=1000),
    )
    step, _ = scoring_step(scales, rows, by_second(drive))
    assert step[0] == pytest.approx(0.0, abs=1e-9)


def test_errors_are_the_spread_of_replicates_whose_squares_come_in_clusters() -> None:
    rng = np.random.default_rng(5)
    coarse = by_second(np.zeros(1200, dtype=np.intp))
    sizes, errors = [], []
    for _ in range(250):
        scales = np.repeat(rng.normal(size=20), 60)[:, None]  # as steady as the clusters
        rows = np.repeat(np.exp(0.3 * rng.normal(size=20)), 60) * rng.normal(size=1200)
        step, covariance = scoring_step(scales, rows, coarse)
        sizes.append(step[0])
        errors.append(np.sqrt(covariance[0, 0]))
    assert np.median(errors) == pytest.approx(np.std(sizes), rel=0.25)
    assert np.std(sizes) > 1.5 / np.sqrt(2.0 * 1200)  # independent squares would promise so much less


def test_no_columns_have_no_covariance() -> None:
    fitted = fit_model(coarse_of(np.random.default_rng(6).normal(size=3000)), ())
    assert (fitted.covariance.shape, fitted.log_covariance.shape) == ((0, 0), (0, 0))


def test_levels_of_drives_are_drawn_towards_the_mean_by_their_length() -> None:
    squares = np.concatenate([np.full(30, 1.0), np.full(90, 3.0)])
    drive = np.repeat(np.arange(2), [30, 90]).astype(np.intp)
    mean = (30.0 * 1.0 + 90.0 * 3.0) / 120.0
    expected = [
        (30.0 / mean + OWN_LEVEL_S) / (30.0 + OWN_LEVEL_S),
        (90.0 * 3.0 / mean + OWN_LEVEL_S) / (90.0 + OWN_LEVEL_S),
    ]
    np.testing.assert_allclose(own_levels(squares, np.ones(120, dtype=bool), drive), expected)
    np.testing.assert_array_equal(own_levels(squares, np.ones(120, dtype=bool), np.zeros(120, dtype=np.intp)), [1.0])
    np.testing.assert_array_equal(own_levels(squares, np.zeros(120, dtype=bool), drive), [1.0, 1.0])


def test_squared_innovations_are_clipped_and_standardised_over_valid_rows() -> None:
    rows, valid = np.array([0.0, 1.0, 2.0, 100.0, 5.0]), np.array([True, True, True, True, False])
    squares = np.array([0.0, 1.0, 4.0, CLIP])
    expected = (squares - squares.mean()) / squares.std()
    np.testing.assert_allclose(Squares(rows**2, valid).standardised, [*expected, 0.0])


@pytest.mark.parametrize("size", [0.1, 1.0, 100.0])
def test_scale_terms_together_stay_within_their_bound(size: float) -> None:
    scales = np.array([[1.0, 2.0], [-2.0, 1.0]])
    held = bounded(np.array([size, -size]), scales)
    assert np.abs(scales @ held).max() == pytest.approx(min(3.0 * size, MOST_LOG_SCALE))
