"""A detector that is trained: a logistic regression on position, lateral speed and acceleration over one second."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.extras.detect.command import Command
from xosc_lateral.extras.detect.detectors import RULES, Detector, Learner, read_rule
from xosc_lateral.extras.detect.observation import View, read_numbers
from xosc_lateral.extras.detect.scoring import cut_ins_of
from xosc_lateral.extras.detect.sources import Source, SourceSettings, checked
from xosc_lateral.extras.detect.tracks import STEP, Scene

ALL_RULES, TRAINED_RULE = "all", "logistic"

FEATURES = ("position", "lateral speed", "lateral acceleration", "mean lateral speed", "movement", "unrest")
"""Now; over the last second: the mean lateral speed, and the means of the amounts of speed and acceleration."""
WINDOW_ROWS = round(1.0 / STEP)
"""[rows]"""
ROW_STRIDE = round(0.2 / STEP)
"""Rows that are trained on: rows nearer to each other say the same. [rows]"""
RIDGE_PENALTY = 1.0
"""Of half the squared coefficients of standardised features, beside a log-likelihood in which both classes weigh as
much as all rows of the rarer one: keeps separable classes (lane-centre traffic) finite."""
NEWTON_STEPS = 50


def features(view: View) -> FloatArray:
    """Columns as in `FEATURES`, shape (n, 6); positive towards the lane."""
    speed, acceleration = view.lateral_speed, view.lateral_acceleration
    means = (_last_second(one) for one in (speed, np.abs(speed), np.abs(acceleration)))
    return np.column_stack([view.towards, speed, acceleration, *means])


def _last_second(values: FloatArray) -> FloatArray:
    sums = np.cumsum(np.r_[0.0, values])
    rows = np.arange(1, len(values) + 1)
    first = np.maximum(rows - WINDOW_ROWS, 0)
    return np.asarray((sums[rows] - sums[first]) / (rows - first))


@dataclass(frozen=True, eq=False)
class Regression:
    """Standardisation and coefficients of a logistic regression on `FEATURES`."""

    mean: FloatArray
    scale: FloatArray
    coefficients: FloatArray  # the intercept first

    def log_odds(self, columns: FloatArray) -> FloatArray:
        """Of rows, shape (n,)."""
        standard = (columns - self.mean) / self.scale
        return np.asarray(self.coefficients[0] + standard @ self.coefficients[1:])


def fit_regression(columns: FloatArray, positive: BoolArray) -> Regression:
    """Penalised maximum likelihood with both classes weighing the same, by Newton's method; shape (n, k) and (n,)."""
    mean, scale = columns.mean(axis=0), columns.std(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    design = np.column_stack([np.ones(len(columns)), (columns - mean) / scale])
    counts = positive.sum(), (~positive).sum()
    weight = min(counts) * np.where(positive, 1.0 / counts[0], 1.0 / counts[1])
    penalty = np.diag([0.0, *[RIDGE_PENALTY] * columns.shape[1]])
    beta = np.zeros(design.shape[1])
    for _ in range(NEWTON_STEPS):
        odds = np.clip(design @ beta, -30.0, 30.0)
        probability = 1.0 / (1.0 + np.exp(-odds))
        gradient = design.T @ (weight * (positive - probability)) - penalty @ beta
        curvature = (design * (weight * probability * (1.0 - probability))[:, None]).T @ design + penalty
        curvature[0, 0] += 1e-9
        step = np.linalg.solve(curvature, gradient)
        step *= min(1.0, 5.0 / max(float(np.abs(step).max()), 1e-12))
        beta = beta + step
        if np.abs(step).max() < 1e-8:
            break
    return Regression(mean, scale, beta)


class Logistic(Detector):
    """Above a probability of a cut-in, as trained on views of a source: `NAME` says of which."""

    name = TRAINED_RULE
    quantity = "probability [-]"
    CURVE = np.round([0.01, 0.02, 0.05, *np.arange(0.1, 0.91, 0.05), 0.95, 0.98, 0.99, 0.995, 0.999, 0.9999], 4)

    def __init__(self, regression: Regression, threshold: float = 0.5) -> None:
        self.regression = regression
        self.threshold = threshold

    @property
    def limits(self) -> FloatArray:
        """See `Detector`: log odds."""
        return np.log(self.thresholds / (1.0 - self.thresholds))

    def scores(self, scene: Scene, views: Sequence[View]) -> list[FloatArray]:
        """See `Detector`."""
        return [self.regression.log_odds(features(view)) for view in views]

    def label(self) -> str:
        """See `Detector`."""
        return f"{self.name} (threshold {self.threshold:g})"

    def threshold_of(self, limit: float) -> float:
        """See `Detector`."""
        return float(1.0 / (1.0 + np.exp(-limit)))


def rows_to_train_on(view: View) -> tuple[IndexArray, BoolArray]:
    """Rows of lane keeping and of lane changes until the marking is crossed, and which are which."""
    keeping = view.truth.keeping & view.watched
    changing = np.zeros(len(keeping), dtype=np.bool_)
    for change in cut_ins_of(view):
        changing[change.begin + 1 : change.crossing + 1] = True
    rows = np.flatnonzero(keeping | changing)
    rows = rows[rows % ROW_STRIDE == 0]
    return rows, changing[rows]


def training_rows(views: Iterable[View]) -> tuple[FloatArray, BoolArray]:
    """Features of rows that are trained on, shape (n, 6), and which are of lane changes."""
    columns, positive = [], []
    for view in views:
        rows, changing = rows_to_train_on(view)
        columns.append(features(view)[rows])
        positive.append(changing)
    if not columns:
        return np.zeros((0, len(FEATURES))), np.zeros(0, dtype=np.bool_)
    return np.concatenate(columns), np.concatenate(positive)


def train(views: Iterable[View], threshold: float, source: str) -> Logistic:
    """The detector of a source's views; raises `NotEnoughDataError` where there is no cut-in, or nothing else."""
    columns, positive = training_rows(views)
    counts = int(positive.sum()), int((~positive).sum())
    if min(counts) * ROW_STRIDE < WINDOW_ROWS:
        cut_ins, keeping = (count * ROW_STRIDE * STEP for count in counts)
        amounts = f"{cut_ins:.1f} s of cut-ins and {keeping:.1f} s of lane keeping"
        raise NotEnoughDataError(f"{source}: {amounts}, training needs 1 s of each")
    return Logistic(fit_regression(columns, positive), threshold)


# ---- detectors by their words ----
def read_detectors(word: str) -> Sequence[Detector | Learner]:
    """Rules, a command, or who trains a detector."""
    name, _, options = word.partition(":")
    if word == ALL_RULES:
        return [rule() for rule in RULES.values()]
    if name != TRAINED_RULE:
        return [read_rule(word) or Command(word)]
    threshold = read_numbers(options, {"threshold": (1e-6, 1.0 - 1e-6)}, name).get("threshold", 0.5)
    return [lambda views, source: train(views, threshold, source)]


def train_all(
    chosen: Sequence[Detector | Learner], homes: Sequence[Source], settings: SourceSettings
) -> list[Detector]:
    """Detectors; what has to be trained is, on all homes together."""
    views = [
        view for source in homes for scene in checked(source) for view in settings.views(scene, with_observers=False)
    ]
    names = ", ".join(source.label for source in homes)
    return [one if isinstance(one, Detector) else one(views, names) for one in chosen]
