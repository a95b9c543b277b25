"""When is a neighbour's lateral movement taken for the beginning of a cut-in? Published criteria with their numbers.

References
----------
.. [1] UN Regulation No. 157, paragraph 5.2.5.2 and the guidance on performance models for cut-ins.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.evaluation.lane_keeping import WANDERING_ZONE

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

PERCEPTION_DISTANCE = 0.72
"""Lateral distance that a cut-in covers at most in the risk evaluation time of 0.4 s: JRC-FSM and esmini. [m]"""

INTRUSION = 0.3
"""Beyond the outer edge of the marking: UN R157, 5.2.5.2. [m]"""

FSM_MARGIN = 0.1
"""Added to the longitudinal headway in the FSM's lateral check. [s]"""


@dataclass(frozen=True, eq=False)
class Encounter:
    """A vehicle in the next lane, seen from the ego lane; arrays of one shape (..., m).

    Parameters
    ----------
    towards : array
        Its centre from its own lane's centre, positive towards the ego lane. [m]
    lateral_speed : array
        Positive towards the ego lane. [m/s]
    clearance : array
        Between the sides of both vehicles, negative where they overlap laterally. [m]
    gap : array
        From the ego's front to its rear, negative where they are side by side or it is behind. [m]
    closing : array
        Ego's speed minus its own. [m/s]
    lane_width : array or float
        Of its lane. [m]
    width, length, ego_length : float
        [m]
    """

    towards: FloatArray
    lateral_speed: FloatArray
    clearance: FloatArray
    gap: FloatArray
    closing: FloatArray
    lane_width: FloatArray | float
    width: float
    length: float
    ego_length: float


def leaves_wandering_zone(seen: Encounter) -> BoolArray:
    """Beyond 0.375 m from its lane's centre and moving towards the ego lane.

    References
    ----------
    .. [1] UN Regulation No. 157, guidance on performance models: wandering zone. Open implementation with the lateral
       speed's sign: esmini, ControllerECE_ALKS_RefDriver.cpp.
    """
    return (seen.towards > WANDERING_ZONE) & (seen.lateral_speed > 0.0)


def is_perceived(seen: Encounter) -> BoolArray:
    """Beyond the wandering zone by what a cut-in covers while a driver evaluates the risk: 0.375 m + 0.72 m.

    References
    ----------
    .. [1] JRC-FSM, utility/models.py, CC_calc_dist_to_react (github.com/ec-jrc/JRC-FSM).
    """
    return (seen.towards > WANDERING_ZONE + PERCEPTION_DISTANCE) & (seen.lateral_speed > 0.0)


def intrudes(seen: Encounter) -> BoolArray:
    """Outside of its front tyre 0.3 m beyond the marking of the ego lane; the tyre is taken at the vehicle's side.

    References
    ----------
    .. [1] UN Regulation No. 157, paragraph 5.2.5.2. Open implementation: esmini, ControllerALKS_R157SM.cpp,
       Regulation::CheckSafety. The 30 cm are also on the pages of the German KBA on test scenarios.
    """
    return np.asarray(seen.towards + 0.5 * seen.width > 0.5 * np.asarray(seen.lane_width) + INTRUSION)


def crosses_in_time(seen: Encounter) -> BoolArray:
    """At its lateral speed it overlaps laterally before the ego has passed: the FSM's lateral safety check.

    References
    ----------
    .. [1] JRC-FSM, utility/models.py, FSM_check_safety (github.com/ec-jrc/JRC-FSM); K. Mattas et al., Accident
       Analysis & Prevention 148, 2020, 105794, and UN R157, guidance on performance model 2.
    """
    whole = seen.gap + seen.length + seen.ego_length  # from the ego's front to where it has passed
    with np.errstate(divide="ignore", invalid="ignore"):
        lateral = np.where(seen.lateral_speed > 0.0, seen.clearance / seen.lateral_speed, np.inf)
        headway = np.where(seen.closing > 0.0, whole / seen.closing, 0.0)
    overlaps = seen.clearance <= 0.0
    ahead = seen.gap + 0.5 * (seen.length + seen.ego_length) > 0.0
    return ahead & (overlaps | ((seen.closing > 0.0) & (lateral <= headway + FSM_MARGIN)))


CRITERIA: Mapping[str, Callable[[Encounter], BoolArray]] = {
    "wandering zone (0.375 m)": leaves_wandering_zone,
    "FSM lateral check": crosses_in_time,
    "perceived (1.095 m)": is_perceived,
    "lane intrusion (0.3 m)": intrudes,
}
"""Name -> criterion, the most sensitive first."""


def alarms(flags: BoolArray) -> NDArray[np.int64]:
    """How often each row goes from quiet to alarm, shape (...,). [-]"""
    begins = flags[..., 1:] & ~flags[..., :-1]
    return np.asarray(begins.sum(axis=-1) + flags[..., 0].astype(np.int64))


def first_alarm(flags: BoolArray, step: float) -> FloatArray:
    """Time of each row's first alarm, NaN where there is none. [s] `flags` of shape (n, m), times of shape (n,)."""
    return np.where(flags.any(axis=-1), flags.argmax(axis=-1) * step, np.nan)
