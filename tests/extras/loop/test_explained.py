"""The share of the explainable: near one where the effects are all there is, unknown where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.omnibus import Explained, explained_share
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.terms.mean import MeanTerm

SECONDS = 1500.0


def explained(size: float, *named: str) -> Explained:
    """Two columns act alike, six do nothing; those `named` are in each fold's fit, as they truly act."""
    rng = np.random.default_rng(3)
    n = round(SECONDS / 0.2)
    names = [*"xy", *(f"idle{number}" for number in range(6))]
    context = {name: wander(rng, n, 12.0) for name in names}
    shift = size * sum(respond(context[name], 0.2, 1.0, 2.0) for name in "xy")
    coarse = coarse_of(shift + movement(rng, SECONDS), context)
    columns = [Column(name, Values.NUMBER, False) for name in sorted(names)]
    search = Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET)
    terms = [MeanTerm.of(Linear(acts=Acts.LOCATION, column=name, lag_s=1.0, response_s=2.0)) for name in named]
    blocks = np.arange(len(coarse)) // 100
    parts = [coarse.only(blocks % 4 != fold) for fold in range(4)]
    starts, finals = [fit_model(part, ()) for part in parts], [fit_model(part, terms) for part in parts]
    found = explained_share(starts, finals, search.quantities, coarse, blocks)
    assert found is not None
    return found


def test_effects_that_are_all_there_is_explain_what_can_be_explained() -> None:
    """And a little more: the free response has eight idle columns to be wrong about."""
    found = explained(0.1, "x", "y")
    assert found.is_known
    assert 0.95 < found.share < 1.25
    assert found.interval[0] > 0.9


def test_half_of_the_effects_explain_half() -> None:
    found = explained(0.1, "x")
    assert found.interval[0] < 0.5 < found.interval[1]
    assert found.share == pytest.approx(0.5, abs=0.15)


def test_where_nothing_acts_there_is_nothing_to_share() -> None:
    found = explained(0.0)
    assert not found.is_known
    assert found.free < 0.5
