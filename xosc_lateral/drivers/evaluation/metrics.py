"""The ten numbers that the paper describes a snippet by, for many snippets at once.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080: what its evaluation compares.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.seeds import child

# Columns of `snippet_metrics`, in the order of arXiv:2405.17080, section IV.
METRICS = ("max", "min", "mean", "std", "median", "q25", "q75", "range", "diff_mean", "diff_std")
DIFFERENCE_SCALE = 10.0  # First differences count ten times, as in the paper. [-]


def snippet_metrics(snippets: FloatArray) -> FloatArray:
    """The ten metrics of each snippet.

    Raises `ValueError` if a snippet has fewer than two values, or one is not finite.

    Parameters
    ----------
    snippets : array, shape (n, m)
        One snippet a row: offset [m] or relative offset [-] at an even step; 51 values for 10 s at 5 Hz.

    Returns
    -------
    array, shape (n, 10)
        Columns as in `METRICS`, in the unit of the snippets: largest and smallest value, mean, standard deviation
        (of the population, ddof 0), median, 25 % and 75 % quantile (linear between order statistics), range, and mean
        and standard deviation of the first difference times 10.
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


SPEED = 30.0  # Of the free runs: about 108 km/h. [m/s]
# Free runs of a profile and their length [s]: 5 h, so that drivers who differ are all met.
DRIVERS, DURATION = 60, 300.0


def free_runs(profile: DriverProfile, seed: int, *, drivers: int = DRIVERS, duration: float = DURATION) -> FloatArray:
    """Offsets of several drivers in even traffic, shape (drivers, n). [m]"""
    segment = Segment.even(duration, profile.model.step, profile.lane_width, SPEED)
    root = np.random.SeedSequence(seed)
    return np.array([sample_offsets(profile, segment, child(root, k)) for k in range(drivers)])
