"""What a driver and a vehicle can do to the side, as a prior on the spectrum of the offset.

The logarithm of the driver's power density is a polygon over the logarithm of frequency. Its slope is free below
0.1 Hz, where a lane is kept as somebody likes. Above, it falls, and ever faster:

- a lateral acceleration takes two integrations to become an offset: -4 in log power;
- steering comes in corrections that last some tenths of a second and are never undone within them [1]_ [2]_: drivers
  cross over at 0.3 to 0.6 Hz, and beyond that the command itself falls, by about -1.5;
- muscles and vehicle follow the command with lags that add up to a corner of about 1 Hz [1]_ [3]_: up to -3 more where
  the sensor is good enough to see it.

Below the corner of the corrections, from 0.1 to 0.3 Hz, the slope passes from -1 to -3.5. The prior is a normal one, of
standard deviation `SLOPE_SD` on each slope and `BEND_SD` on the change from one to the next: data with little noise
override it, and where noise hides the driver it says how the spectrum goes on.

References
----------
.. [1] D. T. McRuer, R. W. Allen, D. H. Weir, R. H. Klein, "New results in driver steering control models",
   Human Factors 19(4), 1977: cross-over frequencies of lane keeping, neuromuscular lags.
.. [2] G. Markkula et al., "Sustained sensorimotor control as intermittent decisions about prediction errors",
   Biological Cybernetics 112, 2018.
.. [3] ISO 7401:2011, lateral transient response: the yaw response of passenger cars at 80 to 120 km/h falls from
   about 1 Hz on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

KNOTS = np.array([0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.1, 1.5])
"""[Hz]"""

FREE_BELOW = 0.1
CORRECTIONS = 0.3
LAGS = 1.0
"""Corners: of lane keeping at will, of corrections, of muscles and vehicle. [Hz]"""

SLOPE_SD, BEND_SD, FREE_BEND_SD = 0.9, 1.0, 1.5
"""Of log power over log frequency. `docs/design/sensor.md` shows how little the split depends on them. [-]"""

STEEPEST_KNOWN = -4.0
"""Beyond the last knot the density falls at least like this. [-]"""

_LOG = np.log(KNOTS)
N_KNOTS = len(KNOTS)


def expected_slope(frequency: FloatArray) -> FloatArray:
    """Mean of the prior on the slope of log power over log frequency, above `FREE_BELOW`.

    Shape as `frequency` [Hz]. [-]
    """
    rising = np.clip(np.log(frequency / FREE_BELOW) / np.log(CORRECTIONS / FREE_BELOW), 0.0, 1.0)
    lags = (frequency / LAGS) ** 2 / (1.0 + (frequency / LAGS) ** 2)
    return np.where(frequency < CORRECTIONS, -1.0 - 2.5 * rising, -5.5 - 3.0 * lags)


def _slopes() -> FloatArray:
    matrix = np.zeros((N_KNOTS - 1, N_KNOTS))
    rows = np.arange(N_KNOTS - 1)
    matrix[rows, rows + 1] = 1.0 / np.diff(_LOG)
    matrix[rows, rows] = -matrix[rows, rows + 1]
    return matrix


SLOPES = _slopes()
"""From knot values to slopes, shape (n - 1, n)."""


def _prior() -> tuple[FloatArray, FloatArray]:
    middle = np.exp(0.5 * (_LOG[1:] + _LOG[:-1]))
    bound = np.flatnonzero(middle > FREE_BELOW)
    mean = expected_slope(middle)
    pairs = bound[:-1]
    free = np.arange(bound[0])
    rows = [
        SLOPES[bound] / SLOPE_SD,
        (SLOPES[pairs + 1] - SLOPES[pairs]) / BEND_SD,
        (SLOPES[free + 1] - SLOPES[free]) / FREE_BEND_SD,
    ]
    wanted = [mean[bound] / SLOPE_SD, (mean[pairs + 1] - mean[pairs]) / BEND_SD, np.zeros(len(free))]
    return np.concatenate(rows), np.concatenate(wanted)


PRIOR_ROWS, PRIOR_VALUES = _prior()
"""The prior as independent standard normal residuals ``PRIOR_ROWS @ knots - PRIOR_VALUES``."""


def interpolation(frequency: FloatArray) -> FloatArray:
    """From knot values to log densities at these frequencies, constant outside the knots, shape (len(frequency), n)."""
    log = np.clip(np.log(np.maximum(frequency, 1e-9)), _LOG[0], _LOG[-1])
    left = np.clip(np.searchsorted(_LOG, log) - 1, 0, N_KNOTS - 2)
    share = (log - _LOG[left]) / (_LOG[left + 1] - _LOG[left])
    matrix = np.zeros((len(log), N_KNOTS))
    rows = np.arange(len(log))
    matrix[rows, left], matrix[rows, left + 1] = 1.0 - share, share
    return matrix


def density(knots: FloatArray, frequency: FloatArray) -> FloatArray:
    """Driver's power density from the logarithms at the knots. [m2/Hz] Shape as `frequency` [Hz]."""
    beyond = np.maximum(np.log(np.maximum(frequency, 1e-9)) - _LOG[-1], 0.0)
    last = min(float((SLOPES @ knots)[-1]), STEEPEST_KNOWN)
    return np.asarray(np.exp(interpolation(frequency) @ knots + last * beyond))
