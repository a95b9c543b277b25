"""Alarms against what really happened: false alarms an hour, cut-ins seen, time before the marking, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.texts import hours_in_words
from xosc_lateral.extras.detect.detectors import NO_DANGER, Detector
from xosc_lateral.extras.detect.observation import View
from xosc_lateral.extras.detect.tracks import MARGIN_ROWS, STEP, LaneChange, Scene

RESAMPLES = 500
"""Of the bootstrap: the ends of a 95 % interval lie then at the 12th value from either side."""
INTERVAL_SHARES = (0.025, 0.975)
NO_ALARM_BOUND = 3.689
"""Upper end of the 95 % interval of a Poisson count of which none was seen: -ln(0.025)."""
SHOWN_CASES = 5
"""Worst cases that are kept of each detector and source."""


@dataclass(frozen=True, eq=False, slots=True)
class Case:
    """A false alarm, or a cut-in that was seen late or not at all."""

    kind: str  # "false alarm", "missed", "late"
    scene: Scene
    view: View
    time: float  # of the alarm, or when the marking is crossed [s]
    badness: float  # misses before late ones before false alarms, the worst of each first
    score: FloatArray
    limit: float


LEAST_HOURS = 0.1
"""Of lane keeping that a rate is made of: in less, a single alarm would be ten an hour or more. [h]"""

CASE_MARGIN = 6.0
"""Of a case, before and after its moment: what is nearer to it is the same. [s]"""


def alarms_in_words(count: int, hours: float, rate: str) -> str:
    """False alarms as a rate, or, where there is too little to make one of, as they were counted."""
    return f"{rate} an hour" if hours >= LEAST_HOURS else f"{count} in {hours_in_words(hours)}"


def worst_of(cases: Sequence[tuple[str, str, Case]]) -> list[tuple[str, str, Case]]:
    """The worst of all detectors and sources; none twice, be it of several detectors or in variants of a scenario."""
    worst: list[tuple[str, str, Case]] = []
    for candidate in sorted(cases, key=lambda each: -each[2].badness):
        name, time = candidate[2].view.track.name, candidate[2].time
        if all(name != case.view.track.name or abs(time - case.time) > CASE_MARGIN for *_, case in worst):
            worst.append(candidate)
    return worst[:SHOWN_CASES]


@dataclass(eq=False)
class Tally:
    """Counts of one detector on one source, by cluster and threshold; grows scene by scene."""

    detector: Detector
    source: str
    seconds: dict[str, float] = field(default_factory=dict)  # of lane keeping, by cluster
    counts: dict[str, IntArray] = field(default_factory=dict)  # false alarms by threshold
    change_clusters: list[str] = field(default_factory=list)
    leads: list[FloatArray] = field(default_factory=list)  # by threshold; NaN: not seen [s]
    cases: list[Case] = field(default_factory=list)

    def add(self, scene: Scene, views: Sequence[View]) -> None:
        """Run the detector on a scene."""
        views = self.detector.usable(views)
        for view, score in zip(views, self.detector.scores(scene, views), strict=True):
            self.count(scene, view, score)

    def count(self, scene: Scene, view: View, score: FloatArray) -> None:
        """Add what the detector scores in a view, shape (n,)."""
        limits = self.detector.limits
        watched = np.where(view.watched, score, NO_DANGER)
        keeping = view.truth.keeping & view.watched
        cluster = view.track.cluster
        self.seconds[cluster] = self.seconds.get(cluster, 0.0) + float(keeping.sum()) * STEP
        before = self.counts.get(cluster, np.zeros(len(limits), dtype=np.int64))
        self.counts[cluster] = before + count_onsets(watched, keeping, limits)
        self._add_false_alarm(scene, view, watched, keeping)
        for change in cut_ins_of(view):
            lead = lead_times(watched, change, limits)
            self.change_clusters.append(cluster)
            self.leads.append(lead)
            self._add_late_change(scene, view, watched, change, float(lead[self.detector.chosen]))

    def _add_false_alarm(self, scene: Scene, view: View, score: FloatArray, keeping: BoolArray) -> None:
        limit = float(self.detector.limits[self.detector.chosen])
        if not keeping.any():
            return
        row = int(np.argmax(np.where(keeping, score, -np.inf)))
        if score[row] > limit:
            spread = float(np.ptp(self.detector.limits)) or 1.0
            badness = float(score[row] - limit) / spread
            self._add_case(Case("false alarm", scene, view, float(view.track.time[row]), badness, score, limit))

    def _add_late_change(self, scene: Scene, view: View, score: FloatArray, change: LaneChange, lead: float) -> None:
        if self.detector.needs_observer:  # it waits for danger, which not every cut-in is
            return
        limit = float(self.detector.limits[self.detector.chosen])
        time = float(view.track.time[change.crossing])
        if np.isnan(lead):
            self._add_case(Case("missed", scene, view, time, 1e6, score, limit))
        elif lead < 0.0:
            self._add_case(Case("late", scene, view, time, 1e3 - lead, score, limit))

    def _add_case(self, case: Case) -> None:
        self.cases = sorted([*self.cases, case], key=lambda each: -each.badness)[:SHOWN_CASES]

    def curve(self) -> Curve:
        """What was counted, as arrays."""
        names = sorted(self.seconds)
        rows = {name: row for row, name in enumerate(names)}
        m = len(self.detector.limits)
        return Curve(
            self.detector,
            self.source,
            np.array([self.seconds[name] for name in names]) / 3600.0,
            np.array([self.counts[name] for name in names]).reshape(len(names), m),
            np.array([rows[name] for name in self.change_clusters], dtype=np.int64),
            np.array(self.leads).reshape(len(self.leads), m),
        )


def cut_ins_of(view: View) -> list[LaneChange]:
    """Lane changes into the lane that the vehicle is seen from, watched from their beginning."""
    return [change for change in view.truth.changes if change.side == view.side and view.watched[change.begin]]


def count_onsets(score: FloatArray, keeping: BoolArray, limits: FloatArray) -> IntArray:
    """How often the score comes above each limit (increasing) in rows of lane keeping; shape (m,)."""
    rows = np.flatnonzero(keeping[1:]) + 1
    before, now = score[rows - 1], score[rows]
    rising = now > before
    first, last = (np.searchsorted(limits, values[rising], side="left") for values in (before, now))
    steps = np.bincount(first, minlength=len(limits) + 1) - np.bincount(last, minlength=len(limits) + 1)
    return np.cumsum(steps)[:-1].astype(np.int64)


def lead_times(score: FloatArray, change: LaneChange, limits: FloatArray) -> FloatArray:
    """From the alarm to the crossing of the marking, for each limit, NaN: none until the lane is another. [s]

    An alarm counts that stands when the lane change begins, from `MARGIN_ROWS` before on, or comes later.
    """
    start = max(change.begin - MARGIN_ROWS, 0)
    flags = score[start : change.centre + 1] > limits[:, None]
    begin = change.begin - start
    early, later = flags[:, :begin], flags[:, begin:]
    quiet = ~early[:, ::-1]
    standing = np.where(quiet.any(axis=1), quiet.argmax(axis=1), begin)
    row = np.where(later[:, 0], begin - standing, begin + later.argmax(axis=1))
    return np.where(later.any(axis=1), (change.crossing - start - row) * STEP, np.nan)


@dataclass(frozen=True, eq=False)
class Curve:
    """One detector on one source over its thresholds; k clusters, c cut-ins, m thresholds."""

    detector: Detector
    source: str
    hours: FloatArray  # of lane keeping, shape (k,)
    counts: IntArray  # false alarms, shape (k, m)
    cluster: IntArray  # of each cut-in, shape (c,)
    leads: FloatArray  # time before the marking is crossed; NaN: not seen, shape (c, m) [s]

    @property
    def rate(self) -> FloatArray:
        """False alarms an hour, shape (m,); NaN: no lane keeping."""
        total = float(self.hours.sum())
        return self.counts.sum(axis=0) / total if total > 0.0 else np.full(self.counts.shape[1], np.nan)

    def seen(self, lead: float = -np.inf) -> FloatArray:
        """Share of cut-ins seen more than so long before the marking was crossed [s], shape (m,); NaN: none is there.

        With 0 before it, without a time at all.
        """
        return (self.leads > lead).mean(axis=0) if len(self.leads) else np.full(self.leads.shape[1], np.nan)

    def lead(self, share: float) -> FloatArray:
        """Quantile of the time before the marking, of cut-ins that were seen, shape (m,). [s]"""
        return np.array([_quantile(column[np.isfinite(column)], share) for column in self.leads.T])

    @cached_property
    def weights(self) -> IntArray:
        """How often each cluster is drawn, shape (RESAMPLES, k): the same for every detector on these clusters."""
        k = len(self.hours)
        if not k:
            return np.zeros((0, 0), dtype=np.int64)
        return np.random.default_rng(k).multinomial(k, np.full(k, 1.0 / k), size=RESAMPLES)

    def rate_interval(self) -> FloatArray:
        """95 % interval of `rate`, shape (2, m); NaN for one vehicle alone, a Poisson bound where there was none."""
        total = float(self.hours.sum())
        if len(self.hours) > 1:
            hours = self.weights @ self.hours
            drawn = (self.weights @ self.counts) / np.where(hours > 0.0, hours, np.nan)[:, None]
            interval = np.nanquantile(drawn, INTERVAL_SHARES, axis=0)
        else:
            interval = np.full((2, self.counts.shape[1]), np.nan)
        none = self.counts.sum(axis=0) == 0
        interval[:, none] = np.array([[0.0], [NO_ALARM_BOUND / total if total > 0.0 else np.nan]])
        return interval

    def seen_interval(self, lead: float = -np.inf) -> FloatArray:
        """95 % interval of `seen`, shape (2, m); NaN: cut-ins of one vehicle alone, or none."""
        if len(set(self.cluster.tolist())) < 2:
            return np.full((2, self.leads.shape[1]), np.nan)
        drawn = self.weights[:, self.cluster].astype(np.float64)
        count = drawn.sum(axis=1)
        shares = (drawn @ (self.leads > lead)) / np.where(count > 0.0, count, np.nan)[:, None]
        return np.asarray(np.nanquantile(shares, INTERVAL_SHARES, axis=0))

    def lead_interval(self) -> tuple[float, float]:
        """95 % interval of the median time before the marking at the threshold that is set. [s]"""
        if len(set(self.cluster.tolist())) < 2:
            return np.nan, np.nan
        leads = self.leads[:, self.detector.chosen]
        drawn = [np.repeat(leads, weights) for weights in self.weights[:, self.cluster]]
        medians = [_quantile(one[np.isfinite(one)], 0.5) for one in drawn]
        if not np.isfinite(medians).any():
            return np.nan, np.nan
        low, high = np.nanquantile(medians, INTERVAL_SHARES)
        return float(low), float(high)

    def sensitive_rate(self) -> FloatArray:
        """`rate` as a curve: of each limit the most that it or any higher one has, shape (m,).

        An alarm that never ends begins but once; without this a limit that is always exceeded would look perfect.
        """
        return np.maximum.accumulate(self.rate[::-1])[::-1]

    def tuned(self, rate: float) -> int:
        """Number of the most sensitive threshold with at most so many false alarms an hour."""
        fine = np.flatnonzero(self.sensitive_rate() <= rate)
        return int(fine[0]) if len(fine) else len(self.rate) - 1

    def seeing(self, share: float, lead: float) -> int:
        """Number of the least sensitive threshold at which such a share of cut-ins is seen so long before. [s]"""
        enough = np.flatnonzero(self.seen(lead) >= share)
        return int(enough[-1]) if len(enough) else 0


def _quantile(values: FloatArray, share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else np.nan


def plain(values: Any) -> Any:
    """Lists, dictionaries and numbers for JSON: rounded to a millionth, in their units, and none that is NaN."""
    if isinstance(values, dict):
        return {name: plain(value) for name, value in values.items()}
    if isinstance(values, list):
        return [plain(value) for value in values]
    return (None if np.isnan(values) else round(values, 6)) if isinstance(values, float) else values
