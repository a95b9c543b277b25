"""Maximum of a likelihood by Fisher scoring."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ROUNDS = 60
ENOUGH = 1e-3
LONGEST_STEP = 1.5


def climb(
    at: Callable[[FloatArray], tuple[float, FloatArray, FloatArray]], point: FloatArray
) -> tuple[FloatArray, float]:
    """The least loss and where it is, by Fisher scoring from a point; `at` gives loss, gradient and information."""
    loss, gradient, information = at(point)
    for _ in range(ROUNDS):
        step = np.linalg.solve(information + 1e-6 * np.eye(len(point)), -gradient)
        step = np.clip(step, -LONGEST_STEP, LONGEST_STEP)
        length = 1.0
        tried = at(point + step)
        while tried[0] >= loss and length > 1e-3:
            length *= 0.4
            tried = at(point + length * step)
        if tried[0] >= loss:
            break
        gained = loss - tried[0]
        point = point + length * step
        loss, gradient, information = tried
        if gained < ENOUGH:
            break
    return point, loss
