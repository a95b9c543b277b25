"""Clustered errors against statsmodels, and against what clusters do to repeated experiments."""

import numpy as np
import pytest
import statsmodels.api as sm

from xosc_lateral.drivers.fitting.regression import clustered_least_squares, small_sample_factor


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
