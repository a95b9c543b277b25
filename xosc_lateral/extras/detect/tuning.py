"""Thresholds set at home, where a developer has truth, and carried to other traffic, which had no part in them."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.evaluation.spectra import Spectrum
from xosc_lateral.extras.detect.detectors import NO_DANGER, Detector, Learner
from xosc_lateral.extras.detect.observation import View, seen_through
from xosc_lateral.extras.detect.scoring import Curve, Tally, cut_ins_of
from xosc_lateral.extras.detect.sources import Source, SourceSettings, checked
from xosc_lateral.extras.detect.tracks import STEP, Scene

Views: TypeAlias = Sequence[tuple[Scene, Sequence[View]]]
"""Scenes, each with what is seen in it."""

FOLDS = 5
"""Of a home's vehicles: a trained detector scores those of one fold as trained on the others. The usual number, or that
of the vehicles that change lanes: every fold needs one."""
GRID = 1000
"""Thresholds tried at home, of the score's peaks in lane keeping by rank: the highest each, then 1.4 % apart in rank at
a million peaks, so that rates are met within as much. An evenly spaced grid misses rates by factors."""


@dataclass(frozen=True, slots=True)
class Goal:
    """What a threshold is set to at home: at most so many false alarms an hour, or at least such a share seen."""

    text: str
    rate: float | None = None  # [1/h]
    share: float | None = None  # of cut-ins
    lead: float = 0.0  # before the marking, more than that [s]

    @property
    def what(self) -> str:
        """In words."""
        if self.rate is not None:
            return f"at most {self.rate:g} false alarms an hour"
        early = f"{self.lead:g} s " if self.lead else ""
        return f"the fewest false alarms with {self.share:.0%} of the cut-ins seen {early}before the marking"

    def number(self, curve: Curve) -> tuple[int, str]:
        """Of the threshold that meets it, and why none does it: empty where one does.

        A rate is met where a more sensitive threshold would exceed it. The most sensitive one of all shows nothing of
        the kind: traffic that raises too few alarms at any threshold sets none.
        """
        if self.rate is not None:
            k, rates = curve.tuned(self.rate), curve.sensitive_rate()
            if rates[k] > self.rate:
                return k, f"{rates[k]:.1f} an hour at least"
            if k > 0:
                return k, ""
            return k, f"{rates[0]:.1f} an hour at any threshold" if rates[0] else "no alarm at any threshold"
        assert self.share is not None
        k = curve.seeing(self.share, self.lead)
        seen = float(curve.seen(self.lead)[k])
        return k, "" if seen >= self.share else f"{seen:.0%} seen at most"


def read_goal(text: str) -> Goal:
    """A goal from ``20/h``, ``95%`` or ``90% 1s``; raises `ValueError`."""
    match = re.fullmatch(r"(\d+\.?\d*)\s*(?:/\s*h|(%)(?:\s+(\d+\.?\d*)\s*s)?)", text.strip())
    value = float(match[1]) if match else 0.0
    if match is None or value <= 0.0 or (match[2] and value > 100.0):
        what = "cut-ins seen as in 95%, or in 90% 1s so long before the marking"
        raise ValueError(f"{text!r}: expected false alarms an hour as in 20/h, or {what}")
    if match[2]:
        return Goal(text.strip(), share=0.01 * value, lead=float(match[3] or 0.0))
    return Goal(text.strip(), rate=value)


@dataclass(frozen=True, eq=False)
class Home:
    """Where a threshold was set, and what the detector does there: on vehicles that it was not trained on."""

    source: str
    goal: Goal
    why_not: str  # No threshold meets the goal; empty: one does.
    rate: float  # false alarms an hour
    seen: float  # share of cut-ins before the marking; NaN: there are none
    hours: float = 0.0  # of lane keeping
    is_source: bool = False  # tried on the source itself: each vehicle's threshold comes from other vehicles

    @property
    def met(self) -> bool:
        """Whether a threshold meets the goal."""
        return not self.why_not


class AtLimits(Detector):
    """A detector at some limits alone, increasing."""

    def __init__(self, detector: Detector, limits: FloatArray, chosen: int = 0) -> None:
        self.detector, self._limits, self._chosen = detector, limits, chosen
        self.needs_observer, self.growing = detector.needs_observer, detector.growing  # type: ignore[misc]
        self.name, self.quantity = detector.name, detector.quantity  # type: ignore[misc]

    @property
    def limits(self) -> FloatArray:
        """See `Detector`."""
        return self._limits

    @property
    def chosen(self) -> int:
        """See `Detector`."""
        return self._chosen

    def scores(self, scene: Scene, views: Sequence[View]) -> list[FloatArray]:
        """See `Detector`."""
        return self.detector.scores(scene, views)


class Carried(AtLimits):
    """A detector with a threshold from home."""

    def __init__(self, detector: Detector, limit: float, home: Home) -> None:
        limits = np.unique(np.append(np.array([]) if home.is_source else detector.limits, limit))
        super().__init__(detector, limits, int(np.searchsorted(limits, limit)))
        self.threshold, self.home, self.home_source = detector.threshold_of(limit), home, home.source

    @property
    def thresholds(self) -> FloatArray:
        """See `Detector`."""
        return np.array([self.detector.threshold_of(limit) for limit in self._limits])

    def label(self) -> str:
        """See `Detector`."""
        return f"{self.detector.title()}, set on {self.home.source}"

    def title(self) -> str:
        """See `Detector`."""
        return self.detector.title()


@dataclass(frozen=True, eq=False)
class Scored:
    """A view with its score, shape (n,)."""

    scene: Scene
    view: View
    score: FloatArray


def scored(detector: Detector, views: Views) -> list[Scored]:
    """Every view that the detector can score."""
    scored_views = []
    for scene, several in views:
        usable = detector.usable(several)
        scores = detector.scores(scene, usable)
        scored_views += [Scored(scene, *each) for each in zip(usable, scores, strict=True)]
    return scored_views


def tune_all(
    goal: Goal,
    chosen: Sequence[Detector | Learner],
    homes: Sequence[Source],
    tried_on: Sequence[Source],
    settings: SourceSettings,
    recorded: Spectrum | None = None,
) -> tuple[list[Detector], dict[str, list[Tally]]]:
    """Every detector with its threshold from each home; and by the home's label what each does there, if it is tried.

    `recorded`: spectrum of lane keeping through whose band homes are seen. Raises `ValueError`: two homes of one label.
    """
    labels = [source.label for source in homes]
    if twice := sorted({label for label in labels if labels.count(label) > 1}):
        raise ValueError(f"two homes are called {twice[0]!r}, which rows could not tell apart")
    carriers, at_home = list[Detector](), dict[str, list[Tally]]()
    with_observers = any(isinstance(one, Detector) and one.needs_observer for one in chosen)
    for source in homes:
        scenes = list(checked(source))
        seen = settings if recorded is None else replace(
            settings, sensor=seen_through(recorded, scenes, settings.sensor)
        )  # fmt: skip
        views = [(scene, seen.views(scene, with_observers=with_observers)) for scene in scenes]
        for detector in chosen:
            if isinstance(detector, Detector):
                trained, every = detector, scored(detector, views)
            else:
                trained, every = out_of_fold(detector, views, source.label)
            carriers.append(carried(goal, trained, every, source.label))
            if any(map(source.is_same, tried_on)):
                at_home.setdefault(source.label, []).append(carried_within(goal, trained, every, source.label))
    return carriers, at_home


def out_of_fold(learner: Learner, views: Views, source: str) -> tuple[Detector, list[Scored]]:
    """The detector trained on all, and scores of each vehicle by one that was trained on others alone.

    Raises `NotEnoughDataError` where fewer than two vehicles change lanes.
    """
    folds = folds_of([view for _, several in views for view in several], source, every_changes=True)
    scored_views: list[Scored] = []
    for fold in sorted(set(folds.values())):
        others = (view for _, several in views for view in several if folds[view.track.cluster] != fold)
        trained = learner(others, source)
        held = [(scene, [view for view in several if folds[view.track.cluster] == fold]) for scene, several in views]
        scored_views += scored(trained, [(scene, several) for scene, several in held if several])
    return learner((view for _, several in views for view in several), source), scored_views


def folds_of(views: Sequence[View], source: str, *, every_changes: bool) -> dict[str, int]:
    """Vehicle -> fold; those that change lanes are dealt out by themselves, so that each fold has its share."""
    changing = sorted({view.track.cluster for view in views if cut_ins_of(view)})
    rest = sorted({view.track.cluster for view in views} - set(changing))
    count = min(FOLDS, len(changing) if every_changes else len(changing) + len(rest))
    if count < 2:
        what = f"{len(changing)} vehicle(s) of {len(changing) + len(rest)} change lanes"
        wanted = "that change lanes" if every_changes else "at all"
        raise NotEnoughDataError(
            f"{source}: {what}; so that no vehicle has a part in its own threshold, there have to be 2 {wanted}"
        )
    return {cluster: number % count for each in (changing, rest) for number, cluster in enumerate(each)}


def carried(
    goal: Goal, detector: Detector, at_home: Sequence[Scored], source: str, *, is_source: bool = False
) -> Carried:
    """The detector with the threshold that meets the goal in these views."""
    tally = Tally(AtLimits(detector, _grid(detector, at_home, goal.lead)), source)
    for each in at_home:
        tally.count(each.scene, each.view, each.score)
    curve = tally.curve()
    if not len(curve.hours) or not curve.hours.sum():
        raise NotEnoughDataError(f"{source}: no lane keeping that {detector.name} can be set on")
    if goal.share is not None and not len(curve.leads):
        raise NotEnoughDataError(f"{source}: no cut-in, so that no threshold sees {goal.text} of them")
    k, why_not = goal.number(curve)
    figures = float(curve.rate[k]), float(curve.seen(0.0)[k]), float(curve.hours.sum())
    return Carried(detector, float(curve.detector.limits[k]), Home(source, goal, why_not, *figures, is_source))


def carried_within(goal: Goal, detector: Detector, at_home: Sequence[Scored], source: str) -> Tally:
    """What the detector does at home itself: in each fold of vehicles with the threshold that the others give."""
    folds = folds_of([each.view for each in at_home], source, every_changes=goal.share is not None)
    whole = carried(goal, detector, at_home, source, is_source=True)
    tally = Tally(whole, source)
    for fold in sorted(set(folds.values())):
        others = [each for each in at_home if folds[each.view.track.cluster] != fold]
        tally.detector = carried(goal, detector, others, source, is_source=True)
        for each in at_home:
            if folds[each.view.track.cluster] == fold:
                tally.count(each.scene, each.view, each.score)
    tally.detector = whole
    return tally


def _grid(detector: Detector, at_home: Sequence[Scored], lead: float) -> FloatArray:
    """Scores at which counts change, none below the most sensitive threshold of the detector's own curve.

    Of cut-ins the highest until so long before the marking [s]. Where nothing moves no threshold alarms, and only the
    most sensitive one stands for what a developer would take.
    """
    peaks, reached, early = [], [], round(lead / STEP)
    for each in at_home:
        score = np.where(each.view.watched, each.score, NO_DANGER)
        keeping = each.view.truth.keeping & each.view.watched
        higher = score[1:-1] >= np.maximum(score[:-2], score[2:])
        peaks.append(score[1:-1][higher & keeping[1:-1]])
        reached += [float(score[c.begin : max(c.crossing - early, c.begin + 1)].max()) for c in cut_ins_of(each.view)]
    ordered = np.sort(np.concatenate([*peaks, detector.limits[:1]]))[::-1]
    ranks = np.unique(np.round(np.geomspace(1, len(ordered), GRID)).astype(np.int64)) - 1
    below = np.nextafter(np.array(reached), -np.inf)  # alarms are above a limit
    every = np.unique(np.concatenate([ordered[ranks], below, detector.limits]))
    return np.asarray(every[every >= detector.limits[0]])


def not_met(carriers: Collection[Carried]) -> list[str]:
    """Detectors and homes at which no threshold meets the goal, in words."""
    missed = [(one.title(), one.home) for one in carriers if not one.home.met]
    return sorted({f"{title} on {home.source}: cannot be set here, {home.why_not}" for title, home in missed})
