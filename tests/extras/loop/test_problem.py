"""Every test of a column is one regression: its rows against plain least squares."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.kit.coarse import coarse_of, movement
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import Squares, of_squares
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 900.0


@pytest.fixture(scope="module")
def coarse() -> Coarse:
    return coarse_of(movement(np.random.default_rng(1), SECONDS))


def test_rows_of_valid_seconds_are_those_of_the_whole_grid(coarse: Coarse) -> None:
    """Put side by side without what is cut out, they whiten to the same numbers."""
    problem = MeanTerm.problem(fit_model(coarse, ()))
    white = problem.whitener.rows(problem.series)[problem.whitener.valid]
    np.testing.assert_allclose(problem.observed, white, atol=1e-10)
    assert problem.known.shape == (int(coarse.valid.sum()), 0)


def test_squares_that_come_in_clusters_are_made_white(coarse: Coarse) -> None:
    rng = np.random.default_rng(2)
    loud = np.asarray(lfilter([1.0], [1.0, -0.8], rng.normal(size=len(coarse))))
    squares = np.where(coarse.valid, loud, 0.0)
    rows = of_squares(coarse, Squares(squares, coarse.valid), np.zeros((len(coarse), 0))).observed
    related = float(rows[1:] @ rows[:-1]) / float(rows @ rows)
    assert abs(related) < 4.0 / np.sqrt(len(rows))


def test_what_columns_explain_is_no_cluster(coarse: Coarse) -> None:
    """Slow columns in the squares, wherever their zero is, look like memory unless they are among the columns known."""
    slow = 2.0 * np.pi * np.arange(len(coarse)) / 300.0
    columns = np.column_stack([np.sin(slow), 50.0 + np.cos(slow)])
    noise = np.random.default_rng(3).normal(size=len(coarse))
    squares = np.where(coarse.valid, columns @ [2.0, 1.0] - 50.0 + noise, 0.0)
    unknown = of_squares(coarse, Squares(squares, coarse.valid), columns[:, :0])
    known = of_squares(coarse, Squares(squares, coarse.valid), columns)
    told = [abs(problem.whitener.process.lags[-1]).sum() for problem in (unknown, known)]
    assert told[1] < 0.5 * told[0]


def test_a_size_in_the_squares_is_that_of_least_squares(coarse: Coarse) -> None:
    rng = np.random.default_rng(5)
    x = rng.normal(size=len(coarse))
    squares = np.where(coarse.valid, 0.2 * x + rng.normal(size=len(coarse)), 0.0)
    problem = of_squares(coarse, Squares(squares, coarse.valid), x[:, None])
    size = float(problem.known[:, 0] @ problem.observed) / float(problem.known[:, 0] @ problem.known[:, 0])
    assert size * squares[coarse.valid].std() == pytest.approx(0.2, abs=4.0 / np.sqrt(coarse.valid.sum()))
