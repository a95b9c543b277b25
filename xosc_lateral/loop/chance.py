"""How often would chance do that? From a sample of what chance did, to probabilities far beyond the sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST = 1e-300
"""Smallest probability that is reported."""

TAIL_SHARE = 0.25
"""Share of the null sample that the tail is fitted on."""

LIGHTEST_TAIL = 2.0
"""Mean excess of a chi-square of one degree of freedom far out: the tail is never taken as lighter. [chi-square]"""


def tail_probability(observed: float, null: FloatArray) -> float:
    """Probability that chance reaches `observed`, with `null` a sample of chance's best chi-squares.

    Inside the sample by rank; beyond its upper quarter by an exponential tail, the limit for maxima of chi-squares,
    whose mean excess is taken from the sample (but never as lighter than theory has it).
    """
    null = np.sort(np.asarray(null, dtype=np.float64))
    above = float(np.sum(null >= observed))
    knee = float(np.quantile(null, 1.0 - TAIL_SHARE))
    if observed <= knee:
        return (above + 1.0) / (len(null) + 1.0)
    excess = null[null > knee] - knee
    scale = max(float(excess.mean()) if len(excess) else LIGHTEST_TAIL, LIGHTEST_TAIL)
    return float(max(TAIL_SHARE * np.exp(-(observed - knee) / scale), LEAST))
