"""What a model predicts better on rows that it was not fitted on."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.identify import held_out_gain
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS = 1200.0


def table(size: float, seed: int, drives: int = 1) -> Coarse:
    """A column that moves the car by so much; of several drives it rests in the second half."""
    rng = np.random.default_rng(seed)
    x = wander(rng, round(SECONDS / 0.2), 15.0)
    if drives > 1:
        x[len(x) // 2 :] = 0.3
    return coarse_of(size * x + movement(rng, SECONDS), {"x": x}, drives=drives)


def term(column: str = "x") -> MeanTerm:
    return MeanTerm.of(Linear(acts=Acts.LOCATION, column=column, lag_s=0.0, response_s=0.3))


def gain(size: float, seed: int) -> tuple[np.ndarray, Coarse, np.ndarray]:
    coarse = table(size, seed)
    held = np.arange(len(coarse)) % 300 < 100
    part = coarse.only(~held)
    return held_out_gain(fit_model(part, (term(),)), fit_model(part, ()), coarse, held), coarse, held


def test_held_out_rows_are_likelier_under_the_model_that_made_them() -> None:
    told, coarse, held = gain(0.15, 14)
    assert (told[~(held & coarse.valid)] == 0.0).all()
    assert told.sum() > 5.0


def test_where_a_column_rests_its_effect_neither_gains_nor_costs() -> None:
    """Whatever else fitting it has changed: the same noise is taken for both."""
    coarse = table(0.15, 15, drives=6)
    held = coarse.drive % 2 == 1
    part = coarse.only(~held)
    told = np.bincount(coarse.drive, held_out_gain(fit_model(part, (term(),)), fit_model(part, ()), coarse, held))
    assert told[1] > 5.0
    # their own spread leans a little on that of the others
    assert np.abs(told[[3, 5]]).max() < 0.05 * told[1]


@pytest.mark.parametrize("seed", range(3))
def test_an_effect_that_is_none_gains_nothing_worth_the_name(seed: int) -> None:
    assert gain(0.0, 20 + seed)[0].sum() < 1.0


def test_nothing_held_out_has_no_gain() -> None:
    coarse = table(0.15, 16)
    fitted, rest = fit_model(coarse, (term(),)), fit_model(coarse, ())
    assert held_out_gain(fitted, rest, coarse, np.zeros(len(coarse), dtype=bool)).sum() == 0.0
