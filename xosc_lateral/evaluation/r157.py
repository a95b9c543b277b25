"""UN R157's models of what a driver can prevent, for many encounters at once: numbers in, verdicts out.

Three yardsticks: the requirement of paragraph 5.2.5.2 (a formula), the competent and careful driver (performance model
1) and the Fuzzy Safety Model (performance model 2). The ego drives straight in its lane's middle and brakes, no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.evaluation.cut_in import Encounter, crosses_in_time, intrudes, leaves_wandering_zone

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GRAVITY = 9.81
"""[m/s2]"""
FULL_BRAKING = 0.774 * GRAVITY
"""Performance models 1 and 2. [m/s2]"""
BRAKING_JERK = 12.65
"""Full braking after 0.6 s; the JRC's number. [m/s3]"""


@dataclass(frozen=True, eq=False)
class Traffic:
    """One vehicle that cuts in (or does not), n times, at m moments.

    Parameters
    ----------
    position : array, shape (n, m)
        Of its centre along the road. [m]
    speed : array, shape (n, m)
        [m/s]
    towards : array, shape (n, m)
        From its first lane's centre, positive towards the ego lane. [m]
    distance : array, shape (n, m)
        Of its centre from the ego lane's centre, to its own side. [m]
    lane_width, width, length : float
        [m]
    step : float
        [s]
    """

    position: FloatArray
    speed: FloatArray
    towards: FloatArray
    distance: FloatArray
    lane_width: float
    width: float
    length: float
    step: float

    @property
    def lateral_speed(self) -> FloatArray:
        """Positive towards the ego lane. [m/s] Shape (n,)."""
        return np.gradient(self.towards, self.step, axis=1)


@dataclass(frozen=True)
class Ego:
    """The vehicle under test: where its centre is at the first moment, its speed, its size. [m], [m/s]"""

    position: float
    speed: float
    length: float = 4.5
    width: float = 1.9


@dataclass(frozen=True, eq=False)
class EncounterOutcome:
    """What became of n encounters.

    Parameters
    ----------
    prevented : array of bool, shape (n,)
        No collision.
    smallest_gap : array, shape (n,)
        While both overlap laterally; NaN if they never do; at most 0 after a collision. [m]
    noticed : array, shape (n,)
        When the model first sees a danger; NaN: never. [s]
    braking : array, shape (n,)
        When it begins to brake by more than coasting; NaN: never. [s]
    """

    prevented: BoolArray
    smallest_gap: FloatArray
    noticed: FloatArray
    braking: FloatArray


class SafetyModel(Protocol):
    """A driver who brakes: told what it sees, it gives its deceleration."""

    name: ClassVar[str]

    def begin(self, n: int) -> None:
        """Before the first of n encounters' moments."""
        ...

    def decelerate(self, seen: Encounter, speed: FloatArray, target: FloatArray, step: float) -> FloatArray:
        """Deceleration of the next step, shape (n,). [m/s2]"""
        ...

    @property
    def noticed(self) -> BoolArray:
        """Whether a danger has been seen so far, shape (n,). [-]"""
        ...


def evaluate_braking(model: SafetyModel, traffic: Traffic, ego: Ego) -> EncounterOutcome:
    """Drive the ego through n encounters at once (semi-implicit Euler at the traffic's step)."""
    n, m = traffic.position.shape
    model.begin(n)
    place, speed = np.full(n, ego.position), np.full(n, ego.speed)
    smallest, noticed, braking = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    collided, lateral = np.zeros(n, dtype=bool), traffic.lateral_speed
    for k in range(m):
        seen = see(traffic, k, place, speed, ego, lateral[:, k])
        overlaps = (seen.clearance < 0.0) & (traffic.position[:, k] > place - traffic.length)
        smallest = np.where(overlaps & ~collided, np.fmin(smallest, seen.gap), smallest)
        collided |= overlaps & (seen.gap <= 0.0) & (seen.gap > -(traffic.length + ego.length))
        brake = model.decelerate(seen, speed, traffic.speed[:, k], traffic.step)
        time = k * traffic.step
        noticed = np.where(np.isnan(noticed) & model.noticed, time, noticed)
        braking = np.where(np.isnan(braking) & (brake > COASTING), time, braking)
        speed = np.maximum(speed - brake * traffic.step, 0.0)
        place = place + speed * traffic.step
    return EncounterOutcome(~collided, smallest, noticed, braking)


def see(
    traffic: Traffic, k: int, place: FloatArray, speed: FloatArray, ego: Ego, lateral_speed: FloatArray
) -> Encounter:
    """What the ego sees at moment k, shape (n,). [m], [m/s]"""
    return Encounter(
        towards=traffic.towards[:, k],
        lateral_speed=lateral_speed,
        clearance=np.abs(traffic.distance[:, k]) - 0.5 * (traffic.width + ego.width),
        gap=traffic.position[:, k] - place - 0.5 * (traffic.length + ego.length),
        closing=speed - traffic.speed[:, k],
        lane_width=traffic.lane_width,
        width=traffic.width,
        length=traffic.length,
        ego_length=ego.length,
    )


REACTION, REQUIRED_BRAKING = 0.35, 6.0
"""Of paragraph 5.2.5.2. [s], [m/s2]"""


def required_by_reaction_time(traffic: Traffic, ego: Ego) -> EncounterOutcome:
    """Paragraph 5.2.5.2: must be avoided if, at lane intrusion, ``TTC > v_rel / (2 * 6 m/s2) + 0.35 s``.

    `prevented` says that the regulation asks for it; `smallest_gap` is what full use of the formula leaves: the gap at
    intrusion less the way of reaction and braking. Without intrusion, or with a vehicle that is not slower: true.
    """
    n, m = traffic.position.shape
    time = traffic.step * np.arange(m)
    lateral = traffic.lateral_speed
    place = ego.position + ego.speed * time
    every = [see(traffic, k, np.full(n, place[k]), np.full(n, ego.speed), ego, lateral[:, k]) for k in range(m)]
    flags = np.array([intrudes(seen) for seen in every]).T
    first, has = flags.argmax(axis=1), flags.any(axis=1)
    gap = np.array([seen.gap for seen in every]).T[np.arange(n), first]
    closing = np.array([seen.closing for seen in every]).T[np.arange(n), first]
    slower = closing > 0.0
    left = gap - closing * REACTION - closing**2 / (2.0 * REQUIRED_BRAKING)
    danger = has & slower
    noticed = np.where(has, time[first], np.nan)
    return EncounterOutcome(~danger | (left > 0.0), np.where(danger, left, np.nan), noticed, noticed + REACTION)


COASTING = 0.4
"""Deceleration with the foot off the accelerator, while the driver's foot moves (JRC). [m/s2]"""
RISK_EVALUATION, DELAY, CRITICAL_TTC = 0.4, 0.75, 2.0
"""Performance model 1: risk evaluation, delay until braking begins, TTC that makes a cut-in a danger. [s]"""


class CompetentDriver:
    """Performance model 1: wandering zone left, 0.4 s, TTC below 2 s, 0.75 s, full braking.

    The automatic emergency braking that the regulation adds after full wrap is left out: it would act on the same gap.

    References
    ----------
    .. [1] UN Regulation No. 157, guidance on performance models, model 1; numbers also in JRC-FSM, utility/vehicle.py,
       and in esmini, ControllerECE_ALKS_RefDriver.cpp.
    """

    name: ClassVar[str] = "competent driver"

    def begin(self, n: int) -> None:
        """See `SafetyModel.begin`."""
        self._since, self._waited, self._brake = np.zeros(n), np.zeros(n), np.zeros(n)
        self._danger = np.zeros(n, dtype=bool)

    @property
    def noticed(self) -> BoolArray:
        """See `SafetyModel.noticed`."""
        return self._danger

    def decelerate(self, seen: Encounter, speed: FloatArray, target: FloatArray, step: float) -> FloatArray:
        """See `SafetyModel.decelerate`."""
        moving = leaves_wandering_zone(seen) | (seen.clearance <= 0.0)
        self._since = np.where(moving, self._since + step, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            urgent = (seen.gap > 0.0) & (seen.closing > 0.0) & (seen.gap / seen.closing < CRITICAL_TTC)
        self._danger |= (self._since >= RISK_EVALUATION - 1e-9) & urgent
        self._waited = np.where(self._danger, self._waited + step, 0.0)
        acts = self._danger & (self._waited > DELAY + 1e-9) & (speed > 0.0)
        ramp = np.minimum(np.maximum(self._brake, COASTING) + BRAKING_JERK * step, FULL_BRAKING)
        self._brake = np.where(acts, ramp, np.where(self._danger, COASTING, 0.0))
        return self._brake


FSM_REACTION, FSM_COMFORT, FSM_HARD, FSM_LEADER = 0.75, 4.0, 6.0, 7.0
"""Reaction time [s]; comfortable and maximum deceleration of the ego and maximum of the other vehicle [m/s2]."""
FSM_DISTANCE = 2.0
"""Margin at standstill and margin of the safe distance, each. [m]"""


class FuzzySafetyModel:
    """Performance model 2: proactive and critical fuzzy surrogate metrics decide how hard the driver brakes.

    References
    ----------
    .. [1] K. Mattas et al., "Fuzzy Surrogate Safety Metrics for real-time assessment of rear-end collision risk",
       Accident Analysis & Prevention 148, 2020, 105794; JRC-FSM, utility/fuzzy_functs.py and models.py.
    """

    name: ClassVar[str] = "FSM"

    def begin(self, n: int) -> None:
        """See `SafetyModel.begin`."""
        self._left, self._brake = np.full(n, FSM_REACTION), np.zeros(n)
        self._noticed = np.zeros(n, dtype=bool)

    @property
    def noticed(self) -> BoolArray:
        """See `SafetyModel.noticed`."""
        return self._noticed

    def decelerate(self, seen: Encounter, speed: FloatArray, target: FloatArray, step: float) -> FloatArray:
        """See `SafetyModel.decelerate`."""
        critical = critical_metric(seen.gap, speed, target, -self._brake)
        proactive = proactive_metric(seen.gap, speed, target)
        unsafe = crosses_in_time(seen) & (critical + proactive > 0.0)
        self._noticed |= unsafe
        waits = unsafe & (self._left > 1e-9)
        acts = unsafe & ~waits & (speed > 0.0)
        self._left = np.where(waits, self._left - step, self._left)
        wanted = np.where(critical > 0.0, critical * (FSM_HARD - FSM_COMFORT) + FSM_COMFORT, proactive * FSM_COMFORT)
        ramp = np.minimum(np.minimum(self._brake + BRAKING_JERK * step, FULL_BRAKING), wanted)
        self._brake = np.where(acts, ramp, 0.0)
        return self._brake


def proactive_metric(gap: FloatArray, ego: FloatArray, target: FloatArray) -> FloatArray:
    """PFS: 0 where the ego could stop comfortably behind a vehicle that brakes hard, 1 where even its hardest fails.

    Shape (n,) each; [m], [m/s], [m/s]. [-]
    """
    room = gap - FSM_DISTANCE
    common = ego * FSM_REACTION - target**2 / (2.0 * FSM_LEADER)
    safe = common + ego**2 / (2.0 * FSM_COMFORT) + FSM_DISTANCE
    unsafe = common + ego**2 / (2.0 * FSM_HARD)
    return np.asarray(np.clip((room - safe) / (unsafe - safe), 0.0, 1.0))


def critical_metric(gap: FloatArray, ego: FloatArray, target: FloatArray, acceleration: FloatArray) -> FloatArray:
    """CFS: 0 where comfortable braking in time avoids a vehicle that keeps its speed, 1 where the hardest does not.

    Shape (n,) each; [m], [m/s], [m/s], [m/s2]. [-]
    """
    own = np.maximum(acceleration, -FSM_COMFORT)
    later = ego + FSM_REACTION * own - target
    way = (ego + own * FSM_REACTION / 2.0 - target) * FSM_REACTION
    safe, unsafe = way + later**2 / (2.0 * FSM_COMFORT), way + later**2 / (2.0 * FSM_HARD)
    with np.errstate(divide="ignore", invalid="ignore"):
        fuzzy = np.where(safe > unsafe, np.clip((gap - safe) / (unsafe - safe), 0.0, 1.0), (gap < safe) * 1.0)
        braked = (gap < (ego - target) ** 2 / np.abs(2.0 * acceleration)) * 1.0
    return np.asarray(np.where(ego <= target, 0.0, np.where(later < 0.0, braked, fuzzy)))
