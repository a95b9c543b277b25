"""One half of the board: models fitted on some vehicles, sampled under the context of the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.drives.drive import STEP, Run
from xosc_lateral.drivers.evaluation.snippets import (
    FLOOR_DRAWS,
    LENGTHS,
    Features,
    SnippetCondition,
    Snippets,
    features_of,
    real_against_real,
    snippets_of,
    windows_with_the_same_start,
)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_WINDOWS = 20
"""Fewer of a length, in either half: the condition is left out."""

ENSEMBLE = 8
"""Sampled windows for each real one of 10 s: proper scores need several."""

DRAWS = 4
"""Sets of windows that ranked distances are averaged over: as large as the real set each, so that the floor stays fair,
and several, so that two models are not ranked by the luck of one. The floor with the same start has as many."""

CONDITIONS = tuple(SnippetCondition(seconds, same_start) for seconds in LENGTHS for same_start in (True, False))


@dataclass(frozen=True, eq=False)
class Half:
    """Vehicles to be scored on, with what the other vehicles do as the floor.

    Parameters
    ----------
    train, test : list of Run
    windows : mapping of float to Snippets
        Of the scored vehicles, by length. [s]
    donors : mapping of float to Snippets
        Of the others.
    features : mapping of float to Features
        Of the scored windows.
    stand_ins : mapping of float to array, shape (n, k)
        Rows of the donors with the same start.
    """

    train: list[Run]
    test: list[Run]
    windows: Mapping[float, Snippets]
    donors: Mapping[float, Snippets]
    features: Mapping[float, Features]
    donor_features: Mapping[float, Features]
    stand_ins: Mapping[float, IntArray]

    @property
    def conditions(self) -> tuple[SnippetCondition, ...]:
        """Those with enough windows."""
        return tuple(one for one in CONDITIONS if one.seconds in self.windows)


def make_half(train: list[Run], test: list[Run], rng: np.random.Generator) -> Half:
    """Cut windows and choose the floor's stand-ins."""
    windows, donors = {}, {}
    for seconds in LENGTHS:
        own, others = (snippets_of(runs, seconds, STEP, by_block=False) for runs in (test, train))
        if min(len(own), len(others)) >= LEAST_WINDOWS:
            windows[seconds], donors[seconds] = own, others
    stand_ins = {
        seconds: windows_with_the_same_start(
            own.offset[:, 0],
            own.group,
            donors[seconds].offset[:, 0],
            donors[seconds].group,
            rng,
            count=ENSEMBLE,
        )
        for seconds, own in windows.items()
    }
    return Half(
        train,
        test,
        windows,
        donors,
        {seconds: features_of(own.offset, own.lane_width, STEP) for seconds, own in windows.items()},
        {seconds: features_of(own.offset, own.lane_width, STEP) for seconds, own in donors.items()},
        stand_ins,
    )


def floors(half: Half, condition: SnippetCondition) -> Mapping[str, float]:
    """Real against real under a condition, by family. [unit of the family]"""
    real, donors = half.features[condition.seconds], half.donor_features[condition.seconds]
    rows, others = np.arange(len(real)), np.arange(len(donors))
    chosen = half.stand_ins[condition.seconds][:, :FLOOR_DRAWS] if condition.same_start else None
    return real_against_real(real, donors, rows, others, chosen)


def pooled(values: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Mean over the halves, of what all of them have. [-]"""
    common = [name for name in values[0] if all(name in other for other in values)]
    return {name: float(np.mean([other[name] for other in values])) for name in common}
