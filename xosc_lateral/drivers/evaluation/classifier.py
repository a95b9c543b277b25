"""Does a classifier separate sampled snippets from real ones? The strictest score, since it looks at everything.

References
----------
D. Lopez-Paz, M. Oquab, "Revisiting classifier two-sample tests", ICLR 2017.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.filters import tapered_powers, without_line
from xosc_lateral.drivers.evaluation.metrics import DIFFERENCE_SCALE, snippet_metrics
from xosc_lateral.drivers.evaluation.snippets import Snippets

AUTOCORRELATION_LAGS = (1, 2, 3, 5, 8, 12)  # steps; of the first difference's autocorrelation
FOLDS = 5
BANDS = 16  # Of the log spectrum, from one period a snippet to the highest frequency, evenly on a logarithmic scale.
# Of the log spectrum once more, evenly: what is smoothed piece by piece has its lines and holes at fast movement.
EVEN_BANDS = 25
# Values of a snippet, and differences over as much, that are shown: more slow a tree down and add nothing. [-]
SHOWN_VALUES = 20
# Snippets of either kind that a classifier sees, spread evenly: an error of 0.01 in the area. [-]
MAXIMUM_SNIPPETS = 1500
RESAMPLES = 200  # Of the drives, for the interval.


@dataclass(frozen=True)
class TwoSampleResult:
    """How well two sets of snippets are separated."""

    auc: float  # Area under the ROC curve, cross-validated: 0.5 by chance, 1 always. [-]
    low: float  # Ends of its 95 % interval, drives resampled. [-]
    high: float


def snippet_features(snippets: FloatArray, *, fast: bool = False) -> FloatArray:
    """Everything that gives a model away, shape (n, k); `fast`: also what second and third differences show."""
    difference = np.diff(snippets, axis=1)
    every = max(1, snippets.shape[1] // SHOWN_VALUES)
    thin = snippets[:, ::every]
    energy = (difference**2).mean(axis=1) + 1e-15
    autocorrelation = [
        (difference[:, lag:] * difference[:, :-lag]).mean(axis=1) / energy
        for lag in AUTOCORRELATION_LAGS
        if lag < difference.shape[1]
    ]
    acceleration = np.abs(np.diff(difference, axis=1))
    roughness = np.log(np.column_stack([acceleration.std(axis=1), acceleration.max(axis=1)]) + 1e-9)
    differences = DIFFERENCE_SCALE * np.diff(thin, axis=1)
    metrics = snippet_metrics(snippets)
    power = tapered_powers(without_line(snippets), np.hanning(snippets.shape[1]))
    bins = power.shape[1]
    bands = _log_power(power, np.geomspace(1, bins, BANDS + 1))
    more = [_fast_features(difference), _log_power(power, np.linspace(1, bins, EVEN_BANDS + 1))] if fast else []
    return np.column_stack(
        [thin, differences, bands, metrics, roughness, *autocorrelation, shape_features(snippets), *more]
    )


def _fast_features(difference: FloatArray) -> FloatArray:
    """Size, largest, tails and turns of second and third differences. [log m], [log m], [-], [-] Shape (n, 8)."""
    columns = []
    for order in (1, 2):
        values = np.diff(difference, order, axis=1)
        square = (values**2).mean(axis=1)
        tails = (values**4).mean(axis=1) / np.maximum(square**2, 1e-36)
        largest = np.abs(values).max(axis=1)
        columns += [np.log(np.sqrt(square) + 1e-9), np.log(largest + 1e-9), tails, turns(values)]
    return np.column_stack(columns)


def _log_power(power: FloatArray, edges: FloatArray) -> FloatArray:
    """Logarithm of the mean power [m2] between edges, which are counted in frequencies, shape (n, bands)."""
    whole = np.unique(edges.astype(np.int64)).tolist()
    return np.column_stack([np.log(power[:, a:b].mean(axis=1) + 1e-12) for a, b in pairwise(whole)])


def context_features(snippets: Snippets, paths: FloatArray) -> FloatArray:
    """What was around each snippet, and how a path, shape (n, m) [m], moves with it, shape (n, 3 * columns).

    Mean and standard deviation of every context column, and its correlation with the path; where there is none -2 for a
    correlation, one less than the least for the others, so that a tree can part it from the rest.
    """
    names = sorted({name for one in snippets.items for name in one.run.context})
    empty = np.full(paths.shape[1], np.nan)
    columns = []
    for name in names:
        values = np.array(
            [one.run.context[name][one.rows] if name in one.run.context else empty for one in snippets.items]
        )
        columns += _beside(values, paths)
    return np.column_stack(columns) if columns else np.empty((len(paths), 0))


def _beside(values: FloatArray, paths: FloatArray) -> list[FloatArray]:
    known = np.isfinite(values)
    count = np.where(known.any(axis=1), known.sum(axis=1), np.nan)
    mean = np.where(known, values, 0.0).sum(axis=1) / count
    centred = np.where(known, values - mean[:, None], 0.0)
    spread = np.sqrt((centred**2).sum(axis=1) / count)
    moved = np.where(known, paths - paths.mean(axis=1, keepdims=True), 0.0)
    both = np.sqrt((centred**2).sum(axis=1) * (moved**2).sum(axis=1))
    together = np.divide((centred * moved).sum(axis=1), both, out=np.full(len(paths), -2.0), where=both > 1e-12)
    return [_filled(mean), _filled(spread), together]


def _filled(column: FloatArray) -> FloatArray:
    known = np.isfinite(column)
    return np.where(known, column, column[known].min() - 1.0 if known.any() else 0.0)


def classifier_two_sample_test(
    real: FloatArray,
    other: FloatArray,
    groups_real: NDArray[np.generic],
    groups_other: NDArray[np.generic],
    *,
    context: Sequence[FloatArray] | None = None,
    fast: bool = False,
    seed: int = 0,
) -> TwoSampleResult | None:
    """Train a gradient-boosted classifier to separate two sets of snippets, and judge it on drives it has not seen.

    `real` and `other` of shape (n, m) and (k, m), `groups_...` of shape (n,) and (k,): their drives; `context`:
    features of the context of either, then context and movement are judged jointly. None without scikit-learn (extra
    `classifier`) or with fewer than five drives.
    """
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
        from sklearn.model_selection import GroupKFold, cross_val_predict
        from threadpoolctl import threadpool_limits
    except ImportError:
        return None
    rows, others = spread_out(len(real)), spread_out(len(other))
    groups = np.concatenate([groups_real[rows], groups_other[others]])
    if len(np.unique(groups)) < FOLDS:
        return None
    features = np.vstack([snippet_features(snippets, fast=fast) for snippets in (real[rows], other[others])])
    if context is not None:
        features = np.hstack([features, np.vstack([context[0][rows], context[1][others]])])
    label = np.r_[np.zeros(len(rows)), np.ones(len(others))]
    model = HistGradientBoostingClassifier(max_iter=100, max_bins=63, random_state=seed)
    # One thread: on a machine that is busy otherwise, its threads waiting for one another take twenty times as long.
    with threadpool_limits(1):
        chance = cross_val_predict(
            model, features, label, groups=groups, cv=GroupKFold(FOLDS), method="predict_proba", n_jobs=1
        )
    return _judged(chance[:, 1], label.astype(bool), groups, seed)


def spread_out(count: int) -> NDArray[np.int64]:
    """At most `MAXIMUM_SNIPPETS` of so many rows, evenly. Shape (k,), k <= `MAXIMUM_SNIPPETS`. [-]"""
    return np.unique(np.linspace(0, count - 1, min(count, MAXIMUM_SNIPPETS)).astype(np.int64))


def _judged(score: FloatArray, label: NDArray[np.bool_], groups: NDArray[np.generic], seed: int) -> TwoSampleResult:
    names, member = np.unique(groups, return_inverse=True)
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(RESAMPLES):
        weight = np.bincount(rng.integers(len(names), size=len(names)), minlength=len(names))[member]
        if weight[label].any() and weight[~label].any():
            drawn.append(area_under_roc(score, label, weight.astype(np.float64)))
    low, high = np.quantile(drawn, [0.025, 0.975]) if drawn else (np.nan, np.nan)
    return TwoSampleResult(area_under_roc(score, label, np.ones(len(label))), float(low), float(high))


def area_under_roc(score: FloatArray, label: NDArray[np.bool_], weight: FloatArray) -> float:
    """Probability that a weighted draw of the labelled scores above one of the others; equal ones count half."""
    values, place = np.unique(score, return_inverse=True)
    yes = np.bincount(place, weight * label, minlength=len(values))
    no = np.bincount(place, weight * ~label, minlength=len(values))
    below = np.cumsum(no) - no
    return float((yes * (below + 0.5 * no)).sum() / (yes.sum() * no.sum()))


# ---- the shape of a snippet in a dozen numbers, whatever its place and size ----
# Columns of `shape_features`; most are features of catch22.
SHAPES = (
    *("mode_5", "mode_10", "longest_above_mean", "longest_decrease", "decay", "first_minimum", "reversibility"),
    *("large_changes", "centroid", "low_power", "late_extremes_high", "late_extremes_low", "motifs"),
    *("forecast_error", "kurtosis", "change_kurtosis", "sign_changes"),
)

LARGE_CHANGE = 0.04  # Of a change from row to row, in standard deviations (pNN40 of catch22). [-]
EXTREME_QUANTILE = 1.0  # Beyond it a value counts as extreme, in standard deviations. [-]


def shape_features(snippets: FloatArray) -> FloatArray:
    """Shape of each snippet, shape (n, m >= 8), mean and standard deviation taken out; columns as in `SHAPES`. [-]

    Centre of the fullest of 5 and of 10 bins; longest stretch above the mean, and of falling values; lag at which the
    autocorrelation falls below 1/e, and of its first minimum; mean cube of changes; share of changes beyond 0.04;
    centre of the power over frequency, and share in the lowest fifth; median place of values above 1 and below -1;
    entropy of three-letter words; error of the mean of the last three as a forecast; kurtosis of values and of changes;
    share of changes that turn round. After C. H. Lubba et al., "catch22: CAnonical Time-series CHaracteristics", Data
    Mining and Knowledge Discovery 33, 2019, for all rows at once; numbers differ from the reference code's.
    """
    x = np.asarray(snippets, dtype=np.float64)
    spread = x.std(axis=1, keepdims=True)
    z = (x - x.mean(axis=1, keepdims=True)) / np.where(spread > 0.0, spread, 1.0)
    change = np.diff(z, axis=1)
    lagged = _autocorrelation(z)
    centred = change - change.mean(axis=1, keepdims=True)
    variance = (centred**2).mean(axis=1)
    return np.column_stack(
        [
            _mode(z, 5),
            _mode(z, 10),
            longest_true(z > 0.0),
            longest_true(change < 0.0),
            _first(lagged < np.exp(-1.0)),
            _first((lagged[:, 1:-1] < lagged[:, :-2]) & (lagged[:, 1:-1] < lagged[:, 2:])),
            (change**3).mean(axis=1),
            (np.abs(change) > LARGE_CHANGE).mean(axis=1),
            *_spectral(z),
            _median_place(z > EXTREME_QUANTILE),
            _median_place(z < -EXTREME_QUANTILE),
            _motif_entropy(z),
            (z[:, 3:] - (z[:, :-3] + z[:, 1:-2] + z[:, 2:-1]) / 3.0).std(axis=1),
            (z**4).mean(axis=1),
            (centred**4).mean(axis=1) / np.where(variance > 0.0, variance, 1.0) ** 2,
            turns(change),
        ]
    )


def longest_true(flags: NDArray[np.bool_]) -> FloatArray:
    """Longest stretch of each row, as a share of the row, shape (n,). [-]"""
    run = np.zeros(len(flags))
    best = np.zeros(len(flags))
    for column in flags.T:
        run = np.where(column, run + 1.0, 0.0)
        best = np.maximum(best, run)
    return np.asarray(best / flags.shape[1])


def turns(values: FloatArray) -> FloatArray:
    """Share of each row's values that have another sign than the one before, shape (n,). [-]"""
    return np.asarray((values[:, 1:] * values[:, :-1] < 0.0).mean(axis=1))


def _mode(z: FloatArray, bins: int) -> FloatArray:
    low, high = z.min(axis=1, keepdims=True), z.max(axis=1, keepdims=True)
    width = np.where(high > low, (high - low) / bins, 1.0)
    place = np.minimum(((z - low) / width).astype(np.int64), bins - 1)
    counts = np.array([(place == k).sum(axis=1) for k in range(bins)])
    return np.asarray(low[:, 0] + (counts.argmax(axis=0) + 0.5) * width[:, 0])


def _autocorrelation(z: FloatArray) -> FloatArray:
    m = z.shape[1]
    power = tapered_powers(z, 1.0, size=2 * m)
    products = np.fft.irfft(power, axis=1)[:, : m // 2 + 1]
    return np.asarray(products / np.where(products[:, :1] > 0.0, products[:, :1], 1.0))


def _first(flags: NDArray[np.bool_]) -> FloatArray:
    """Place of the first True in each row, the row's length where there is none. [rows]"""
    return np.asarray(np.where(flags.any(axis=1), flags.argmax(axis=1), flags.shape[1]), dtype=np.float64)


def _spectral(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    power = tapered_powers(z, np.hanning(z.shape[1]))[:, 1:] + 1e-12
    share = power / power.sum(axis=1, keepdims=True)
    fifth = max(1, share.shape[1] // 5)
    return share @ np.linspace(0.0, 1.0, share.shape[1]), share[:, :fifth].sum(axis=1)


def _median_place(flags: NDArray[np.bool_]) -> FloatArray:
    """Where half of the True values of a row have passed, -1 to 1; 0 where there are none. [-]"""
    passed = flags.cumsum(axis=1)
    half = (2 * passed >= passed[:, -1:]).argmax(axis=1)
    return np.where(flags.any(axis=1), 2.0 * half / (flags.shape[1] - 1) - 1.0, 0.0)


def _motif_entropy(z: FloatArray) -> FloatArray:
    """Entropy of words of three letters, each value being low, middle or high by the row's own thirds. [bit]"""
    ranks = z.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
    letters = 3 * ranks // z.shape[1]
    words = 9 * letters[:, :-2] + 3 * letters[:, 1:-1] + letters[:, 2:]
    share = np.array([(words == k).mean(axis=1) for k in range(27)])
    return np.asarray(-(share * np.log2(np.where(share > 0.0, share, 1.0))).sum(axis=0))
