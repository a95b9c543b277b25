"""What stays the same while terms are searched for: the table, its candidates, the error budget, sources of chance."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.loop.candidates import candidates_of
from xosc_lateral.drivers.loop.columns import Column
from xosc_lateral.drivers.loop.dictionary import CROSS_BASIS, TIMINGS, Quantities, orthonormal
from xosc_lateral.drivers.loop.timeline import Coarse

# Products are tried among so many columns at most, those whose role is known first: sixty more columns must not cost
# twenty times as much.
MAX_PRODUCT_COLUMNS = 24
# Scored dictionaries that are kept, each of tens of megabytes: of the mean and of the spread beside the same fit.
KEPT_DICTIONARIES = 2


@dataclass(frozen=True, eq=False)
class Search:
    """What stays the same while terms are selected: columns, candidates before whitening, random streams."""

    coarse: Coarse
    columns: Mapping[str, Column]  # That may act.
    quantities: Quantities
    seed: np.random.SeedSequence
    levels: Mapping[str, float]  # Family-wise p-value up to which the best of each component counts as found.
    progress: Callable[[str], None]  # Gets what is being done, in a few words.
    # How many terms a component has in the table that this is a part of: so many are added, best first, whatever their
    # p-values, and components that have none are not tested. None: this is the table.
    wanted: Mapping[str, int] | None = None
    _kept: dict[tuple[object, int], tuple[object, Any]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def over(
        cls,
        coarse: Coarse,
        columns: list[Column],
        seed: np.random.SeedSequence,
        levels: Mapping[str, float],
        progress: Callable[[str], None] = lambda _: None,
    ) -> Search:
        """Evaluate all candidates once."""
        inside = coarse.timeline.valid
        seen = {column.name: coarse.context[column.name][inside] for column in columns}
        candidates = candidates_of(columns, seen, most=MAX_PRODUCT_COLUMNS)
        quantities = Quantities.of(candidates, coarse.timeline, coarse.context, coarse.valid)
        return cls(coarse, {column.name: column for column in columns}, quantities, seed, levels, progress)

    def once(self, kind: object, fitted: object, make: Callable[[], Any]) -> Any:
        """What is worked out once for one kind of term beside one fit; the last few are kept, for one thread."""
        key = (kind, id(fitted))
        if key not in self._kept:
            self._kept[key] = (fitted, make())  # the fit is kept with it: no other has its id meanwhile
            for old in list(self._kept)[:-KEPT_DICTIONARIES]:
                del self._kept[old]
        return self._kept[key][1]

    def cross_basis(self, columns: Collection[str]) -> FloatArray:
        """What columns can do in any shape, at any lag and response, at 1 Hz, orthonormal, shape (n, rank)."""
        known = frozenset(columns)
        own = np.array([known.issuperset(one.columns) for one in self.quantities.candidates], dtype=np.bool_)
        seconds, valid = np.arange(len(self.coarse)), self.coarse.valid[:, None]
        blocks = []
        for response_s, lags in TIMINGS.items():
            response = self.quantities.responses(np.flatnonzero(own), response_s)
            blocks += [response[np.clip(seconds - lag, 0, len(seconds) - 1)] * valid for lag in lags]
        return orthonormal(np.concatenate(blocks, axis=1).astype(np.float64), CROSS_BASIS)
