"""A dictionary's rows are each candidate's response, shifted, then whitened, whichever comes first."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.extras.loop.autocorrelation import Whitener
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search, build_dictionary
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET


@pytest.mark.parametrize("louder", [0.0, 0.5])
def test_rows_are_shifted_responses_made_white(louder: float) -> None:
    """Also where the movement's size changes within a run, which no shift leaves alone."""
    rng = np.random.default_rng(4)
    seconds, drives = 400.0, 3
    n = round(seconds / 0.2)
    columns = {name: np.concatenate([wander(rng, n, 9.0) for _ in range(drives)]) for name in ("x", "y")}
    coarse = coarse_of(np.concatenate([movement(rng, seconds) for _ in range(drives)]), columns, drives=drives)
    shown = [Column(name, Values.NUMBER, False) for name in columns]
    search = Search.over(coarse, shown, np.random.SeedSequence(1), ERROR_BUDGET)
    plain = fit_model(coarse, ()).whitener
    scale = plain.scale * np.exp(louder * np.sin(np.arange(len(coarse)) / 40.0))
    whitener = Whitener(plain.process, plain.valid, plain.drive, scale)
    dictionary, quantities = build_dictionary(search.quantities, whitener), search.quantities
    assert {len(one.columns) for one in dictionary.candidates} == {1, 2}
    for index in range(0, len(dictionary), 17):
        member = quantities.candidates.index(dictionary.candidates[index])
        response = quantities.responses(np.array([member]), float(dictionary.response[index]))[:, 0].astype(float)
        late = np.arange(len(response)) - int(dictionary.lag[index])
        rows = whitener.rows(response[np.clip(late, 0, len(response) - 1)])[whitener.valid]
        np.testing.assert_allclose(dictionary.rows[index], rows / np.linalg.norm(rows), atol=2e-5)
