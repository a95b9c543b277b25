"""Cut-in detectors that are built in: a score at each moment, and an alarm while it is above a limit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import ClassVar, TypeAlias

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.evaluation.lane_keeping import WANDERING_ZONE
from xosc_lateral.extras.detect.observation import Observer, View, read_numbers
from xosc_lateral.extras.detect.tracks import STEP, Scene

Limits: TypeAlias = Mapping[str, tuple[float, float]]
"""Name of an option -> smallest and largest value."""

NO_DANGER = -1e6
"""Score of a moment at which a rule does not apply: below every limit."""


class Detector(ABC):
    """Scores of views, and the limits that its curve is drawn over.

    Scores grow with the suspicion; `limits` are increasing scores, one of them the one that is set.
    """

    name: ClassVar[str]
    needs_observer: ClassVar[bool] = False
    quantity: ClassVar[str]  # what its threshold is, with its unit
    growing: ClassVar[bool] = True  # whether a larger threshold is a larger score
    CURVE: ClassVar[FloatArray]  # thresholds that its curve is drawn over, besides the one that is set

    threshold: float  # that is set, in its own unit
    home_source: str = ""  # on which the threshold was set

    @property
    def thresholds(self) -> FloatArray:
        """Thresholds of the curve, in its own unit, from the most to the least sensitive."""
        every = np.unique(np.append(self.CURVE, self.threshold))
        return every if self.growing else every[::-1]

    @property
    def limits(self) -> FloatArray:
        """The same as scores: there is an alarm above them, increasing."""
        sign = 1.0 if self.growing else -1.0
        return sign * self.thresholds

    @property
    def chosen(self) -> int:
        """Number of the threshold that is set."""
        return int(np.argmin(np.abs(self.thresholds - self.threshold)))

    @abstractmethod
    def scores(self, scene: Scene, views: Sequence[View]) -> list[FloatArray]:
        """Score at every instant of each view, shape (n,) each."""

    def label(self) -> str:
        """Name with its settings."""
        return self.title()

    def title(self) -> str:
        """Name with its settings but the threshold."""
        return self.name

    def threshold_of(self, limit: float) -> float:
        """A score as a threshold in its own unit."""
        return limit if self.growing else -limit

    def usable(self, views: Sequence[View]) -> Sequence[View]:
        """Views that it can score."""
        return [view for view in views if view.observer is not None] if self.needs_observer else views


Learner: TypeAlias = Callable[[Iterable[View], str], Detector]
"""Trains a detector on views of a source, which it may name in errors."""


@dataclass(frozen=True)
class Rule(Detector):
    """A detector that is a formula of one view; its fields are the options."""

    OPTIONS: ClassVar[Limits]

    threshold: float = 0.0

    def scores(self, scene: Scene, views: Sequence[View]) -> list[FloatArray]:
        """See `Detector`."""
        return [self.score(view) for view in views]

    @abstractmethod
    def score(self, view: View) -> FloatArray:
        """Score at every instant, shape (n,)."""

    def label(self) -> str:
        """See `Detector`."""
        return f"{self.name} ({', '.join(f'{one.name} {getattr(self, one.name):g}' for one in fields(self))})"

    def title(self) -> str:
        """See `Detector`."""
        options = [f"{one.name} {getattr(self, one.name):g}" for one in fields(self) if one.name != "threshold"]
        return f"{self.name} ({', '.join(options)})" if options else self.name


@dataclass(frozen=True)
class LateralSpeed(Rule):
    """Moves towards the lane at more than a speed [m/s] for longer than `hold` [s].

    Notes
    -----
    The quantity that plain cut-in logic thresholds. Lane changes are cut where it falls below 0.1 m/s
    (`recordings.cuts`), and reach 0.6 to 1.0 m/s at their middle (3.5 m in 5 s, half a sine). 0.2 m/s held for 0.4 s,
    the risk evaluation time of JRC-FSM, is between both.
    """

    name = "lateral-speed"
    quantity = "lateral speed [m/s]"
    OPTIONS: ClassVar[Limits] = {"threshold": (0.0, 5.0), "hold": (0.0, 10.0)}
    CURVE = np.round(np.arange(0.02, 1.001, 0.02), 3)
    threshold: float = 0.2
    hold: float = 0.4

    def score(self, view: View) -> FloatArray:
        """See `Rule`: the least lateral speed of the time that it has to hold."""
        speed, rows = view.lateral_speed, round(self.hold / STEP)
        if rows == 0:
            return speed
        padded = np.concatenate([np.full(rows, NO_DANGER), speed])
        return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, rows + 1).min(axis=1))


@dataclass(frozen=True)
class MarkingDistance(Rule):
    """Its side is more than a distance [m] beyond the marking.

    References
    ----------
    .. [1] UN Regulation No. 157, paragraph 5.2.5.2: 0.3 m, of the front tyre, here taken at the vehicle's side. Open
       implementation: esmini, ControllerALKS_R157SM.cpp.
    """

    name = "marking-distance"
    quantity = "beyond the marking [m]"
    OPTIONS: ClassVar[Limits] = {"threshold": (-5.0, 5.0)}
    CURVE = np.round(np.arange(-0.9, 0.81, 0.05), 3)
    threshold: float = 0.3

    def score(self, view: View) -> FloatArray:
        """See `Rule`."""
        return -view.room


@dataclass(frozen=True)
class WanderingZone(Rule):
    """Is farther than a distance [m] from its lane's centre and moves towards the lane.

    References
    ----------
    .. [1] UN Regulation No. 157, guidance on performance models: 0.375 m. Open implementation with the sign of the
       lateral speed: esmini, ControllerECE_ALKS_RefDriver.cpp.
    """

    name = "wandering-zone"
    quantity = "from the lane's centre [m]"
    OPTIONS: ClassVar[Limits] = {"threshold": (0.0, 5.0)}
    CURVE = np.round(np.arange(0.05, 1.51, 0.05), 3)
    threshold: float = WANDERING_ZONE

    def score(self, view: View) -> FloatArray:
        """See `Rule`."""
        return np.where(view.lateral_speed > 0.0, view.towards, NO_DANGER)


@dataclass(frozen=True)
class TimeToLine(Rule):
    """Its side reaches the marking in less than a time [s] at its lateral speed.

    Notes
    -----
    The default of 1 s is a choice, half of what warning systems look at (`lane_keeping.LONGEST_TLC`): see its curve.

    References
    ----------
    .. [1] W. van Winsum, K. A. Brookhuis, D. de Waard, Accident Analysis & Prevention 32, 2000: distance over lateral
       speed.
    """

    name = "time-to-line"
    quantity = "time to the marking [s]"
    growing = False
    OPTIONS: ClassVar[Limits] = {"threshold": (0.0, 60.0)}
    CURVE = np.round(np.geomspace(0.05, 20.0, 48), 3)
    threshold: float = 1.0

    def score(self, view: View) -> FloatArray:
        """See `Rule`."""
        speed = view.lateral_speed
        with np.errstate(divide="ignore", invalid="ignore"):
            time = np.maximum(view.room, 0.0) / speed
        return np.where(speed > 0.0, -time, NO_DANGER)


# ---- Fuzzy Safety Model, performance model 2 of UN R157 ----
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


@dataclass(frozen=True)
class FuzzySafety(Rule):
    """The cut-in rule of the Fuzzy Safety Model: it would overlap before it is passed, and the gap is not safe.

    The score is the sum of the proactive and the critical metric, 0 to 2; needs other vehicles to be cut in on.

    References
    ----------
    .. [1] K. Mattas et al., "Fuzzy Surrogate Safety Metrics for real-time assessment of rear-end collision risk",
       Accident Analysis & Prevention 148, 2020, 105794; JRC-FSM, utility/fuzzy_functs.py and models.py, commit 65f81ef.
    """

    name = "fuzzy"
    quantity = "fuzzy metrics, sum [-]"
    needs_observer = True
    OPTIONS: ClassVar[Limits] = {"threshold": (0.0, 2.0)}
    CURVE = np.round(np.arange(0.0, 2.0, 0.05), 3)
    threshold: float = 0.0

    def score(self, view: View) -> FloatArray:
        """See `Rule`."""
        seen = view.observer
        assert seen is not None
        other = seen.speed - seen.closing
        metric = proactive_metric(seen.gap, seen.speed, other) + critical_metric(seen.gap, seen.speed, other)
        length = view.track.box.length
        unsafe = crosses_in_time(view.lateral_speed, seen, length)
        return np.where(unsafe & np.isfinite(metric), np.nan_to_num(metric), NO_DANGER)


RULES: Mapping[str, type[Rule]] = {
    rule.name: rule for rule in (LateralSpeed, MarkingDistance, WanderingZone, TimeToLine, FuzzySafety)
}
"""Name -> detector, but for `logistic`, which is trained first."""


def read_rule(text: str) -> Rule | None:
    """A rule from ``NAME`` or ``NAME:OPTION=VALUE,...``; None: there is none of that name. Raises `ValueError`."""
    name, _, options = text.partition(":")
    rule = RULES.get(name)
    return None if rule is None else rule(**read_numbers(options, rule.OPTIONS, name))
