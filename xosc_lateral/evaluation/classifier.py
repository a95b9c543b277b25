"""Can a classifier tell sampled snippets from real ones? The strictest of the scores, since it looks at everything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.metrics import DIFFERENCE_SCALE, snippet_metrics

FloatArray = NDArray[np.float64]

MEMORY_LAGS = (1, 2, 3, 5, 8, 12)  # steps; of the first difference's autocorrelation
FOLDS = 5


def snippet_features(snippets: FloatArray) -> FloatArray:
    """Everything that gives a model away: values, differences, log spectrum, the ten metrics, roughness, memory.

    Parameters
    ----------
    snippets : array, shape (n, m)
        [m]

    Returns
    -------
    array, shape (n, k)
    """
    difference = np.diff(snippets, axis=1)
    centred = snippets - snippets.mean(axis=1, keepdims=True)
    power = np.log(np.abs(np.fft.rfft(centred, axis=1)) ** 2 + 1e-12)
    energy = (difference**2).mean(axis=1) + 1e-15
    memory = [(difference[:, lag:] * difference[:, :-lag]).mean(axis=1) / energy for lag in MEMORY_LAGS]
    roughness = np.log(np.diff(difference, axis=1).std(axis=1) + 1e-9)
    return np.column_stack(
        [snippets, DIFFERENCE_SCALE * difference, power, snippet_metrics(snippets), roughness, *memory]
    )


def told_apart(
    real: FloatArray,
    other: FloatArray,
    groups_real: NDArray[np.generic],
    groups_other: NDArray[np.generic],
    *,
    seed: int = 0,
) -> float | None:
    """Cross-validated area under the ROC curve of a gradient-boosted classifier between two sets of snippets.

    Parameters
    ----------
    real, other : array, shape (n, m) and (k, m)
    groups_real, groups_other : array, shape (n,) and (k,)
        Drives: no drive is both learnt from and judged.

    Returns
    -------
    float or None
        0.5: can't tell; 1.0: always can. None without scikit-learn (extra `classifier`) or with fewer than five drives.
    """
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
        from sklearn.metrics import roc_auc_score
        from sklearn.model_selection import GroupKFold, cross_val_predict
        from threadpoolctl import threadpool_limits  # comes with scikit-learn
    except ImportError:
        return None
    groups = np.concatenate([groups_real, groups_other])
    if len(np.unique(groups)) < FOLDS:
        return None
    features = np.vstack([snippet_features(real), snippet_features(other)])
    label = np.r_[np.zeros(len(real)), np.ones(len(other))]
    model = HistGradientBoostingClassifier(max_iter=200, random_state=seed)
    # One thread: on a machine that is busy otherwise, its threads waiting for one another take twenty times as long.
    with threadpool_limits(1):
        chance = cross_val_predict(
            model, features, label, groups=groups, cv=GroupKFold(FOLDS), method="predict_proba", n_jobs=1
        )
    return float(roc_auc_score(label, chance[:, 1]))
