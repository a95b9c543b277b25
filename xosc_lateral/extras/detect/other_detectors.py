"""Detectors that are no formula: the user's own program, one that is trained; and which detector a word means."""

from __future__ import annotations

import json
import shlex
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from queue import Empty, Queue
from threading import Thread
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.base.errors import NotEnoughDataError, SimulationError, did_you_mean
from xosc_lateral.base.grouping import grouped
from xosc_lateral.extras.detect.detectors import RULES, Detector, Learner, read_rule
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, SensedTrack, View, measure, read_numbers
from xosc_lateral.extras.detect.scoring import cut_ins_of
from xosc_lateral.extras.detect.sources import Source, SourceSettings, checked
from xosc_lateral.extras.detect.tracks import STEP, LaneTrack, Scene

# ---- a program that reads what is seen and writes its alarms, a line of JSON per step ----
ANSWER_TIME = 10.0
"""An answer has to come within this; the first may take longer, while the program starts. [s]"""
START_TIME = 60.0
SIDES = {"left": 1, "right": -1}


class Command(Detector):
    """A program; it is started anew for every scene, so that nothing is left from another one."""

    name = "command"
    quantity = "score [-]"
    CURVE = np.round(np.arange(0.0, 1.0, 0.02), 3)

    def __init__(self, words: str, threshold: float = 0.5, answer_time: float = ANSWER_TIME) -> None:
        try:
            self.words = shlex.split(words)
        except ValueError as error:
            raise ValueError(f"{words!r}: {str(error).lower()}") from error
        if not self.words:
            raise ValueError("an empty command")
        self.text, self.threshold, self._answer_time = words, threshold, answer_time

    def title(self) -> str:
        """See `Detector`."""
        return self.text

    def scores(self, scene: Scene, views: Sequence[View]) -> list[FloatArray]:
        """See `Detector`."""
        scores = [np.zeros(len(view.track)) for view in views]
        if not views:
            return scores
        watched = grouped(((view.number, view.track.name), number) for number, view in enumerate(views))
        with _started(self.words, scene.name) as talk:
            for line, present in _steps(scene, views):
                limit = START_TIME if line["time"] == present[0] else self._answer_time
                answers = talk(line, limit)
                for (_, name), numbers in watched.items():
                    if name in answers:
                        for number in numbers:
                            view = views[number]
                            row = present[1] - view.track.first
                            if 0 <= row < len(view.track):
                                scores[number][row] = _score(answers[name], view.side, name, line["time"], scene.name)
        return scores


def _steps(scene: Scene, views: Sequence[View]) -> Iterator[tuple[dict[str, Any], tuple[float, int]]]:
    """What is said at each instant, with the time of the first one and the instant's number."""
    measured = {view.number: view.measured for view in views}
    first = min(track.first for track in scene.tracks)
    last = max(track.first + len(track) for track in scene.tracks)
    rng = np.random.default_rng(0)  # the ego, say, knows itself: a sensor without errors draws nothing
    known = [
        _columns(track, measured.get(number) or measure(track, PERFECT_SENSOR, rng), scene)
        for number, track in enumerate(scene.tracks)
    ]
    for instant in range(first, last):
        vehicles = {
            track.name: {name: values[instant - track.first] for name, values in columns.items()} | fixed
            for track, (columns, fixed) in zip(scene.tracks, known, strict=True)
            if track.first <= instant < track.first + len(track)
        }
        line = {"time": round(STEP * instant, 3), "ego": scene.ego, "vehicles": vehicles}
        yield line, (round(STEP * first, 3), instant)


def _columns(track: LaneTrack, measured: SensedTrack, scene: Scene) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """Values of a track that change, as lists, and those that don't; what is not known is left out."""
    taken = measured.taken
    values: dict[str, Any] = {
        "offset": measured.offset, "lateral_speed": measured.speed, "lane_width": track.lane_width[taken],
        "speed": track.speed[taken],
    }  # fmt: skip
    if "x" in track.columns:
        values |= {"x": track.x[taken], "y": track.y[taken], "heading": track.heading[taken]}
    columns: dict[str, list[Any]] = {name: np.round(one, 6).tolist() for name, one in values.items()}
    if scene.network is not None and "road" in track.columns:
        ids = scene.network.road_ids
        columns["road"] = [ids[number] for number in track.road[taken].tolist()]
        columns |= {"lane": track.lane[taken].tolist(), "s": np.round(track.s[taken], 3).tolist()}
    if np.isnan(track.speed).any():
        del columns["speed"]
    size = {name: getattr(track.box, name) for name in ("length", "width", "center_x")}
    return columns, {name: round(value, 3) for name, value in size.items()}


def _score(answer: Any, side: int, name: str, time: float, scene: str) -> float:
    """What is answered of a vehicle, from one side."""
    value = answer.get("score") if isinstance(answer, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise SimulationError(f"{scene}, {time:g} s: vehicle {name!r}: score is {json.dumps(value)}, expected a number")
    stated_side = answer.get("side")
    if stated_side is not None and stated_side not in SIDES:
        raise SimulationError(
            f"{scene}, {time:g} s: vehicle {name!r}: side is {json.dumps(stated_side)}, expected left or right"
        )
    return float(value) if stated_side is None or SIDES[stated_side] == side else 0.0


@contextmanager
def _started(words: Sequence[str], scene: str) -> Iterator[Callable[[dict[str, Any], float], dict[str, Any]]]:
    """A running program, as a function from a line to the answer's vehicles."""
    try:
        program = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8")
    except OSError as error:
        known = [*RULES, "logistic"]
        why = f"{str(error.strerror).lower()}{did_you_mean(words[0], known)}"
        what = f"detector {words[0]!r} can't be started: {why}; built in are {', '.join(known)}"
        raise SimulationError(what) from error
    lines: Queue[str | None] = Queue()
    assert program.stdin is not None and program.stdout is not None
    questions, output = program.stdin, program.stdout

    def listen() -> None:
        try:
            for line in output:
                lines.put(line)
        except ValueError:  # closed, or no text
            pass
        lines.put(None)

    listener = Thread(target=listen, daemon=True)
    listener.start()

    def talk(line: dict[str, Any], limit: float) -> dict[str, Any]:
        where = f"{scene}, {line['time']:g} s: detector {words[0]!r}"
        with suppress(OSError):  # where it has ended, its exit code is told below
            questions.write(json.dumps(line) + "\n")
            questions.flush()
        try:
            answer = lines.get(timeout=limit)
        except Empty:
            raise SimulationError(f"{where} did not answer within {limit:g} s") from None
        if answer is None:
            code = program.wait()
            raise SimulationError(f"{where} ended with exit code {code} before it answered")
        vehicles = _vehicles(answer, line["time"], where)
        if unknown := vehicles.keys() - line["vehicles"].keys():
            raise SimulationError(f"{where} answered for vehicle {min(unknown)!r}, which is not there")
        return vehicles

    try:
        yield talk
    finally:
        program.kill()
        program.wait()
        listener.join(ANSWER_TIME)  # its children may still hold the pipe
        for pipe in (questions, output):
            with suppress(OSError):
                pipe.close()


def _vehicles(answer: str, time: float, where: str) -> dict[str, Any]:
    """Vehicles that an answer names."""
    shown = answer.strip()[:80]
    try:
        values = json.loads(answer)
    except json.JSONDecodeError as error:
        raise SimulationError(f"{where} answered {shown!r}: no JSON") from error
    vehicles = values.get("vehicles") if isinstance(values, dict) else None
    if not isinstance(vehicles, dict):
        raise SimulationError(f"{where} answered {shown!r}: `vehicles` has to be an object by name")
    if values.get("time", time) != time:
        raise SimulationError(f"{where} answered for {values['time']!r} s")
    return vehicles


ALL_RULES, TRAINED_RULE = "all", "logistic"

# ---- a logistic regression on position, lateral speed and acceleration over one second ----
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
