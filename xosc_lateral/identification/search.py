"""What stays the same while terms are looked for: columns, candidates before whitening, random streams."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.candidates import candidates_of
from xosc_lateral.identification.columns import Column
from xosc_lateral.identification.dictionary import (
    CROSS_BASIS,
    TIMINGS,
    Dictionary,
    Quantities,
    build_dictionary,
    orthonormal,
)
from xosc_lateral.identification.problem import Problem
from xosc_lateral.identification.regression import Coarse
from xosc_lateral.identification.significance import Budget

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_PRODUCT_COLUMNS = 24
"""Products are tried among all columns up to this number; beyond, of levels and switches with every column: sixty more
columns must not cost twenty times as much."""


@dataclass(frozen=True, eq=False)
class Search:
    """What stays the same.

    Parameters
    ----------
    coarse : Coarse
    columns : mapping of str to Column
        That may act.
    quantities : Quantities
    seed : SeedSequence
    budget : Budget
        How surely each component has to be found.
    progress : callable
        Told what is being done, in a few words.
    share : float
        Of the table's rows that `coarse` is.
    """

    coarse: Coarse
    columns: Mapping[str, Column]
    quantities: Quantities
    seed: np.random.SeedSequence
    budget: Budget
    progress: Callable[[str], None]
    share: float = 1.0
    _built: list[tuple[object, object, Dictionary]] = field(default_factory=list, repr=False)

    @classmethod
    def over(
        cls,
        coarse: Coarse,
        columns: list[Column],
        seed: np.random.SeedSequence,
        budget: Budget,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Search:
        """Evaluate all candidates once."""
        inside = coarse.timeline.valid
        seen = {column.name: coarse.context[column.name][inside] for column in columns}
        candidates = candidates_of(columns, seen, most=MAX_PRODUCT_COLUMNS)
        quantities = Quantities.of(candidates, coarse.timeline, coarse.context, coarse.valid)
        return cls(coarse, {column.name: column for column in columns}, quantities, seed, budget, progress)

    def dictionary(self, kind: object, fitted: object, problem: Problem) -> Dictionary:
        """Whitened candidates of one kind of term beside one fit; the last two are kept."""
        for known_kind, known_fit, dictionary in self._built:
            if known_kind is kind and known_fit is fitted:
                return dictionary
        dictionary = build_dictionary(self.quantities, problem.whitener)
        del self._built[:-1]
        self._built.append((kind, fitted, dictionary))
        return dictionary

    def cross_basis(self, columns: Collection[str]) -> FloatArray:
        """What columns can do in any shape, at any lag and response, at 1 Hz, orthonormal, shape (n, rank)."""
        known = frozenset(columns)
        own = [i for i, one in enumerate(self.quantities.candidates) if known.issuperset(one.columns)]
        seconds, valid = np.arange(len(self.coarse)), self.coarse.valid[:, None]
        responses = [(self.quantities.responses(own, response_s), lags) for response_s, lags in TIMINGS.items()]
        blocks = [
            response[np.clip(seconds - lag, 0, len(seconds) - 1)] * valid
            for response, lags in responses
            for lag in lags
        ]
        return orthonormal(np.concatenate(blocks, axis=1).astype(np.float64), CROSS_BASIS)

    def level_of(self, component: str) -> float:
        """Family-wise level that a component may spend on these rows."""
        return self.budget.level_of(component, self.coarse.drives, self.share)

    def rng(self, *key: int) -> np.random.Generator:
        """Independent stream by purpose."""
        return np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))
