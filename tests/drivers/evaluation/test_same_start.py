from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.evaluation.metrics import energy_score, metric_distances, snippet_metrics, variogram_score
from xosc_lateral.drivers.evaluation.snippets import windows_with_the_same_start


def _paths(n: int, rng: np.random.Generator, *, keep: float = 0.995, spread: float = 0.3) -> np.ndarray:
    x = np.empty((n, 51))
    x[:, 0] = spread * rng.standard_normal(n)
    for k in range(1, 51):
        x[:, k] = keep * x[:, k - 1] + spread * np.sqrt(1 - keep**2) * rng.standard_normal(n)
    return x


def test_stand_ins_start_alike_and_are_other_drivers() -> None:
    rng = np.random.default_rng(1)
    real, drivers = _paths(500, rng), np.repeat(np.arange(100), 5)
    rows = windows_with_the_same_start(real[:, 0], drivers, real[:, 0], drivers, rng, count=3)
    assert (drivers[rows] != drivers[:, None]).all()
    assert np.median(np.abs(real[rows, 0] - real[:, :1])) < 0.03
    assert all(len(set(row)) == 3 for row in rows.tolist())


def test_the_floor_that_knows_the_start_is_what_a_perfect_model_reaches() -> None:
    """Windows sampled from the truth at the real starts: the plain floor is too high for them, the fair one is not."""
    rng = np.random.default_rng(2)
    real, donors = _paths(1500, rng), _paths(1500, rng)
    perfect = _paths(1500, rng)
    perfect += 0.995 ** np.arange(51) * (real[:, :1] - perfect[:, :1])  # a linear process, moved to the real start
    own, other = np.arange(1500), np.arange(1500) + 10_000
    rows = windows_with_the_same_start(real[:, 0], own, donors[:, 0], other, rng)[:, 0]
    metrics = snippet_metrics(real)
    model = metric_distances(metrics, snippet_metrics(perfect)).mean
    fair = metric_distances(metrics, snippet_metrics(donors[rows])).mean
    plain = metric_distances(metrics, snippet_metrics(donors)).mean
    assert model < 0.8 * plain
    assert model == pytest.approx(fair, rel=0.35)


def test_too_few_other_drivers_are_named() -> None:
    one = np.zeros(3)
    with pytest.raises(NotEnoughDataError, match="0 windows of other drivers than 7"):
        windows_with_the_same_start(one, np.full(3, 7), one, np.full(3, 7), np.random.default_rng(0))


def test_energy_and_variogram_score_prefer_the_truth() -> None:
    pytest.importorskip("scoringrules")
    rng = np.random.default_rng(3)
    real = _paths(400, rng)
    truth = _paths(4000, rng).reshape(400, 10, 51)
    rough = 0.3 * rng.standard_normal((400, 10, 51))  # right spread, no memory
    shifted = truth + 0.3
    best = energy_score(real, truth).mean()
    assert energy_score(real, shifted).mean() > best
    assert energy_score(real, rough).mean() > best
    assert variogram_score(real, rough).mean() > 1.2 * variogram_score(real, truth).mean()


def test_energy_score_of_one_value_is_the_fair_crps() -> None:
    pytest.importorskip("scoringrules")
    real, members = np.array([[0.0]]), np.array([[[1.0], [3.0]]])
    # mean |x - y| = 2, mean |x - x'| over different members = 2
    assert energy_score(real, members)[0] == pytest.approx(2.0 - 0.5 * 2.0)
