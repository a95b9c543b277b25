"""What a search remembers, and what the search of a part begins with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import KEPT_DICTIONARIES, Search
from xosc_lateral.extras.loop.selection import ERROR_BUDGET


def test_what_was_worked_out_last_is_kept_beside_its_fit_and_not_in_a_part() -> None:
    """Folds are searched side by side, in threads: each begins with a memory of its own."""
    rng = np.random.default_rng(1)
    coarse = coarse_of(movement(rng, 200.0), {"x": wander(rng, 1000, 12.0)})
    search = Search.over(coarse, [Column("x", Values.NUMBER, False)], np.random.SeedSequence(1), ERROR_BUDGET)
    made: list[int] = []

    def make() -> int:
        made.append(len(made))
        return made[-1]

    fits = [object() for _ in range(KEPT_DICTIONARIES + 1)]
    assert [search.once(int, fit, make) for fit in fits] == list(range(KEPT_DICTIONARIES + 1))
    assert [search.once(int, fit, make) for fit in fits[1:]] == list(range(1, KEPT_DICTIONARIES + 1))
    assert replace(search, coarse=coarse).once(int, fits[-1], make) == KEPT_DICTIONARIES + 1
    assert search.once(int, fits[0], make) == KEPT_DICTIONARIES + 2
    assert search.once(str, fits[-1], make) == KEPT_DICTIONARIES + 3
