"""How much drivers differ in their response to a column: the variance of the slopes between drives.

Method of moments [1]_: slopes of single drives scatter by more than their standard errors explain, or they do not.

References
----------
.. [1] R. DerSimonian, N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7, 1986.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.innovations import whitener_as_seen
from xosc_lateral.identification.regression import Fitted, ModelTerm
from xosc_lateral.identification.significance import MANY_DRIVES

FloatArray = NDArray[np.float64]

LEVEL = 0.01
"""Probability of taking noise for drivers that differ; drivers that are alike are the simpler profile. [-]"""


def slope_deviation(fitted: Fitted, term: ModelTerm) -> float:
    """Standard deviation between drives of the only coefficient of a term of the mean; 0: none is seen. [m per unit]"""
    part = fitted.mean_part(term)
    coarse = fitted.coarse
    if part.stop - part.start != 1 or coarse.drives < MANY_DRIVES:
        return 0.0
    # independent rows, which a floor does not leave: what they have in common would look like drivers that differ
    whitener = whitener_as_seen(fitted.movement, coarse.valid, coarse.drive, fitted.scale)
    column = whitener.rows(fitted.columns[:, part])[:, 0]
    rows = whitener.rows(fitted.movement * fitted.scale)
    rows = rows / max(float(np.sqrt(np.mean(rows[coarse.valid] ** 2))), 1e-300)
    power = np.asarray(np.bincount(coarse.drive, column**2, minlength=coarse.drives), dtype=np.float64)
    told = power > 1e-3 * float(power.mean())
    if told.sum() < MANY_DRIVES:
        return 0.0
    off = np.bincount(coarse.drive, column * rows, minlength=coarse.drives)[told] / power[told]
    return _beyond_chance(power[told], off)


def _beyond_chance(weight: FloatArray, off: FloatArray) -> float:
    """Standard deviation between drives of slopes, shape (k,), known with precisions `weight`; 0: within chance."""
    from scipy.stats import chi2

    off = off - float(weight @ off) / float(weight.sum())
    scatter, freedom = float(weight @ off**2), len(off) - 1
    if chi2.sf(scatter, freedom) > LEVEL:
        return 0.0
    spread = (scatter - freedom) / (weight.sum() - float(weight @ weight) / weight.sum())
    return float(np.sqrt(max(spread, 0.0)))
