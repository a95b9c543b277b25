"""Slow drift: an Ornstein-Uhlenbeck process, exact at any step."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.profiles import whole_terms
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Drift

DRIVES = 600


def drifts(effect: Drift, step: float, rows: int) -> np.ndarray:
    paths = [
        whole_terms(effect, step * np.arange(rows), {}, np.random.default_rng(seed)).location for seed in range(DRIVES)
    ]
    return np.stack(paths)  # type: ignore[arg-type]


@pytest.mark.parametrize("step", [0.1, 1.0, 20.0])
def test_size_and_memory_are_the_same_on_any_grid(step: float) -> None:
    """Covariance size^2 exp(-lag / time) of the process; errors of 600 independent drives."""
    effect = Drift(size=0.15, correlation_s=60.0)
    paths = drifts(effect, step, round(60.0 / step) + 1)
    assert paths[:, 0].std() == pytest.approx(0.15, rel=4.0 / np.sqrt(2 * DRIVES))
    assert paths[:, -1].std() == pytest.approx(0.15, rel=4.0 / np.sqrt(2 * DRIVES))
    remembered = float(np.mean(paths[:, 0] * paths[:, -1])) / 0.15**2
    assert remembered == pytest.approx(np.exp(-1.0), abs=4.0 / np.sqrt(DRIVES))


def test_it_moves_to_either_side_alike() -> None:
    ends = drifts(Drift(size=0.1, correlation_s=20.0), 1.0, 30)[:, -1]
    assert ends.mean() == pytest.approx(0.0, abs=4.0 * 0.1 / np.sqrt(DRIVES))


def test_twice_the_size_is_twice_the_path() -> None:
    time = np.arange(50.0)
    one, two = (whole_terms(Drift(size=size), time, {}, np.random.default_rng(8)).location for size in (0.1, 0.2))
    np.testing.assert_allclose(two, 2.0 * np.asarray(one), rtol=1e-12)


@pytest.mark.parametrize("field", ["size", "correlation_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_sizes_and_times_are_above_nothing_and_finite(field: str, value: float) -> None:
    with pytest.raises(DriverProfileError, match=f"effect drift: {field} = "):
        Drift(**{"size": 0.1} | {field: value})


def test_no_rows_have_no_terms_and_draw_nothing() -> None:
    rng, other = np.random.default_rng(1), np.random.default_rng(1)
    assert whole_terms(Drift(size=0.1), np.zeros(0), {}, rng).location is None
    assert rng.random() == other.random()
