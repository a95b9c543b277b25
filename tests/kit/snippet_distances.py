"""Distance of two sets of snippets, for tests and studies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.evaluation.metrics import Distances, metric_distances, snippet_metrics


def snippet_distances(real: NDArray[np.float64], other: NDArray[np.float64]) -> Distances:
    """Of shape (n, length) and (m, length), in deviations of the real ones. [-]"""
    return metric_distances(snippet_metrics(real), snippet_metrics(other))
