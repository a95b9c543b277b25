"""From the largest scores under the null to a family-wise p-value.

The maximum over many candidates converges to a Gumbel law; fitted to the maxima of a few hundred rotations it gives
p-values far below one over their number [1]_. The larger of that and of an exponential tail is taken.

References
----------
.. [1] A. M. Winkler et al., "Faster permutation inference in brain imaging", NeuroImage 141, 2016.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST = 1e-300
"""p-values stay above: their logarithm is taken. [-]"""

BUDGET = 0.025
"""Probability that anything is named that does not act: on 39 tables of 40 nothing wrong is to be named. [-]"""

TAIL_SHARE = 0.25
"""Share of a null sample that an exponential tail is fitted on. [-]"""

HEAVY_TAIL_SHARE = 0.1
"""Share that the tail of a quadratic form is fitted on: further in it is no exponential yet. [-]"""

ENOUGH = 10
"""So many draws of a null that reach a score tell its probability to a third, without any law of the tail."""

MANY_DRIVES = 20
"""From so many drives on a table tells what differs between them, and its null is drawn by whole drives."""


@dataclass(frozen=True, slots=True)
class Budget:
    """How the error budget is shared among the components that are looked for.

    Parameters
    ----------
    weights : mapping of str to float
        Of each component. As shipped: as much for the mean within drives as between them; a quarter for what changes
        the movement's size or its strength; the rest for hidden effects, most for regimes: little tells them from
        clusters of seconds (on and off by a factor of 2.7 in a drive of 50 min has p = 0.003). [-]
    """

    weights: Mapping[str, float]

    def level_of(self, component: str, drives: int) -> float:
        """Family-wise level that a component may spend.

        Parameters
        ----------
        component : str
        drives : int
            In the table. Where nothing can be asked between them, that share is not spent: a table on which something
            acts is searched again beside it, at the same levels.
        """
        if drives < MANY_DRIVES and component == "between":
            return 0.0
        return BUDGET * self.weights[component] / sum(self.weights.values())


def upper_tail(score: float, maxima: FloatArray) -> float:
    """Probability, `LEAST` to 1, that chance gives a maximum of `score` or more. [-]

    Parameters
    ----------
    score : float
    maxima : array, shape (n,)
        Largest scores under the null.
    """
    from scipy.stats import gumbel_r

    if len(maxima) == 0:
        return 1.0
    share = float(np.mean(maxima >= score))
    if share > 0.1:  # where the sample itself is known well
        return share
    # a score that is no maximum of many may have a heavier tail: an exponential one with the upper quarter's excess
    knee = float(np.quantile(maxima, 1.0 - TAIL_SHARE))
    excess = max(float(np.mean(maxima[maxima > knee] - knee)) if np.any(maxima > knee) else 0.0, 2.0)
    exponential = TAIL_SHARE * float(np.exp(-max(score - knee, 0.0) / excess))
    scale = max(float(np.std(maxima, ddof=1)) * np.sqrt(6.0) / np.pi, 1e-12)
    place = float(np.mean(maxima)) - np.euler_gamma * scale
    return max(float(gumbel_r.sf(score, place, scale)), exponential, LEAST)


def exponential_tail(score: float, null: FloatArray) -> float:
    """Probability, `LEAST` to 1, that chance gives `score` or more, where the null's tail falls as an exponential. [-]

    Quadratic forms of what comes in clusters have such tails, heavier than those of normal scores. Where `ENOUGH` of
    the null reach the score, it is their share.

    Parameters
    ----------
    score : float
    null : array, shape (n,)
        Scores under the null.
    """
    reached = int(np.count_nonzero(null >= score))
    if reached >= ENOUGH or len(null) == 0:
        return reached / len(null) if len(null) else 1.0
    knee = float(np.quantile(null, 1.0 - HEAVY_TAIL_SHARE))
    excess = max(float(np.mean(null[null > knee] - knee)) if np.any(null > knee) else 0.0, 1e-300)
    p_value = HEAVY_TAIL_SHARE * float(np.exp(-max(score - knee, 0.0) / excess))
    return max(min(p_value, ENOUGH / len(null)), LEAST)


def as_one_degree(chi_square: FloatArray | float, degrees: int) -> FloatArray:
    """Chi-square with one degree of freedom that is as rare as one with `degrees`, of the same shape."""
    from scipy.stats import chi2

    return np.asarray(chi2.isf(np.maximum(chi2.sf(chi_square, degrees), LEAST), 1))
