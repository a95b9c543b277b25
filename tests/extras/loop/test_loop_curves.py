"""Curves of single effects: the fitted line, and points that lie on what was planted, everything else taken out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Linear
from xosc_lateral.extras.loop.loop_curves import POINTS, _binned, _ends, curve_of
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm

SECONDS = 2400.0
N = round(SECONDS / 0.2)
X, Y = (wander(np.random.default_rng(seed), N, 40.0) for seed in (111, 112))


def loop(offset: np.ndarray, *terms: Any) -> tuple[Any, list[ColumnEffect]]:
    """What is read of a closed loop, and the sized effects."""
    coarse = coarse_of(offset, {"x": X, "y": Y})
    fitted = fit_model(coarse, terms)
    scored = SimpleNamespace(statistics=SimpleNamespace(timeline=coarse.timeline))
    result = SimpleNamespace(coarse=coarse, final=fitted, scored=scored)
    return result, [term.estimate(fitted)[0] for term in terms]


def line(kind: Any, column: str) -> Any:
    return kind.of(Linear(acts=Acts.LOCATION, column=column))


def test_points_lie_on_the_planted_line_although_another_column_moves_the_car_as_far() -> None:
    own = movement(np.random.default_rng(113), SECONDS)
    result, (effect, _) = loop(0.15 * X + 0.15 * Y + own, line(MeanTerm, "x"), line(MeanTerm, "y"))
    curve = curve_of(result, effect)
    slope = np.polyfit(curve.seen, curve.measured, 1, w=1.0 / curve.measured_error)[0]
    assert slope == pytest.approx(0.15, abs=0.03)
    fitted = np.polyfit(curve.over, curve.strength, 1)[0]
    assert fitted == pytest.approx(effect.coefficients[0])
    assert len(curve.seen) > POINTS // 2
    assert (curve.error >= 0.0).all()


def test_errors_of_the_curve_are_those_of_its_slope() -> None:
    result, (effect,) = loop(0.15 * X + movement(np.random.default_rng(114), SECONDS), line(MeanTerm, "x"))
    curve = curve_of(result, effect)
    np.testing.assert_allclose(curve.error, np.abs(curve.over - effect.reference[0]) * effect.errors[0], atol=1e-12)


def test_a_spread_is_measured_as_the_log_of_a_factor() -> None:
    own = movement(np.random.default_rng(115), SECONDS) * np.exp(0.4 * X)
    result, (effect,) = loop(own, line(SpreadTerm, "x"))
    curve = curve_of(result, effect)
    slope = np.polyfit(curve.seen, curve.measured, 1, w=1.0 / curve.measured_error)[0]
    assert slope == pytest.approx(0.4, abs=0.12)


def test_a_rate_of_return_can_not_be_measured_alone() -> None:
    result, (effect,) = loop(movement(np.random.default_rng(116), SECONDS), line(MeanTerm, "x"))
    from msgspec.structs import replace

    curve = curve_of(result, replace(effect, acts=Acts.RATE))
    assert len(curve.seen) == len(curve.measured) == 0
    assert len(curve.over) == 200


def test_bins_are_means_and_their_errors_those_of_blocks() -> None:
    rng = np.random.default_rng(117)
    where, values, blocks = np.linspace(0.0, 1.0, 900), rng.normal(size=900), np.arange(900) // 90
    seen, mean, error, own = _binned(where, values, 2.0 * where, blocks, np.ones(900, dtype=bool))
    assert len(seen) == POINTS
    np.testing.assert_allclose(own, 2.0 * seen)
    low, high = np.quantile(where, [0.01, 0.99])
    first = np.clip((where - low) / (high - low) * POINTS, 0, POINTS - 1).astype(int) == 3
    assert mean[3] == pytest.approx(values[first].mean())
    sums = [float((values[first & (blocks == b)] - mean[3]).sum()) for b in range(10)]
    assert error[3] == pytest.approx(np.sqrt(np.sum(np.square(sums))) / first.sum())


def test_bins_with_hardly_any_driving_are_left_out() -> None:
    where = np.concatenate([np.zeros(400), np.linspace(0.0, 1.0, 40)])
    seen, *_ = _binned(where, where, where, np.zeros(440, dtype=np.intp), np.ones(440, dtype=bool))
    assert len(seen) == 1


@pytest.mark.parametrize(
    ("values", "ends"), [(np.linspace(0.0, 100.0, 101), (1.0, 99.0)), (np.r_[np.zeros(999), 7.0], (0.0, 7.0))]
)
def test_ends_are_quantiles_or_the_extremes_of_what_is_nearly_always_the_same(
    values: np.ndarray, ends: tuple[float, float]
) -> None:
    assert _ends(values) == ends
