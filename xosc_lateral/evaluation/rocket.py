"""Random convolutional features of snippets: a second pair of eyes, which knows nothing of spectra or metrics.

Written here in a few lines of numpy. The packages that have it were looked at: aeon 1.6 wants numba below 0.64, both it
and sktime 1.2 want pandas below 3.1, older versions than this package runs with; and each brings a toolbox for one
transform.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

TAPS, HEAVY = 9, 3
"""Of a kernel: three of its nine weights are 2, the others -1, which makes 84 kernels. [-]"""
KERNELS = tuple(combinations(range(TAPS), HEAVY))
MOST_DILATIONS = 32
"""Of the paper; a snippet of 51 rows has room for six. [-]"""
BIASES = 24
"""Features of each kernel: 2016 in all instead of the paper's 9996, which are meant for longer series. [-]"""
GOLDEN = (np.sqrt(5.0) + 1.0) / 2.0


def rocket_features(snippets: FloatArray, examples: FloatArray, seed: int = 0) -> FloatArray:
    """Share of each convolution's values above a bias (MiniRocket).

    Parameters
    ----------
    snippets : array, shape (n, m)
        m of at least 9. [m]
    examples : array, shape (k, m)
        Snippets whose convolutions give the biases, as quantiles. [m]
    seed : int
        Of which example gives which bias.

    Returns
    -------
    array, shape (n, 84 * BIASES)
        [-]

    References
    ----------
    .. [1] A. Dempster, D. F. Schmidt, G. I. Webb, "MiniRocket: A Very Fast (Almost) Deterministic Transform for Time
       Series Classification", KDD 2021, arXiv:2012.08791.
    """
    rng = np.random.default_rng(seed)
    dilations, counts = _dilations(snippets.shape[1])
    found, number = np.empty((len(snippets), len(KERNELS) * BIASES)), 0
    for which, (dilation, count) in enumerate(zip(dilations, counts, strict=True)):
        taps, known = _taps(snippets, dilation), _taps(examples, dilation)
        every, all_known = taps.sum(axis=0), known.sum(axis=0)
        for kernel, heavy in enumerate(KERNELS):
            bare = (which + kernel) % 2 == 1 and snippets.shape[1] > 2 * (TAPS // 2) * dilation
            inside = slice((TAPS // 2) * dilation, -(TAPS // 2) * dilation) if bare else slice(None)
            values = (3.0 * taps[list(heavy)].sum(axis=0) - every)[:, inside]
            drawn = int(rng.integers(len(examples)))
            example = (3.0 * known[list(heavy), drawn].sum(axis=0) - all_known[drawn])[inside]
            for quantile in (np.arange(number + 1, number + count + 1) * GOLDEN) % 1.0:
                found[:, number] = (values > np.quantile(example, quantile)).mean(axis=1)
                number += 1
    return found


def _dilations(length: int) -> tuple[list[int], list[int]]:
    """Dilations, and how many of a kernel's features each has."""
    largest = np.log2(max(length - 1, TAPS - 1) / (TAPS - 1))
    spaced = np.logspace(0.0, largest, min(BIASES, MOST_DILATIONS), base=2.0).astype(np.int64)
    dilations, counts = np.unique(spaced, return_counts=True)
    return dilations.tolist(), counts.tolist()


def _taps(snippets: FloatArray, dilation: int) -> FloatArray:
    """The snippets moved by each tap of a dilated kernel, zeros beyond their ends, shape (9, n, m)."""
    n, m = snippets.shape
    reach = (TAPS // 2) * dilation
    padded = np.zeros((n, m + 2 * reach))
    padded[:, reach : reach + m] = snippets
    return np.array([padded[:, k * dilation : k * dilation + m] for k in range(TAPS)])
