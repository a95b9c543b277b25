"""Bursts: the kurtosis of lateral speed, as far as it is beyond chance."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace
from scipy.stats import kurtosis

from tests.kit.core_models import POPULATION
from xosc_lateral.drivers.fitting.models.autoregressive_fit import simulate
from xosc_lateral.drivers.fitting.models.bursts import BURST_TIME, _measured, log_kurtosis, with_bursts
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import Volatility

BURSTING = replace(POPULATION, coarse_volatility=Volatility(0.05, 0.35, BURST_TIME))
NAMES = [str(k) for k in range(300)]


def draw(model: AutoregressiveModel) -> np.ndarray:
    return simulate(model, 153, 1, drivers=2000)


def recorded(model: AutoregressiveModel, seed: int, drivers: int = len(NAMES)) -> list[np.ndarray]:
    return list(simulate(model, 200, seed, drivers=drivers))


def tails(paths: np.ndarray) -> float:
    """Kurtosis of lateral speed between rows, by scipy."""
    return float(kurtosis(np.diff(paths, axis=1).ravel(), fisher=False))


def test_a_driver_who_bursts_is_recognised_and_sampled_so() -> None:
    found = with_bursts(POPULATION, recorded(BURSTING, 7, 1200), [str(k) for k in range(1200)], draw)
    fresh = [simulate(model, 200, 99, drivers=2000) for model in (POPULATION, found, BURSTING)]
    calm, made, real = map(tails, fresh)
    assert real > 1.15 * calm
    assert abs(np.log(made / real)) < 0.5 * np.log(real / calm)
    typical = [np.median(np.abs(np.diff(paths, axis=1))) for paths in fresh]
    assert abs(typical[1] / typical[0] - 1.0) < 0.06  # bursts are seldom: what is usual stays as large


def test_what_chance_does_is_no_burst() -> None:
    unchanged = [with_bursts(POPULATION, recorded(POPULATION, seed), NAMES, draw) is POPULATION for seed in range(6)]
    assert sum(unchanged) >= 4  # a lack of more than one standard error: one in six by chance
    calmed = with_bursts(BURSTING, recorded(POPULATION, 7), NAMES, draw)
    assert log_kurtosis(draw(calmed)) < log_kurtosis(draw(BURSTING)) - 0.1


def test_the_error_is_what_drawing_other_drives_changes() -> None:
    runs = recorded(BURSTING, 3)
    rng = np.random.default_rng(0)
    drawn = [log_kurtosis(np.array(runs)[rng.integers(len(runs), size=len(runs))]) for _ in range(200)]
    value, error = _measured(runs, NAMES)
    assert np.isclose(value, log_kurtosis(np.array(runs)))
    assert abs(error / np.std(drawn) - 1.0) < 0.25
    both = _measured([*runs, np.zeros(3)], [*NAMES, NAMES[0]])  # a run too short for one speed adds nothing
    np.testing.assert_allclose(both, (value, error))
