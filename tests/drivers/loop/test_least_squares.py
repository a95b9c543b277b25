"""Clustered errors against their definition, and against what clusters do to repeated experiments."""

import numpy as np
import pytest

from xosc_lateral.drivers.loop.regression import clustered_least_squares


def test_sizes_are_those_of_least_squares_and_errors_those_of_the_definition() -> None:
    rng = np.random.default_rng(3)
    design, cluster = rng.normal(size=(60, 2)), np.repeat(np.arange(12), 5)
    observed = design @ [0.5, -1.0] + rng.normal(size=60)
    sizes, covariance = clustered_least_squares(design, observed, cluster)
    assert sizes == pytest.approx(np.linalg.lstsq(design, observed, rcond=None)[0])
    left, inverse = observed - design @ sizes, np.linalg.inv(design.T @ design)
    middle = np.zeros((2, 2))
    for number in range(12):
        score = design[cluster == number].T @ left[cluster == number]
        middle += np.outer(score, score)
    assert covariance == pytest.approx(inverse @ middle @ inverse * 12 / 11 * 59 / 58)


def test_errors_hold_where_rows_of_a_stretch_go_together() -> None:
    rng = np.random.default_rng(4)
    cluster = np.repeat(np.arange(100), 10)
    found, told = [], []
    for _ in range(300):
        column, noise = (np.repeat(rng.normal(size=100), 10) for _ in range(2))
        sizes, covariance = clustered_least_squares(column[:, None], noise, cluster)
        found.append(sizes[0])
        told.append(covariance[0, 0])
    assert np.std(found) == pytest.approx(np.sqrt(np.mean(told)), rel=0.12)
    assert np.std(found) == pytest.approx(0.1, rel=0.15)  # as of 100 rows, not of 1000


def test_no_column_no_size() -> None:
    sizes, covariance = clustered_least_squares(np.zeros((5, 0)), np.ones(5), np.zeros(5, dtype=np.intp))
    assert (sizes.shape, covariance.shape) == ((0,), (0, 0))
