"""The ten numbers that the paper describes a snippet by, and how far two sets of snippets lie apart in them.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080: what its evaluation compares.
.. [2] S. S. Vallender, "Calculation of the Wasserstein distance between probability distributions on the line", Theory
       of Probability and its Applications 18, 1974, pp. 784-786.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.linear_filters import prepare
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import responses_to, sample_offsets
from xosc_lateral.drivers.model.seeds import child

# Columns of `snippet_metrics`, in the order of arXiv:2405.17080, section IV.
METRICS = ("max", "min", "mean", "std", "median", "q25", "q75", "range", "diff_mean", "diff_std")
DIFFERENCE_SCALE = 10.0  # First differences count ten times, as in the paper. [-]


def snippet_metrics(snippets: FloatArray) -> FloatArray:
    """The ten metrics of each snippet, shape (n, 10), columns as in `METRICS`, in the snippets' unit.

    The standard deviation is the population's, quantiles are linear between order statistics, first differences times
    10. Raises `ValueError` if a snippet has fewer than two values, or one is not finite.
    """
    snippets = np.asarray(snippets, dtype=np.float64)
    if snippets.ndim != 2 or snippets.shape[1] < 2:
        raise ValueError(f"snippets: shape {snippets.shape}, expected (n, at least 2)")
    if not np.isfinite(snippets).all():
        raise ValueError("snippets: a value is not finite")
    ordered = np.sort(snippets, axis=1)
    difference = np.diff(snippets, axis=1)
    return np.column_stack(
        [
            ordered[:, -1],
            ordered[:, 0],
            snippets.mean(axis=1),
            snippets.std(axis=1),
            _quantile(ordered, 0.5),
            _quantile(ordered, 0.25),
            _quantile(ordered, 0.75),
            ordered[:, -1] - ordered[:, 0],
            # The mean difference telescopes: exact, and half the work.
            DIFFERENCE_SCALE * (snippets[:, -1] - snippets[:, 0]) / difference.shape[1],
            DIFFERENCE_SCALE * difference.std(axis=1),
        ]
    )


def _quantile(ordered: FloatArray, q: float) -> FloatArray:
    """Of rows that are sorted already: one sort serves five metrics."""
    place = q * (ordered.shape[1] - 1)
    low = int(place)
    high = min(low + 1, ordered.shape[1] - 1)
    return np.asarray(ordered[:, low] + (place - low) * (ordered[:, high] - ordered[:, low]))


def cut_snippets(series: FloatArray, length: int) -> FloatArray:
    """Whole snippets one after the other, shape (len(series) // length, length); the rest is left over. [m]"""
    count = len(series) // length
    return np.asarray(series[: count * length].reshape(count, length))


FREE_SPEED = 30.0  # Of the free runs: about 108 km/h. [m/s]
# Free runs of a profile and their length [s]: 5 h, so that drivers who differ are all met.
DRIVER_COUNT, RUN_SECONDS = 60, 300.0


def free_runs(
    profile: DriverProfile,
    seed: int,
    *,
    drivers: int = DRIVER_COUNT,
    duration: float = RUN_SECONDS,
    speed: float = FREE_SPEED,
) -> FloatArray:
    """Offsets of several drivers in even traffic, shape (drivers, n). [m]"""
    segment = Segment.even(duration, profile.model.step, profile.lane_width, speed)
    root, responses = np.random.SeedSequence(seed), responses_to(segment, profile)
    prepare(drivers * len(segment))
    seeds = (child(root, k) for k in range(drivers))
    return np.array([sample_offsets(profile, segment, one, responses=responses) for one in seeds])


@dataclass(frozen=True)
class Distances:
    """Wasserstein distance per metric, in units of the real metric's standard deviation. [-]"""

    by_metric: dict[str, float]

    @property
    def mean(self) -> float:
        """Over the ten metrics. [-]"""
        return float(np.mean(list(self.by_metric.values())))

    @property
    def worst(self) -> str:
        """Name of the metric with the largest distance."""
        return max(self.by_metric, key=self.by_metric.__getitem__)


def wasserstein(a: FloatArray, b: FloatArray) -> float:
    """Earth mover's distance of two samples on a line: the area between their distribution functions.

    Same value as `scipy.stats.wasserstein_distance`, without its 0.3 s of import.
    """
    a, b = np.sort(a), np.sort(b)
    values = np.sort(np.concatenate([a, b]))
    steps = np.diff(values)
    below_a = np.searchsorted(a, values[:-1], side="right") / len(a)
    below_b = np.searchsorted(b, values[:-1], side="right") / len(b)
    return float(np.abs(below_a - below_b) @ steps)


def wasserstein_columns(a: FloatArray, b: FloatArray) -> FloatArray:
    """Of each column, shape (k,), of rows of shape (n, k) and (m, k)."""
    return np.array([wasserstein(a[:, k], b[:, k]) for k in range(a.shape[1])])


def column_distances(real: FloatArray, other: FloatArray) -> list[float]:
    """Wasserstein distance of each column, in standard deviations of the real one. [sd] Shapes (n, k) and (m, k)."""
    spread = real.std(axis=0)
    # a column that never varies has no scale of its own; any difference then counts in its own unit
    spread = np.where(spread > 0.0, spread, 1.0)
    return (wasserstein_columns(real, other) / spread).tolist()  # type: ignore[no-any-return]


def metric_distances(real: FloatArray, other: FloatArray) -> Distances:
    """Distance of two sets of metrics, shape (n, 10) and (m, 10); `real`, two at least, sets the scale."""
    if len(real) < 2 or len(other) < 1:
        raise NotEnoughDataError(f"{len(real)} real and {len(other)} other snippets; two and one are needed")
    return Distances(dict(zip(METRICS, column_distances(real, other), strict=True)))


def mean_distances(several: list[Distances]) -> Distances:
    """Average over repeated splits."""
    return Distances({name: float(np.mean([one.by_metric[name] for one in several])) for name in METRICS})


def split_groups(groups: NDArray[np.generic], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Half of the groups at random: True for the rows of the first half.

    Groups (drives, or blocks of one drive) go to one side as a whole: neighbouring snippets of one driver are alike.
    Raises `NotEnoughDataError` if there are fewer than two.
    """
    names = np.unique(groups)
    if len(names) < 2:
        raise NotEnoughDataError(f"{len(names)} group of snippets; two are needed to compare real with real")
    chosen = rng.permutation(len(names))[: len(names) // 2]
    return np.isin(groups, names[chosen])


SCORE_UNITS = {"energy_score": "m", "variogram_score": "m"}  # Proper scores and their units.
PAIRED_EVERY = 5  # Steps between the values that are paired: all pairs of a window of 51 values would be 2601. [-]
ORDER = 0.5  # Of the variogram score: the power that its authors found most sensitive to dependence. [-]


def energy_score(real: FloatArray, ensemble: FloatArray) -> FloatArray:
    """Energy score of each window, shape (n,): a proper score, lowest on average for the truth. [m]

    `real`, shape (n, m): what was driven; `ensemble`, shape (n, k, m), k >= 2: sampled for each. [m] T. Gneiting, A. E.
    Raftery, "Strictly Proper Scoring Rules, Prediction, and Estimation", JASA 102, 2007, section 4.3.
    """
    import scoringrules

    _check(ensemble)
    return np.asarray(scoringrules.es_ensemble(real, ensemble, estimator="fair"), dtype=np.float64)


def variogram_score(real: FloatArray, ensemble: FloatArray) -> FloatArray:
    """Variogram score of each window, as `energy_score`: sees how values depend on one another. [m]

    M. Scheuerer, T. M. Hamill, "Variogram-Based Proper Scoring Rules for Probabilistic Forecasts of Multivariate
    Quantities", Monthly Weather Review 143, 2015: order 0.5.
    """
    import scoringrules

    _check(ensemble)
    thin, members = real[:, ::PAIRED_EVERY], ensemble[:, :, ::PAIRED_EVERY]
    pairs = thin.shape[1] ** 2
    return np.asarray(scoringrules.vs_ensemble(thin, members, p=ORDER, estimator="fair") / pairs, dtype=np.float64)


def proper_scores(real: FloatArray, ensemble: FloatArray) -> dict[str, float]:
    """Mean of each score in `SCORE_UNITS` over the windows; empty without the extra `board`. [m]"""
    try:
        scores = energy_score(real, ensemble), variogram_score(real, ensemble)
    except ImportError:
        return {}
    return {name: float(score.mean()) for name, score in zip(SCORE_UNITS, scores, strict=True)}


def _check(ensemble: FloatArray) -> None:
    if ensemble.shape[1] < 2:
        raise NotEnoughDataError(f"{ensemble.shape[1]} sampled window for each real one; two are needed for a score")
