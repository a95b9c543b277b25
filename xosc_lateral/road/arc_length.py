"""Arc length of parametric cubics: from metres along the road to the parameter of paramPoly3 and poly3.

References
----------
.. [1] ASAM OpenDRIVE 1.8, chapter 9, "Parametric cubic curve": p runs with the arc length, or from 0 to 1.
.. [2] M. Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, table 25.4: Gauss-Legendre nodes.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.road.positions import FloatArray

PIECES = 32
"""Pieces of p(ds) per element. Field junctions: ds is then true to 1e-6 m, and p(ds) has no corner."""

# Gauss-Legendre nodes and weights on [0, 1], 5 points: exact for polynomials of degree 9.
_NODES, _WEIGHTS = (part * 0.5 for part in np.polynomial.legendre.leggauss(5))
_NODES = _NODES + 0.5


def parameter_pieces(u: FloatArray, v: FloatArray, p_end: FloatArray, length: FloatArray) -> FloatArray:
    """p as a function of ds: piecewise cubic over `PIECES` equal pieces of each element.

    The curve's arc length over [0, p_end] is scaled to `length`, as the reference player does: files whose length
    attribute differs from it by rounding stay continuous.

    Parameters
    ----------
    u, v : array, shape (n, 4)
        Coefficients of the two coordinates, lowest power first.
    p_end, length : array, shape (n,)
        Parameter at the end; length attribute [m].

    Returns
    -------
    array, shape (n, PIECES, 4)
        Cubics of ds about each piece's start.
    """
    grid = np.linspace(0.0, 1.0, PIECES + 1)
    p = p_end[:, None] * grid
    step = (p_end / PIECES)[:, None]
    speed = np.zeros((len(p_end), PIECES))
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        speed += weight * _speed(u, v, p[:, :-1] + node * step)
    arc = np.concatenate([np.zeros((len(p_end), 1)), np.cumsum(speed * step, axis=1)], axis=1)
    total = arc[:, -1].copy()
    straight = ~(total > 0.0)  # degenerate: the parameter runs evenly
    scale = np.where(straight, 1.0, length / np.where(straight, 1.0, total))
    arc = np.where(straight[:, None], length[:, None] * grid, arc * scale[:, None])
    target = length[:, None] * grid
    value = np.stack([np.interp(target[i], arc[i], p[i]) for i in range(len(p_end))])
    if not straight.all():
        value = _refined(value, target, u, v, p_end, arc, p, scale, straight)
    value[:, 0], value[:, -1] = 0.0, p_end
    return _hermite(value, _slopes(value, u, v, scale, length), length / PIECES)


def _speed(u: FloatArray, v: FloatArray, p: FloatArray) -> FloatArray:
    du = u[:, 1:2] + p * (2.0 * u[:, 2:3] + 3.0 * p * u[:, 3:4])
    dv = v[:, 1:2] + p * (2.0 * v[:, 2:3] + 3.0 * p * v[:, 3:4])
    return np.asarray(np.hypot(du, dv))


def _refined(
    value: FloatArray,
    target: FloatArray,
    u: FloatArray,
    v: FloatArray,
    p_end: FloatArray,
    arc: FloatArray,
    p: FloatArray,
    scale: FloatArray,
    straight: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> FloatArray:
    """Newton steps on arc(p) = target, from the nearest grid point below."""
    rows = np.arange(len(p_end))[:, None]
    below = np.clip(np.floor(value / (p_end[:, None] / PIECES)).astype(int), 0, PIECES - 1)
    origin, base = p[rows, below], arc[rows, below]
    for _ in range(4):
        reach = value - origin
        length = np.zeros_like(value)
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            length += weight * _speed(u, v, origin + node * reach)
        speed = np.maximum(_speed(u, v, value), 1e-9) * scale[:, None]
        miss = target - base - length * reach * scale[:, None]
        value = np.where(straight[:, None], value, np.clip(value + miss / speed, 0.0, p_end[:, None]))
    return np.maximum.accumulate(value, axis=1)


def _slopes(value: FloatArray, u: FloatArray, v: FloatArray, scale: FloatArray, length: FloatArray) -> FloatArray:
    """dp/ds at the nodes, at most three times the neighbouring secants: p(ds) never runs back (Fritsch-Carlson)."""
    slope = 1.0 / (np.maximum(_speed(u, v, value), 1e-9) * scale[:, None])
    secant = np.diff(value, axis=1) / (length / PIECES)[:, None]
    slope[:, :-1] = np.minimum(slope[:, :-1], 3.0 * secant)
    slope[:, 1:] = np.minimum(slope[:, 1:], 3.0 * secant)
    return slope


def _hermite(value: FloatArray, slope: FloatArray, step: FloatArray) -> FloatArray:
    h = step[:, None]
    a, b = value[:, :-1], slope[:, :-1]
    rise, end = value[:, 1:] - a - b * h, slope[:, 1:] - b
    return np.stack([a, b, (3.0 * rise - end * h) / h**2, (end * h - 2.0 * rise) / h**3], axis=-1)


def end_parameter(v: tuple[float, float, float, float], length: float) -> float:
    """Parameter u at which v(u) = a + b u + c u^2 + d u^3 has run `length` metres (poly3)."""
    coefficients = np.array([v]), np.array([[0.0, 1.0, 0.0, 0.0]])
    low, high = 0.0, length  # the curve is at least as long as u
    for _ in range(200):
        middle = 0.5 * (low + high)
        nodes = (np.arange(64)[:, None] + _NODES[None, :]).ravel()[None, :] * (middle / 64)
        arc = float((_speed(coefficients[1], coefficients[0], nodes) * np.tile(_WEIGHTS, 64)).sum() * middle / 64)
        low, high = (middle, high) if arc < length else (low, middle)
        if high - low < 1e-13 * length:
            break
    return 0.5 * (low + high)
