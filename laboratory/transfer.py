"""Detectors set up on nominal, lifelike and real traffic, tried on real vehicles that had no part in it.

    python -m laboratory.transfer WHEEL [--seeds 0 1 ...] [--results FILE.jsonl] [--write PAGE.md]

WHEEL is `tasi-0.15.4-py3-none-any.whl`. Both halves of the recording's vehicles are home once, and tested once.
Nominal and lifelike homes are the same scenarios: our templates with drawn durations of lane changes; lifelike ones are
driven by a profile of the home half. Results are added to FILE as they come; `docs/validation/detectors.md`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.detectors import _half, drive_table, half_of, recorded
from laboratory.markers import show
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.detection.detectors import Detector, LateralSpeed, TimeToLine, WanderingZone
from xosc_lateral.workflows.detection.logistic import ROW_STRIDE, Logistic, features, rows_to_train_on, train
from xosc_lateral.workflows.detection.observation import PERFECT_SENSOR, View, views_of
from xosc_lateral.workflows.detection.scoring import Tally
from xosc_lateral.workflows.detection.sources import SourceSettings, checked, sources_of
from xosc_lateral.workflows.detection.tracks import STEP, Scene
from xosc_lateral.workflows.detection.tuning import Learner, Views, carried, out_of_fold, read_goal, scored

FloatArray = NDArray[np.float64]

SCENARIOS = {"cut-in": 20, "overtake-truck": 20, "dense-traffic": 4}
"""Templates, and how many of each: 68 lane changes."""
DURATIONS = (4.0, 10.0)
"""Of lane changes, drawn evenly. [s]"""
GOALS = ("20/h", "95%")
RULES: Sequence[Detector] = (LateralSpeed(), WanderingZone(), TimeToLine())
WINDOW = round(2.0 / STEP)
"""Of the network. [rows]"""


# ---- learners --------------------------------------------------------------------------------------------------------
def window(view: View) -> FloatArray:
    """Position and lateral speed of the last 2 s, every 0.2 s, shape (n, 22)."""
    n = len(view.track)
    rows = np.maximum(np.arange(n)[:, None] - np.arange(0, WINDOW + 1, ROW_STRIDE), 0)
    return np.column_stack([view.towards[rows], view.lateral_speed[rows]])


class Learnt(Detector):
    """A classifier of scikit-learn; its score is the log-odds."""

    quantity = "probability [-]"
    CURVE = Logistic.CURVE
    threshold = 0.5

    def __init__(self, name: str, classifier: Any, columns: Any) -> None:
        self.name, self.classifier, self.columns = name, classifier, columns  # type: ignore[misc]

    @property
    def limits(self) -> FloatArray:
        """See `Detector`."""
        return np.log(self.thresholds / (1.0 - self.thresholds))

    def threshold_of(self, limit: float) -> float:
        """See `Detector`."""
        return float(1.0 / (1.0 + np.exp(-limit)))

    def scores(self, scene: Scene, views: Sequence[View]) -> list[FloatArray]:
        """See `Detector`."""
        if not views:
            return []
        columns = [self.columns(view) for view in views]
        chance = self.classifier.predict_proba(np.concatenate(columns))[:, 1].clip(1e-12, 1.0 - 1e-12)
        ends = np.cumsum([len(one) for one in columns])[:-1]
        return np.split(np.log(chance / (1.0 - chance)), ends)


def learner_of(name: str, seed: int) -> Learner:
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.neural_network import MLPClassifier
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    def learn(views: Iterable[View], source: str) -> Detector:
        if name == "logistic":
            return train(views, 0.5, source)
        columns_of = features if name == "boosted trees" else window
        columns, positive = [], []
        for view in views:
            rows, changing = rows_to_train_on(view)
            columns.append(columns_of(view)[rows])
            positive.append(changing)
        x, y = np.concatenate(columns), np.concatenate(positive)
        rng = np.random.default_rng(seed)
        if name == "boosted trees":
            weight = np.where(y, len(y) / (2.0 * y.sum()), len(y) / (2.0 * (~y).sum()))
            trees = HistGradientBoostingClassifier(
                max_iter=80, max_leaf_nodes=15, l2_regularization=1.0, random_state=seed
            )
            return Learnt(name, trees.fit(x, y, sample_weight=weight), columns_of)
        keeping = rng.choice(np.flatnonzero(~y), min(20_000, int((~y).sum())), replace=False)
        changing = rng.choice(np.flatnonzero(y), len(keeping))  # both classes weigh the same
        rows = np.concatenate([keeping, changing])
        network = MLPClassifier((24, 12), alpha=1e-3, max_iter=15, batch_size=256, random_state=seed)
        return Learnt(name, make_pipeline(StandardScaler(), network).fit(x[rows], y[rows]), columns_of)

    return learn


LEARNERS = ("logistic", "boosted trees", "network, 2 s")


# ---- homes -----------------------------------------------------------------------------------------------------------
def written_scenarios(folder: Path, seed: int) -> None:
    """Templates with drawn durations of lane changes."""
    rng = np.random.default_rng((74, seed))
    for name, count in SCENARIOS.items():
        for number in range(count):
            xl.write_template(
                name, folder / f"{name}-{number}", lane_change_time=round(float(rng.uniform(*DURATIONS)), 1)
            )


def views_without_observers(scenes: Iterable[Scene]) -> list[tuple[Scene, list[View]]]:
    return [(scene, views_of(scene, PERFECT_SENSOR, 0, with_observers=False)) for scene in scenes]


def homes_of(wheel: Path, half: int, seed: int, folder: Path) -> Iterator[tuple[str, Views]]:
    """Nominal, lifelike and real."""
    profile = folder / f"half-{half}.json"
    if not profile.exists():
        table = drive_table(wheel)
        xl.write_profile(xl.fit(table[[_half(name) == half for name in table["drive"]]], name="half"), profile)
    scenarios = folder / f"scenarios-{seed}"
    if not scenarios.exists():
        written_scenarios(scenarios, seed)
    settings = SourceSettings(ConvertSettings.of(seed=seed), 1, (str(profile),), "none")
    nominal, lifelike = sources_of(scenarios, settings)
    yield "nominal", views_without_observers(checked(nominal))
    yield "lifelike", views_without_observers(checked(lifelike))
    yield "real", views_without_observers(half_of(recorded(wheel), half))


def at(detector: Detector, views: Views, held: str) -> dict[str, float]:
    """What it does on held-out vehicles."""
    tally = Tally(detector, held)
    for scene, several in views:
        tally.add(scene, several)
    curve, k = tally.curve(), detector.chosen
    low, high = curve.rate_interval()[:, k]
    return {
        "rate": float(curve.rate[k]), "low": float(low), "high": float(high), "seen": float(curve.in_time[k]),
        "lead": float(curve.lead(0.5)[k]),
    }  # fmt: skip


def results(wheel: Path, half: int, seed: int, folder: Path) -> Iterator[dict[str, Any]]:
    """A row for each home, detector and goal."""
    goals = [read_goal(text) for text in GOALS]
    tested = views_without_observers(half_of(recorded(wheel), 1 - half))
    for home, views in homes_of(wheel, half, seed, folder):
        for one in (*RULES, *LEARNERS):
            name = one.title() if isinstance(one, Detector) else one
            if home == "real" and isinstance(one, Detector) and seed:
                continue  # nothing in it is drawn
            if isinstance(one, Detector):
                trained, at_home = one, scored(one, views)
            else:
                trained, at_home = out_of_fold(learner_of(one, seed), views, home)
            chosen: dict[str, Detector] = {goal.text: carried(goal, trained, at_home, home) for goal in goals}
            if not isinstance(one, Detector):
                chosen["p = 0.5"] = trained
            for goal_text, detector in chosen.items():
                key = {"half": half, "seed": seed, "home": home, "detector": name, "goal": goal_text}
                yield {**key, "threshold": detector.threshold, **at(detector, tested, "held out")}


def lines_of(rows: Sequence[dict[str, Any]], goal: str) -> str:
    """Means over seeds and halves; in brackets the smallest and the largest lower and upper end of a 95 % interval."""
    found = [row for row in rows if row["goal"] == goal]
    homes, names = ("nominal", "lifelike", "real"), list(dict.fromkeys(row["detector"] for row in found))
    lines = ["| detector | " + " | ".join(f"set up on {home}" for home in homes) + " |", "|---" * 4 + "|"]
    for name in names:
        cells = []
        for home in homes:
            each = [row for row in found if (row["detector"], row["home"]) == (name, home)]
            if not each:
                cells.append("-")
                continue
            rates = [row["rate"] for row in each]
            low, high = min(row["low"] for row in each), max(row["high"] for row in each)
            seen, lead = (np.nanmean([row[key] for row in each]) for key in ("seen", "lead"))
            cells.append(f"{np.mean(rates):.0f} ({low:.0f} to {high:.0f}); {100.0 * seen:.0f} %; {lead:.2f} s")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2, 3, 4])
    parser.add_argument("--halves", type=int, nargs="*", default=[0, 1])
    parser.add_argument("--results", type=Path, default=Path("transfer.jsonl"))
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    with TemporaryDirectory() as name:
        for seed in args.seeds:
            for half in args.halves:
                for row in results(args.wheel, half, seed, Path(name)):
                    with args.results.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
    rows = [json.loads(line) for line in args.results.read_text(encoding="utf-8").splitlines()]
    last = {(row["half"], row["seed"]) for row in rows if (row["home"], row["detector"]) == ("real", LEARNERS[-1])}
    rows = [row for row in rows if (row["half"], row["seed"]) in last]  # others are not complete
    print(f"{len(last)} of home half and seed: {sorted(last)}")
    for goal, marker in (("20/h", "rate"), ("95%", "share"), ("p = 0.5", "half")):
        show(lines_of(rows, goal), args.write, f"transfer-{marker}")


if __name__ == "__main__":
    main()
