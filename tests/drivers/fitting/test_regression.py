"""Clustered errors against statsmodels, and against what clusters do to repeated experiments."""

import numpy as np
import pytest
import statsmodels.api as sm

from xosc_lateral.drivers.fitting.regression import (
    autoregressive_least_squares,
    clustered_least_squares,
    random_effects_least_squares,
    small_sample_factor,
)


@pytest.mark.parametrize("columns", [1, 2, 5])
def test_slopes_and_errors_are_those_of_statsmodels(columns: int) -> None:
    rng = np.random.default_rng(3)
    design, cluster = rng.normal(size=(60, columns)), np.repeat(np.arange(12), 5)
    observed = design @ np.linspace(0.5, -1.0, columns) + rng.normal(size=60) + rng.normal(size=12)[cluster]
    fit = sm.OLS(observed, design).fit(cov_type="cluster", cov_kwds={"groups": cluster})
    slopes, covariance = clustered_least_squares(design, observed, cluster)
    assert slopes == pytest.approx(fit.params, rel=1e-10)
    assert covariance * small_sample_factor(12, 60, columns) == pytest.approx(fit.cov_params(), rel=1e-10)


def test_errors_hold_where_rows_of_a_stretch_go_together() -> None:
    rng = np.random.default_rng(4)
    cluster = np.repeat(np.arange(100), 10)
    slopes, variances = [], []
    for _ in range(300):
        column, noise = (np.repeat(rng.normal(size=100), 10) for _ in range(2))
        slope, covariance = clustered_least_squares(column[:, None], noise, cluster)
        slopes.append(slope[0])
        variances.append(covariance[0, 0] * small_sample_factor(100, 1000, 1))
    assert np.std(slopes) == pytest.approx(np.sqrt(np.mean(variances)), rel=0.12)
    assert np.std(slopes) == pytest.approx(0.1, rel=0.15)  # as of 100 rows, not of 1000


def test_no_column_no_size() -> None:
    slopes, covariance = clustered_least_squares(np.zeros((5, 0)), np.ones(5), np.zeros(5, dtype=np.intp))
    assert (slopes.shape, covariance.shape) == ((0,), (0, 0))


def test_a_slope_across_groups_with_levels_of_their_own_is_that_of_a_mixed_model() -> None:
    rng = np.random.default_rng(5)
    group = np.repeat(np.arange(60), rng.integers(5, 15, size=60))
    column = rng.normal(size=len(group)) + rng.normal(size=60)[group]
    observed = 0.4 * column + 0.8 * rng.normal(size=60)[group] + 0.5 * rng.normal(size=len(group)) + 2.0
    slopes, covariance = random_effects_least_squares(column[:, None], observed, group)
    mixed = sm.MixedLM(observed, sm.add_constant(column), groups=group).fit()
    assert slopes[0] == pytest.approx(mixed.params[1], abs=0.3 * mixed.bse[1])
    assert np.sqrt(covariance[0, 0]) == pytest.approx(mixed.bse[1], rel=0.3)


def test_a_slow_drift_is_no_slope_and_what_does_not_vary_has_none() -> None:
    rng, scores = np.random.default_rng(6), []
    group, block = (
        np.repeat(np.arange(3), 200),
        np.stack([np.repeat(np.arange(3), 200), np.tile(np.arange(200) // 15, 3)], 1),
    )
    for _ in range(60):
        drift = np.zeros(600)
        noise = rng.normal(size=600)
        for k in range(1, 600):
            drift[k] = 0.8 * drift[k - 1] * (k % 200 > 0) + noise[k]
        near = np.repeat(rng.random(120) < 0.5, 5).astype(np.float64)
        table = np.stack([drift + 0.7 * near + group, near, np.ones(600)], axis=1)
        slopes, errors = autoregressive_least_squares(table, group, block)
        assert (slopes[1], errors[1]) == (0.0, np.inf)
        scores.append((slopes[0] - 0.7) / errors[0])
    assert abs(np.mean(scores)) < 0.45  # three errors of the mean of 60
    assert 0.75 < np.std(scores) < 1.4
