"""Columns whose usual value in a drive goes with the place that the drive keeps: slow vehicles keep right, say.

Every drive has an intercept of its own, so what hardly changes within drives can't act on the mean there. Here the
intercepts themselves are regressed on what each drive usually meets, weighted by how well each is known beside how much
drives differ anyway. The null deals the drives anew, which is exact: drives know nothing of one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect
from xosc_lateral.loop.candidates import Candidate, single_candidates
from xosc_lateral.loop.chance import tail_probability
from xosc_lateral.loop.columns import Column
from xosc_lateral.loop.movement import Coarse, Fitted
from xosc_lateral.loop.search import support_of

FloatArray = NDArray[np.float64]

HABIT_S = 60.0
"""Response time of an effect between drives: what a drive usually meets, as far as a run can know it. [s]"""

MIN_DRIVES = 20
"""Fewer drives say nothing about what goes with what between them."""

MIN_SECONDS = 10
"""Of road-following in a drive that is counted. [s]"""

MIN_SUPPORT = 8.0
"""A quantity that hangs on fewer drives than this is not looked at."""

N_PERMUTED = 1000
"""Times that the drives are dealt anew."""


@dataclass(frozen=True, slots=True)
class Between:
    """The best column between drives.

    Parameters
    ----------
    candidate : Candidate
    chi_square : float
    p_value : float
        Of the best of all candidates.
    """

    candidate: Candidate
    chi_square: float
    p_value: float


@dataclass(frozen=True, eq=False, slots=True)
class _Places:
    """Places that drives keep.

    Parameters
    ----------
    place : array, shape (drives,)
        Intercepts. [m]
    weight : array, shape (drives,)
        One over the variance of a place about what is known; 0: the drive is too short. [1/m^2]
    known : array, shape (drives, k)
        A one and the effects between drives that are in the model.
    """

    place: FloatArray
    weight: FloatArray
    known: FloatArray

    def left(self, values: FloatArray) -> FloatArray:
        """Times the weight's root, free of what is known; shape of `values`, (drives,) or (drives, m)."""
        root = np.sqrt(self.weight)
        basis = np.linalg.qr(self.known * root[:, None])[0]
        weighed = (values.T * root).T
        return np.asarray(weighed - basis @ (basis.T @ weighed))


def is_between(effect: ColumnEffect) -> bool:
    """Whether an effect acts by what a drive usually meets."""
    return effect.response_s >= HABIT_S


def find_between(coarse: Coarse, fitted: Fitted, columns: Sequence[Column], rng: np.random.Generator) -> Between | None:
    """The column between drives that chance explains least; None with too few drives or columns."""
    places = _places(coarse, fitted)
    if np.count_nonzero(places.weight) < MIN_DRIVES:
        return None
    present = {column for effect in fitted.terms.between for column in effect.columns}
    seen = {name: values[coarse.timeline.valid] for name, values in coarse.context.items()}
    candidates, means = [], []
    for candidate in single_candidates([column for column in columns if column.name not in present], seen):
        habit = replace(candidate, effect=replace(candidate.effect, response_s=HABIT_S))
        usual = usual_answers(coarse, habit.effect)
        if usual.shape[1] == 1 and support_of(places.left(usual)) >= MIN_SUPPORT:
            candidates.append(habit)
            means.append(usual[:, 0])
    if not candidates:
        return None
    quantities = places.left(np.stack(means, axis=1))
    quantities /= np.sqrt(np.square(quantities).sum(axis=0))
    costs = np.array([candidate.cost for candidate in candidates])
    response = places.left(places.place)
    scores = np.square(response @ quantities) - costs
    rows = np.flatnonzero(places.weight)
    null = np.empty(N_PERMUTED)
    for index in range(N_PERMUTED):
        dealt = np.zeros_like(response)
        dealt[rows] = response[rng.permutation(rows)]
        null[index] = float((np.square(dealt @ quantities) - costs).max())
    best = int(np.argmax(scores))
    return Between(candidates[best], float(scores[best] + costs[best]), tail_probability(float(scores[best]), null))


def size_between(coarse: Coarse, fitted: Fitted) -> tuple[FloatArray, FloatArray]:
    """Sizes of the effects between drives in the model, and their standard errors, shape (k,) each. [m] per unit"""
    places = _places(coarse, fitted)
    weighed = places.known * places.weight[:, None]
    inverse = np.linalg.pinv(weighed.T @ places.known)
    return (inverse @ (weighed.T @ places.place))[1:], np.sqrt(np.diag(inverse))[1:]


def between_shift(coarse: Coarse, fitted: Fitted) -> FloatArray:
    """What the effects between drives do to every drive's place, shape (drives,). [m]"""
    shift = np.zeros(len(fitted.intercepts))
    for effect, size in zip(fitted.terms.between, size_between(coarse, fitted)[0], strict=True):
        shift += size * usual_answers(coarse, effect)[:, 0]
    return shift


def usual_answers(coarse: Coarse, effect: ColumnEffect) -> FloatArray:
    """Mean of an effect's quantity over each drive, shape (drives, k); 0 for a drive without road-following."""
    answer = coarse.answer(effect)
    groups = int(coarse.drive.max()) + 1
    count = np.maximum(np.bincount(coarse.drive, coarse.valid.astype(float), minlength=groups), 1.0)
    sums = [np.bincount(coarse.drive, np.where(coarse.valid, one, 0.0), minlength=groups) for one in answer.T]
    return np.stack(sums, axis=1) / count[:, None]


def _places(coarse: Coarse, fitted: Fitted) -> _Places:
    groups = len(fitted.intercepts)
    seconds = np.bincount(coarse.drive, coarse.valid.astype(float), minlength=groups)
    ones = fitted.whitener.white(np.ones(len(coarse)))
    power = np.bincount(coarse.drive, ones**2, minlength=groups)
    counted = (seconds >= MIN_SECONDS) & (power > 0.0)
    noise = np.where(counted, 1.0 / np.maximum(power, 1e-300), np.inf)
    usual = [usual_answers(coarse, effect) for effect in fitted.terms.between]
    known = np.concatenate([np.ones((groups, 1)), *usual], axis=1)
    scatter = 0.0
    for _ in range(20):
        places = _Places(fitted.intercepts, np.where(counted, 1.0 / (scatter + noise), 0.0), known)
        left = places.left(fitted.intercepts)
        freedom = max(int(counted.sum()) - known.shape[1], 1)
        # the scatter at which the weighed squares add up to their degrees of freedom
        scatter = max(
            scatter + (float(left @ left) / freedom - 1.0) / max(float(places.weight[counted].mean()), 1e-30), 0.0
        )
    return places
