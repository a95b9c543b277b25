"""Parts of the Fuzzy Safety Model, performance model 2 of UN R157; source as at `detectors.FuzzySafety`."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.workflows.detection.observation import Observer

REACTION_TIME = 0.75
"""[s]"""
COMFORTABLE_BRAKING, HARD_BRAKING, LEADER_BRAKING = 4.0, 6.0, 7.0
"""Deceleration of the ego, comfortable and at most, and of the other vehicle at most. [m/s2]"""
STANDSTILL_DISTANCE = 2.0
"""Margin at standstill and margin of the safe distance, each. [m]"""
HEADWAY_MARGIN = 0.1
"""Added to the longitudinal headway in the lateral check. [s]"""


def crosses_in_time(lateral_speed: FloatArray, seen: Observer, length: float) -> BoolArray:
    """The lateral check: a vehicle of a length [m], at its lateral speed [m/s], overlaps before it has been passed."""
    way = seen.gap + length + seen.length  # from the observer's front to where it has passed
    with np.errstate(divide="ignore", invalid="ignore"):
        lateral = np.where(lateral_speed > 0.0, seen.clearance / lateral_speed, np.inf)
        headway = np.where(seen.closing > 0.0, way / seen.closing, 0.0)
    ahead = seen.gap + 0.5 * (length + seen.length) > 0.0
    in_time = (seen.closing > 0.0) & (lateral <= headway + HEADWAY_MARGIN)
    return np.asarray(ahead & ((seen.clearance <= 0.0) | in_time))


def proactive_metric(gap: FloatArray, ego: FloatArray, target: FloatArray) -> FloatArray:
    """0 where the ego could stop comfortably behind a vehicle that brakes hard, 1 where even its hardest fails.

    Shape (n,) each; [m], [m/s], [m/s]. [-]
    """
    room = gap - STANDSTILL_DISTANCE
    common = ego * REACTION_TIME - target**2 / (2.0 * LEADER_BRAKING)
    safe = common + ego**2 / (2.0 * COMFORTABLE_BRAKING) + STANDSTILL_DISTANCE
    unsafe = common + ego**2 / (2.0 * HARD_BRAKING)
    return np.asarray(np.clip((room - safe) / (unsafe - safe), 0.0, 1.0))


def critical_metric(gap: FloatArray, ego: FloatArray, target: FloatArray) -> FloatArray:
    """0 where comfortable braking in time avoids a vehicle that keeps its speed, 1 where the hardest does not.

    Shape (n,) each; [m], [m/s], [m/s]; the ego does not brake yet. [-]
    """
    closing = ego - target
    way = closing * REACTION_TIME
    safe, unsafe = (way + closing**2 / (2.0 * braking) for braking in (COMFORTABLE_BRAKING, HARD_BRAKING))
    with np.errstate(divide="ignore", invalid="ignore"):
        metric = np.clip((gap - safe) / (unsafe - safe), 0.0, 1.0)
    return np.where(closing > 0.0, metric, 0.0)
