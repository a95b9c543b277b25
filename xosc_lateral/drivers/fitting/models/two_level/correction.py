"""The two-level model's parameters freed of what its own fit does to them, by indirect inference.

Fitted to drives that were sampled from it, the model comes out with bins that are left a third too seldom (the smoothed
chain passes an edge later and less often than the chain does) and other damping (`laboratory/two_level_bias.py`). Here
parameters are sought of which samples, fitted again, give what was fitted to the measured drives [1]_.

References
----------
.. [1] C. Gourieroux, A. Monfort, E. Renault, "Indirect inference", J. Applied Econometrics 8, 1993.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.fitting.models.two_level.fit import fit_two_level
from xosc_lateral.drivers.model.core.two_level.model import TwoLevelModel

ROUNDS, STEPS = 6, 200_000  # Rounds, and simulated steps of each: 11 h, whose scatter is a per cent.
PARTS = 100  # Of a transition: counts are whole numbers.
LARGEST_CHANGE = 2.0  # Factor of one round, at most. [-]
SEED = 0  # The same each time: same drives, same profile.


def correct_two_level(model: TwoLevelModel) -> TwoLevelModel:
    """The model whose samples, fitted again, are like the one given: leaving rate of all bins together, and damping."""
    target, corrected = leaving_rate(model.counts), model
    factor, damping = 1.0, np.array(model.damping)
    for number in range(ROUNDS):
        stream = corrected.stream(np.random.SeedSequence([SEED, number]))
        again = fit_two_level([np.sum(stream.take(STEPS), axis=0)], model.settings)
        factor *= float(_bounded(target / max(leaving_rate(again.counts), 1e-12)))
        damping = damping * _bounded(model.damping / np.maximum(again.damping, 1e-12))
        corrected = TwoLevelModel(model.settings, _left_more_often(model.counts, factor), damping)
    return corrected


def leaving_rate(counts: IntArray) -> float:
    """Share of transitions that leave their bin. [-]"""
    return 1.0 - float(np.trace(counts)) / float(counts.sum())


def _bounded(ratio: FloatArray | float) -> FloatArray:
    return np.clip(ratio, 1.0 / LARGEST_CHANGE, LARGEST_CHANGE)


def _left_more_often(counts: IntArray, factor: float) -> IntArray:
    """Counts, in parts, with so many times the transitions out of each bin, at most all of them."""
    out = counts * ~np.eye(len(counts), dtype=np.bool_)
    total, leaving = counts.sum(axis=1), out.sum(axis=1)
    most = np.minimum(factor, total / np.maximum(leaving, 1))
    parts = np.rint(PARTS * out * most[:, None]).astype(np.int64)
    return np.asarray(parts + np.diag(np.maximum(PARTS * total - parts.sum(axis=1), 0)))
