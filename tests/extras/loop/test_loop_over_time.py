"""Figures' numbers of a closed loop: moving means, spreads, hidden courses."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement
from xosc_lateral.extras.loop.loop_curves import (
    hidden_mean,
    moving_mean,
    moving_spread,
    regime_probability,
)
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.hidden import RegimeFit, RegimesTerm
from xosc_lateral.extras.loop.terms.time import StepTerm

N = 6000


def result(offset: np.ndarray, before: np.ndarray, after: np.ndarray, *, drives: int = 1, terms: tuple = ()) -> Any:
    """What these functions read of a closed loop."""
    coarse = coarse_of(offset, drives=drives)
    return SimpleNamespace(
        coarse=coarse,
        scored=SimpleNamespace(
            statistics=SimpleNamespace(timeline=coarse.timeline), runs_before=before, runs_after=after
        ),
        final=fit_model(coarse, terms),
    )


@pytest.fixture(scope="module")
def steady() -> Any:
    rng = np.random.default_rng(91)
    step = 0.15 * (np.arange(N) >= 3000)
    runs = np.stack([movement(rng, N * 0.2) for _ in range(3)])
    return result(step + movement(rng, N * 0.2), runs, 2.0 * runs + 0.1, terms=(StepTerm(at=600),))


def test_a_moving_mean_is_numpys_average_over_the_window(steady: Any) -> None:
    found = moving_mean(steady, 60.0)
    timeline, at = steady.scored.statistics.timeline, 300
    second = int(np.flatnonzero(steady.coarse.valid)[at])
    rows = np.arange(5 * second, 5 * second + 5)
    expected = np.mean([timeline.offset[row - 150 : row + 151].mean() for row in rows])
    assert found.measured[at] == pytest.approx(expected)
    assert len(found.time) == len(found.measured) == len(found.before) == steady.coarse.valid.sum()


def test_profiles_are_the_mean_over_their_runs(steady: Any) -> None:
    found = moving_mean(steady, 60.0)
    np.testing.assert_allclose(found.after, 2.0 * found.before + 0.1, atol=1e-9)


def test_a_moving_spread_is_proportional_to_the_movement_and_blind_to_the_mean(steady: Any) -> None:
    found = moving_spread(steady, 120.0)
    np.testing.assert_allclose(found.after[30:-30], 2.0 * found.before[30:-30], rtol=0.05)
    assert found.measured.mean() == pytest.approx(found.before.mean(), rel=0.15)


def test_hidden_movement_is_the_fitted_step_about_its_mean(steady: Any) -> None:
    hidden = hidden_mean(steady)
    assert hidden.mean() == pytest.approx(0.0, abs=1e-12)
    assert len(np.unique(np.round(hidden, 12))) == 2
    assert np.ptp(hidden) == pytest.approx(abs(steady.final.sizes[0]))


def test_without_hidden_terms_there_is_no_hidden_movement() -> None:
    made = result(np.zeros(N) + movement(np.random.default_rng(92), N * 0.2), np.zeros((1, N)), np.zeros((1, N)))
    assert (hidden_mean(made) == 0.0).all()
    assert (regime_probability(made) == 0.0).all()


def test_regimes_show_how_sure_they_are_on() -> None:
    offset = movement(np.random.default_rng(93), N * 0.2)
    coarse = coarse_of(offset)
    on = np.linspace(0.0, 1.0, len(coarse))
    term = RegimesTerm(RegimeFit(2.0, 20.0, 40.0, on, 1.0, 0.0))
    made = result(offset, offset[None], offset[None], terms=(term,))
    np.testing.assert_array_equal(regime_probability(made), on[coarse.valid])


def test_the_longest_drive_is_shown() -> None:
    offset = np.concatenate([np.zeros(N // 2), np.ones(N // 2)])
    coarse = coarse_of(offset, drives=2)
    valid = coarse.timeline.valid.copy()
    valid[: N // 4] = False  # the first drive loses a half
    made = result(offset, offset[None], offset[None], drives=2)
    made.coarse = coarse_of(offset, drives=2, valid=valid)
    made.scored.statistics = SimpleNamespace(timeline=made.coarse.timeline)
    found = moving_mean(made, 20.0)
    np.testing.assert_allclose(found.measured, 1.0, atol=1e-9)
