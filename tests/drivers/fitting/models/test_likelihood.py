"""Memory about drivers' own means: the likelihood against dense matrices, and planted truths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag, toeplitz

from xosc_lateral.drivers.fitting.models import likelihood
from xosc_lateral.drivers.fitting.models.likelihood import (
    DriverSums,
    first_precision,
    fit_autoregression,
    partial_autocorrelations,
)
from xosc_lateral.drivers.model.core.autoregressive.parameters import MAX_ROOT, Autoregression
from xosc_lateral.drivers.model.linear_filters import recur

THIRD_ORDER = np.array([1.2, -0.5, 0.1])
LENGTHS, WHOSE = (7, 12, 9, 6, 20), "aabbc"


def dense_cost(runs: list[np.ndarray], coefficients: np.ndarray, ratio: float, sizes: dict[str, float]) -> float:
    """The same of one normal vector of all moments: textbook matrices."""
    free = Autoregression(coefficients, 1.0)
    own = block_diag(*(toeplitz(free.covariance(len(x))) * sizes[who] for x, who in zip(runs, WHOSE, strict=True)))
    whose = np.repeat(list(WHOSE), [len(run) for run in runs])
    matrix = own + ratio * (whose[:, None] == whose[None, :])
    inverse, one, values = np.linalg.inv(matrix), np.ones(len(whose)), np.concatenate(runs)
    common = one @ inverse @ values / (one @ inverse @ one)
    squares = (values - common) @ inverse @ (values - common)
    logs = np.linalg.slogdet(matrix)[1] + np.log(one @ inverse @ one)
    return float(np.log(squares / (len(values) - 1)) + logs / (len(values) - 1))


@pytest.mark.parametrize("wild", [1.0, 20.0])
def test_the_likelihood_is_that_of_one_normal_vector(wild: float) -> None:
    rng = np.random.default_rng(0)
    runs = [0.3 * rng.normal(size=n).cumsum() + 1.0 for n in LENGTHS]
    sums = DriverSums.of(runs, 3, every=1, drivers=list(WHOSE))
    sizes = {"a": 1.0, "b": wild, "c": 1.0}
    places = [(THIRD_ORDER, 1.3), (0.7 * THIRD_ORDER, 0.2), (np.array([0.5, 0.1, -0.3]), 40.0)]
    within = MAX_ROOT ** np.arange(1.0, 4.0)  # what is searched through are memories no longer than a model may have
    parameters = [np.append(np.arctanh(partial_autocorrelations(a / within)), np.log(ratio)) for a, ratio in places]
    found = sums.cost(np.array(parameters), sums.weighted(np.array([1.0, wild, 1.0])))
    expected = [dense_cost(runs, a, ratio, sizes) for a, ratio in places]
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-5)  # but for the ridge


def test_the_first_moments_have_their_inverse_covariance() -> None:
    covariance = toeplitz(Autoregression(THIRD_ORDER, 1.0).covariance(3))
    np.testing.assert_allclose(first_precision(THIRD_ORDER), np.linalg.inv(covariance), atol=1e-12)


def walks(drivers: int, steps: int, seed: int, between: float) -> list[np.ndarray]:
    """Runs with a memory of twenty steps (coefficient 0.95, variance 1) about means that differ."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(drivers, steps + 200)) * np.sqrt(1.0 - 0.95**2)
    return [between * rng.normal() + recur(np.zeros(1), row, np.array([0.95]))[-steps:] for row in noise]


@pytest.mark.parametrize(("drivers", "steps"), [(9, 600), (60, 60), (400, 25)])
def test_wander_and_drivers_are_told_apart(drivers: int, steps: int) -> None:
    """Few long drives, and many that are hardly longer than the memory."""
    parts = [fit_autoregression(walks(drivers, steps, seed, 1.5), 2, every=1, drivers=[str(k) for k in range(drivers)])
             for seed in range(8)]  # fmt: skip
    wander = np.array([found.covariance(1)[0] for found, _ in parts])
    between = np.array([variance for _, variance in parts])
    assert wander.mean() == pytest.approx(1.0, abs=3.0 * wander.std(ddof=1) / np.sqrt(8.0))
    assert between.mean() == pytest.approx(1.5**2, abs=3.0 * between.std(ddof=1) / np.sqrt(8.0))
    assert wander.std(ddof=1) < 0.35


def test_how_far_apart_drivers_keep_changes_nothing_about_their_wander() -> None:
    """The same nine drives, moved apart: what is between them is no wander, and takes none away."""
    runs, away = walks(9, 600, 3, 0.0), np.linspace(-1.0, 1.0, 9)
    found = [
        fit_autoregression(
            [run + far * k for run, k in zip(runs, away, strict=True)], 2, every=1, drivers=list("abcdefghi")
        )
        for far in (1.0, 3.0, 10.0)
    ]
    spreads = [np.sqrt(free.covariance(1)[0]) for free, _ in found]
    np.testing.assert_allclose(spreads, spreads[0], rtol=0.02)
    assert np.sqrt(found[-1][1]) == pytest.approx(10.0 * away.std(ddof=1), rel=0.05)


def test_a_search_that_does_not_end_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(likelihood, "MAXIMUM_TURNS", 2)
    monkeypatch.setattr(likelihood, "LAST_STEPS", 0)
    with pytest.warns(UserWarning, match="slow movement is not sure: its fit had not ended after 2 turns"):
        fit_autoregression(walks(9, 100, 1, 1.0), 4, every=1, drivers=list("abcdefghi"))
