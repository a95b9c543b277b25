"""Offsets between the model's samples: a curve through them with continuous lateral speed and acceleration.

Each piece is the quintic that meets value, slope and second derivative at both of its samples, where slope and second
derivative are the central differences there. It needs one sample before and one behind the piece, no more, so that a
stream can follow it; a spline through all samples would need them all.

Derived here: six conditions (value, slope and second derivative at u = 0 and 1) fix the six coefficients; solved by
hand.
"""

from __future__ import annotations

from typing import TypeVar

from xosc_lateral.base.arrays import FloatArray

Number = TypeVar("Number", float, FloatArray)


def piece(before: Number, here: Number, there: Number, behind: Number) -> tuple[Number, ...]:
    """Six coefficients in u, from 0 at `here` to 1 at `there`, lowest power first; of one piece or of many."""
    rise = there - here
    slope, next_slope = 0.5 * (there - before), 0.5 * (behind - here)
    bend, next_bend = there - 2.0 * here + before, behind - 2.0 * there + here
    return (
        here,
        slope,
        0.5 * bend,
        10.0 * rise - 6.0 * slope - 4.0 * next_slope - 1.5 * bend + 0.5 * next_bend,
        -15.0 * rise + 8.0 * slope + 7.0 * next_slope + 1.5 * bend - next_bend,
        6.0 * rise - 3.0 * slope - 3.0 * next_slope - 0.5 * bend + 0.5 * next_bend,
    )


def extrapolate(before: Number, last: Number) -> Number:
    """The sample that would follow on a straight line. [unit of the samples]"""
    return 2.0 * last - before
