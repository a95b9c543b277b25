"""Angles, as scalars. All in [rad], counter-clockwise."""

from __future__ import annotations

from math import pi

TWO_PI = 2.0 * pi
HALF_PI = 0.5 * pi


def wrap(angle: float) -> float:
    """The same angle in [0, 2 pi)."""
    wrapped = angle % TWO_PI
    return wrapped if wrapped < TWO_PI else 0.0


def difference(angle: float, reference: float) -> float:
    """`angle` - `reference` in [-pi, pi)."""
    return (angle - reference + pi) % TWO_PI - pi


def is_forward(relative: float) -> bool:
    """Whether a heading relative to the road's s-direction points along s (within 90 degrees either way)."""
    return not HALF_PI < relative % TWO_PI < 3.0 * HALF_PI
