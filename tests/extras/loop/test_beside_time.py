"""A column that changes once, and time: both are named, other drives decide."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.extras.loop.identify import identify


@pytest.mark.pages
def test_a_column_that_changes_once_has_time_beside_it_and_one_that_comes_and_goes_has_not() -> None:
    rng = np.random.default_rng(9)
    n = round(1800.0 / 0.2)
    once, often = (np.arange(n) > 0.45 * n).astype(float), (wander(rng, n, 30.0) > 0.0).astype(float)
    shift = respond(0.2 * often + 0.25 * once, 0.2, 0.0, 3.0)
    coarse = coarse_of(shift + movement(rng, 1800.0, 3.0), {"once": once, "often": often})
    found = {one.term.columns: one.term.alike for one in identify(coarse, np.random.SeedSequence(1)).selection.accepted}
    assert ("time",) not in found[("often",)]
    if ("once",) in found:
        assert ("time",) in found[("once",)]
    else:
        assert ("once",) in found[()]
