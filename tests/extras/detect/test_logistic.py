"""The trained detector: its fit against an independent one, and what it learns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from tests.kit.lane_tracks import lane_change, scene, track, weave
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, views_of
from xosc_lateral.extras.detect.other_detectors import RIDGE_PENALTY, Logistic, features, fit_regression, train
from xosc_lateral.extras.detect.scoring import Tally

TIME = 0.1 * np.arange(900)


def test_the_fit_is_the_minimum_that_a_general_optimiser_finds():
    rng = np.random.default_rng(5)
    columns = rng.standard_normal((400, 3)) * [1.0, 5.0, 0.1]
    positive = rng.random(400) < 1.0 / (1.0 + np.exp(-(columns[:, 0] - 0.4 * columns[:, 1] - 1.0)))
    found = fit_regression(columns, positive)
    standard = (columns - columns.mean(axis=0)) / columns.std(axis=0)
    weight = min(positive.sum(), (~positive).sum()) * np.where(positive, 1 / positive.sum(), 1 / (~positive).sum())

    def loss(beta):
        odds = beta[0] + standard @ beta[1:]
        return (weight * np.logaddexp(0.0, np.where(positive, -odds, odds))).sum() + 0.5 * RIDGE_PENALTY * (
            beta[1:] ** 2
        ).sum()

    np.testing.assert_allclose(found.coefficients, minimize(loss, np.zeros(4), tol=1e-12).x, atol=1e-4)


def drivers(amplitude: float, count: int = 6, first: int = 0) -> list:
    rng = np.random.default_rng(first)
    return [
        scene(track(weave(90.0, amplitude, float(rng.uniform(7, 12))) + lane_change(TIME, 40.0, 6.0), name=f"v{k}"))
        for k in range(first, first + count)
    ]


def trained(scenes) -> Logistic:
    return train((view for one in scenes for view in views_of(one, PERFECT_SENSOR, 0)), 0.5, "made")


def test_trained_on_lane_centre_traffic_it_takes_every_weave_for_a_cut_in_and_on_weaving_traffic_it_does_not():
    rates, shares = [], []
    for amplitude in (0.0, 0.25):
        tally = Tally(trained(drivers(amplitude)), "made")
        for one in drivers(0.25, first=20):
            tally.add(one, views_of(one, PERFECT_SENSOR, 0))
        curve = tally.curve()
        rates.append(float(curve.rate[curve.detector.chosen]))
        shares.append(float(curve.seen(0.0)[curve.detector.chosen]))
    assert shares == [1.0, 1.0]
    assert rates[0] > 100.0 and rates[1] < 0.2 * rates[0]


def test_separable_classes_have_finite_coefficients():
    found = trained(drivers(0.0))
    assert np.isfinite(found.regression.coefficients).all() and np.abs(found.regression.coefficients).max() < 50.0


def test_features_are_positive_towards_the_lane_on_either_side():
    views = views_of(scene(track(lane_change(TIME, 40.0, 6.0))), PERFECT_SENSOR, 0)
    left, right = (features(view) for view in views)
    np.testing.assert_allclose(left[:, :4], -right[:, :4])
    np.testing.assert_allclose(left[:, 4:], right[:, 4:])


def test_training_without_cut_ins_is_refused():
    with pytest.raises(NotEnoughDataError, match=r"made: 0\.0 s of cut-ins and 344\.0 s of lane keeping"):
        trained([scene(track(weave(90.0, 0.2, 9.0), name=f"v{k}")) for k in range(2)])
