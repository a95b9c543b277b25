"""Measured movement with the effects taken out: what the base model is fitted on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Effect
from xosc_lateral.driver.place import COLUMNS
from xosc_lateral.drives.cuts import MIN_RUN
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.filters import filtered
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.terms.base import Removal, Term
from xosc_lateral.identification.timeline import Timeline
from xosc_lateral.mask import true_slices

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FINE_S = 1.0
"""Movement within this time counts as fine when a spread is taken out. [s]"""

Estimates = Mapping[str, tuple[Term, tuple[Effect, ...]]]
"""By key ("mean 0", "step 0"): a term and what the profile gets for it."""


def estimate_all(fitted: Fitted) -> Estimates:
    """Sizes of everything in the model; the key counts terms of one component."""
    found: dict[str, tuple[Term, tuple[Effect, ...]]] = {}
    for term in fitted.terms:
        assert isinstance(term, Term)
        number = sum(1 for key in found if key.rpartition(" ")[0] == term.kind_key)
        found[f"{term.kind_key} {number}"] = (term, term.estimate(fitted))
    return found


def removal_of(fitted: Fitted, estimates: Estimates) -> Removal:
    """What all terms did to the measured offsets."""
    removal = Removal(np.zeros(len(fitted.coarse.timeline)))
    for term, effects in estimates.values():
        term.remove(fitted, effects, removal)
    return removal


def bare_runs(timeline: Timeline, removal: Removal, used: BoolArray) -> list[Run]:
    """Runs of the movement [m] without effects, from the valid rows in `used`, shape (n,); at least `MIN_RUN` long.

    They know class, lane and speed, as far as the table does: what these do to a population is fitted with its base.
    """
    runs: list[Run] = []
    for index, name in enumerate(timeline.names):
        for rows in true_slices(timeline.valid & used & (timeline.drive == index)):
            if (rows.stop - rows.start) * STEP >= MIN_RUN:
                runs.append(_run(timeline, removal, rows, name, len(runs)))
    return runs


def bare_movement(timeline: Timeline, removal: Removal, rows: slice, mean: float | None = None) -> FloatArray:
    """Offsets of one uninterrupted stretch without the effects, about their own mean or a given one. [m] Shape (k,)."""
    left = timeline.offset[rows] - removal.location[rows]
    mean = float(left.mean()) if mean is None else mean
    slow = _smooth(left)
    spread, fine = np.exp(-removal.spread[rows]), np.exp(-removal.fine[rows])
    return np.asarray(mean + (slow - mean) * spread + (left - slow) * fine)


def _run(timeline: Timeline, removal: Removal, rows: slice, name: str, index: int) -> Run:
    movement = bare_movement(timeline, removal, rows)
    width = timeline.lane_width[rows]
    context = {name: timeline.context[name][rows] for name in COLUMNS if name in timeline.context}
    time = timeline.time[rows.start] + STEP * np.arange(len(movement))
    return Run(name, index, time, movement, width, context, frozenset())


def _smooth(values: FloatArray) -> FloatArray:
    width = 2 * round(0.5 * FINE_S / STEP) + 1
    return filtered(values, np.ones(width) / width)
