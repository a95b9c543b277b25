"""Folds choose as the table does: neither how many terms there are nor of which kind comes from held-out rows."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import hold_out_blocks, nest
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.timeline import COARSE


@pytest.mark.pages
@pytest.mark.parametrize("acts", [True, False])
def test_a_fold_without_evidence_scores_nothing_and_is_judged_by_its_best(acts: bool) -> None:
    rng = np.random.default_rng(5)
    n = round(750.0 / 0.2)
    x = wander(rng, n, 12.0)
    coarse = coarse_of(0.12 * x * acts + movement(rng, 750.0), {"x": x})
    search = Search.over(coarse, [Column("x", Values.NUMBER, False)], np.random.SeedSequence(1), ERROR_BUDGET)
    found = MeanTerm.of(Linear(acts=Acts.LOCATION, column="x", response_s=1.0))
    nested = nest(search, (), [found])
    assert len(nested.scored) == min(4, hold_out_blocks(coarse.timeline)[::COARSE].max() + 1)
    assert all(len(one.accepted) == acts for one in nested.scored)
    assert all(len(one.accepted) == 1 for one in nested.selections)
