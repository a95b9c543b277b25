"""What a driver and a vehicle can do to the side, as a prior on the spectrum of the offset.

The logarithm of the driver's power density is a polygon over the logarithm of frequency. Its slope is free below
0.1 Hz, where a lane is kept as somebody likes. Above, what is expected is, up to its level::

    1 / (f * (1 + (f / corner)^5) * (1 + (f / 1 Hz)^2)^1.5)

- Below the corner of the driver's corrections the power falls with the frequency.
- Beyond it, with its sixth power: a lateral acceleration takes two integrations to become an offset, -4; steering comes
  in corrections that last some tenths of a second and are never undone within them [1]_ [2]_, which a lag of first
  order describes, -2.
- Muscles and vehicle follow the command with lags that add up to a corner of about 1 Hz [1]_ [3]_: up to -3 more where
  the sensor is good enough to see it.

How brisk corrections are differs from driver to driver, so that the corner is fitted with the rest: at
`BRISKEST_CORNER` or below. Where noise hides the driver, his spectrum goes on as the part of it that is seen lets
expect. A corner that were as free upwards would make a driver of every low-passed error; and beside such an error,
whose own corner is estimated, it is `BRISKEST_CORNER`: a slower driver and a slower error are one spectrum.

The prior is a normal one, of standard deviation `SLOPE_SD` on each slope and `BEND_SD` on the change from one to the
next: data with little noise override it.

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

from xosc_lateral.base.arrays import FloatArray

KNOTS = np.array([0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.1, 1.5])
"""[Hz]"""

FREE_BELOW = 0.1
LAGS = 1.0
"""Corners: of lane keeping at will, of muscles and vehicle. [Hz]"""

BRISKEST_CORNER = 0.27
"""Corner of the briskest corrections: that of drive tables whose sensor is good enough to see it. [Hz]"""

POWER_BELOW, POWER_BEYOND, MOST_LAG = 1.0, 6.0, 3.0
"""Powers of the frequency by which the density falls below the corner, beyond it, and more beyond that of the lags."""

SLOWER_SD, BRISKER_SD = 0.5, 0.05
"""Of the logarithm of the corner over `BRISKEST_CORNER`, below it and above. [-]"""

SLOPE_SD, BEND_SD, FREE_BEND_SD = 0.9, 1.0, 1.5
"""Of log power over log frequency. [-] `docs/design/sensor.md` shows how little the split depends on them."""

STEEPEST_KNOWN = -4.0
"""Beyond the last knot the density falls at least like this. [-]"""

_LOG = np.log(KNOTS)
N_KNOTS = len(KNOTS)

N_STATE = N_KNOTS + 1
"""Knots, then the logarithm of the corner over `BRISKEST_CORNER`: what the prior is on."""


def expected_log_density(frequency: FloatArray, shift: float = 0.0) -> FloatArray:
    """Mean of the prior on log power, up to its level. Shape as `frequency` [Hz]. [-]

    `shift` is the logarithm of the corner over `BRISKEST_CORNER`.
    """
    steps = POWER_BEYOND - POWER_BELOW
    bend = np.logaddexp(0.0, steps * (np.log(frequency / BRISKEST_CORNER) - shift))
    return np.asarray(-POWER_BELOW * np.log(frequency) - bend - 0.5 * MOST_LAG * np.log1p((frequency / LAGS) ** 2))


def _change_with_corner(frequency: FloatArray, shift: float) -> FloatArray:
    """Derivative of `expected_log_density` with respect to the shift. [-]"""
    steps = POWER_BEYOND - POWER_BELOW
    return np.asarray(steps / (1.0 + np.exp(-steps * (np.log(frequency / BRISKEST_CORNER) - shift))))


def _slopes() -> FloatArray:
    matrix = np.zeros((N_KNOTS - 1, N_KNOTS))
    rows = np.arange(N_KNOTS - 1)
    matrix[rows, rows + 1] = 1.0 / np.diff(_LOG)
    matrix[rows, rows] = -matrix[rows, rows + 1]
    return matrix


SLOPES = _slopes()
"""From knot values to slopes, shape (n - 1, n)."""


_BOUND = np.flatnonzero(0.5 * (_LOG[1:] + _LOG[:-1]) > np.log(FREE_BELOW))


def _rows() -> FloatArray:
    free = np.arange(_BOUND[0])
    return np.concatenate(
        [
            SLOPES[_BOUND] / SLOPE_SD,
            np.diff(SLOPES[_BOUND], axis=0) / BEND_SD,
            (SLOPES[free + 1] - SLOPES[free]) / FREE_BEND_SD,
        ]
    )


_ROWS = _rows()


def _of_slopes(values: FloatArray) -> FloatArray:
    """What slopes between the knots of such values are in units of the prior, shape (len(_ROWS),). [-]"""
    slopes = (SLOPES @ values)[_BOUND]
    return np.concatenate([slopes / SLOPE_SD, np.diff(slopes) / BEND_SD, np.zeros(_BOUND[0])])


def prior(state: FloatArray, *, is_corner_free: bool = True) -> tuple[FloatArray, FloatArray]:
    """Residuals of a state, shape (m,), each standard normal by the prior, and their Jacobian, shape (m, N_STATE).

    Where the corner is not free, the slopes expected are those of `BRISKEST_CORNER`, whatever the state says.
    """
    knots, excess = state[:N_KNOTS], float(state[N_KNOTS])
    shift, deviation = excess if is_corner_free else 0.0, SLOWER_SD if excess < 0.0 else BRISKER_SD
    jacobian = np.zeros((len(_ROWS) + 1, N_STATE))
    jacobian[:-1, :N_KNOTS] = _ROWS
    if is_corner_free:
        jacobian[:-1, N_KNOTS] = -_of_slopes(_change_with_corner(KNOTS, shift))
    jacobian[-1, N_KNOTS] = 1.0 / deviation
    residuals = _ROWS @ knots - _of_slopes(expected_log_density(KNOTS, shift))
    return np.append(residuals, excess / deviation), jacobian


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
