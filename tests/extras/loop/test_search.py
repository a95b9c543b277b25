"""What a search remembers, and what the search of a part begins with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
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

    first, second = object(), object()
    assert [search.once(int, fit, make) for fit in (first, first, second, second)] == [0, 0, 1, 1]
    assert replace(search, coarse=coarse).once(int, second, make) == 2
    assert search.once(int, first, make) == 3
    assert search.once(str, first, make) == 4
    search.forget()
    assert search.once(str, first, make) == 5
