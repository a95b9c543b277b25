"""What a search remembers, and what the search of a part begins with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.identification.made_coarse import coarse_of, movement, wander
from xosc_lateral.identification.columns import Column, Values
from xosc_lateral.identification.search import Recent, Search
from xosc_lateral.identification.selection import ERROR_BUDGET


def test_the_last_few_are_kept() -> None:
    made: list[int] = []

    def make() -> int:
        made.append(len(made))
        return made[-1]

    recent: Recent[int] = Recent(3)
    fits = [object() for _ in range(5)]
    assert [recent.of(int, fit, make) for fit in fits] == [0, 1, 2, 3, 4]
    assert [recent.of(int, fit, make) for fit in fits[2:]] == [2, 3, 4]
    assert recent.of(int, fits[0], make) == 5
    assert recent.of(str, fits[4], make) == 6


def test_the_search_of_a_part_begins_with_a_memory_of_its_own() -> None:
    """Folds are searched side by side, in threads."""
    rng = np.random.default_rng(1)
    coarse = coarse_of(movement(rng, 200.0), {"x": wander(rng, 1000, 12.0)})
    search = Search.over(coarse, [Column("x", Values.NUMBER, False)], np.random.SeedSequence(1), ERROR_BUDGET)
    fit, kind = object(), object()
    assert search.likeliest(kind, fit, lambda: None) is None
    asked = []
    replace(search, coarse=coarse).likeliest(kind, fit, lambda: asked.append(1))
    search.likeliest(kind, fit, lambda: asked.append(2))
    assert asked == [1]
