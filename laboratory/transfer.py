"""Detectors set up on nominal, lifelike and real traffic, tried on real vehicles that had no part in it.

    python -m laboratory.transfer WHEEL [--openacc FILE...] [--seeds 0 1 ...] [--results FILE.jsonl] [--write PAGE.md]

WHEEL is `tasi-0.15.4-py3-none-any.whl`; FILEs are runs of OpenACC's AstaZero campaign. Both halves of the recording's
vehicles are home once, and tested once. Nominal and lifelike homes are the same scenarios: our templates, varied like
the home half's lane changes (`fit --maneuvers`, `vary --like --replace`); lifelike ones are driven by a profile of that
half, and seen through its band (`detect --band-of`; "unsmoothed": as they are). Shipped homes take no recording:
templates as they are, driven by `motorway`; "banded": varied like `motorway`, and seen through the band that its record
holds. GNSS runs hold no cut-in: alarms there are false. Results are added to FILE as they come;
`docs/validation/detectors.md`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.detectors import drive_table, half_of, in_half, recorded, run_scenes
from laboratory.markers import show
from laboratory.shortcut import area, moments_of
from xosc_lateral.extras.detect.detectors import Detector, LateralSpeed, Learner, TimeToLine, WanderingZone
from xosc_lateral.extras.detect.observation import (
    PERFECT_SENSOR,
    Sensor,
    View,
    keeping_spectrum,
    seen_through,
    spectrum_in,
    views_of,
)
from xosc_lateral.extras.detect.other_detectors import (
    ROW_STRIDE,
    Logistic,
    features,
    fit_regression,
    rows_to_train_on,
    train,
)
from xosc_lateral.extras.detect.scoring import Tally
from xosc_lateral.extras.detect.sources import SourceSettings, checked, sources_of
from xosc_lateral.extras.detect.tracks import STEP, Scene
from xosc_lateral.extras.detect.tuning import AtLimits, Views, carried, out_of_fold, read_goal, scored
from xosc_lateral.extras.recordings.lane_order import RoadLanes
from xosc_lateral.extras.recordings.reconstruct import changes_of, law_of
from xosc_lateral.extras.recordings.recorded import place_tracks
from xosc_lateral.extras.recordings.recordings import read_recording
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.workflows.conversion.settings import ConvertSettings

FloatArray = NDArray[np.float64]

SCENARIOS = {"cut-in": 20, "overtake-truck": 20, "dense-traffic": 4}
"""Templates, and how many of each: 68 lane changes."""
GOALS = ("20/h", "90% 1s", "95%")
HOMES = ("nominal", "lifelike", "shipped", "shipped, banded", "real")
SHIPPED = "motorway"
RULES: Sequence[Detector] = (LateralSpeed(), WanderingZone(), TimeToLine())
WINDOW = round(2.0 / STEP)
"""Of the network. [rows]"""
MOST_ROWS = 20_000
"""Of each class, that trees and networks are trained on. [-]"""


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
    from sklearn.exceptions import ConvergenceWarning
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
        keeping = rng.choice(np.flatnonzero(~y), min(MOST_ROWS, int((~y).sum())), replace=False)
        changing = rng.choice(np.flatnonzero(y), len(keeping))  # both classes weigh the same
        rows = np.concatenate([keeping, changing])
        if name == "boosted trees":
            trees = HistGradientBoostingClassifier(
                max_iter=80, max_leaf_nodes=15, l2_regularization=1.0, random_state=seed
            )
            return Learnt(name, trees.fit(x[rows], y[rows]), columns_of)
        network = MLPClassifier(
            (24, 12), alpha=1e-3, max_iter=15, batch_size=1024, learning_rate_init=4e-3, random_state=seed
        )
        with warnings.catch_warnings():  # so many rounds, and no more
            warnings.simplefilter("ignore", ConvergenceWarning)
            return Learnt(name, make_pipeline(StandardScaler(), network).fit(x[rows], y[rows]), columns_of)

    return learn


LEARNERS = ("logistic", "boosted trees", "network, 2 s")


# ---- homes -----------------------------------------------------------------------------------------------------------
@cache
def profile_of(wheel: Path, half: int) -> xl.DriverProfile:
    """Drivers of a half of the recording, and their lane changes."""
    table = drive_table(wheel)
    fitted = xl.fit(table[[in_half(name, half) for name in table["drive"]]], name=f"half-{half}")
    traffic = read_recording(wheel)
    vehicles = place_tracks(traffic.tracks, traffic.network, *traffic.span).vehicles
    drivers = [one for one in vehicles if in_half(one.name, half)]
    found = changes_of(drivers, vehicles, RoadLanes(traffic.network))
    return replace(fitted, maneuvers=law_of(found, traffic.name))


@cache
def real_half(wheel: Path, half: int) -> Views:
    return views_without_observers(half_of(recorded(wheel), half))


def varied_scenarios(folder: Path, profile: str, seed: int) -> Path:
    """Templates with lane changes like a profile's: the folder of their parameter distributions."""
    for name, count in SCENARIOS.items():
        scenario, _ = xl.write_template(name, folder / "templates" / name)
        xl.vary(scenario, folder / "home" / name, like=profile, count=count, seed=seed, replace=True)
    return folder / "home"


def views_without_observers(scenes: Iterable[Scene], sensor: Sensor = PERFECT_SENSOR) -> Views:
    return [(scene, views_of(scene, sensor, 0, with_observers=False)) for scene in scenes]


def homes_of(wheel: Path, half: int, seed: int, names: Sequence[str]) -> Iterator[tuple[str, Views]]:
    """Those of `HOMES` that are asked for, and "unsmoothed"."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        convert = dataclasses.replace(ConvertSettings.of(seed=seed, allow=[str(folder)]), step=STEP)  # as it is played
        if {"nominal", "lifelike", "unsmoothed"} & set(names):
            xl.write_profile(profile_of(wheel, half), folder / "profile.json")
            scenarios = varied_scenarios(folder, str(folder / "profile.json"), seed)
            nominal, lifelike = sources_of(
                scenarios, SourceSettings(convert, 1, (str(folder / "profile.json"),), "none")
            )
        if "nominal" in names:
            yield "nominal", views_without_observers(checked(nominal))
        if {"lifelike", "unsmoothed"} & set(names):
            scenes = list(checked(lifelike))
            band = keeping_spectrum((one for scene in half_of(recorded(wheel), half) for one in scene.tracks), "home")
            for home, sensor in (
                ("lifelike", seen_through(band, scenes, PERFECT_SENSOR)), ("unsmoothed", PERFECT_SENSOR),
            ):  # fmt: skip
                if home in names:
                    yield home, views_without_observers(scenes, sensor)
    for home in HOMES[2:4]:
        if home in names:
            yield home, shipped_home(seed, banded=home == HOMES[3])
    if "real" in names:
        yield "real", real_half(wheel, half)


@cache
def shipped_home(seed: int, *, banded: bool) -> Views:
    """Templates driven by a shipped profile: as they are, or varied like it and seen as its recording shows traffic."""
    with TemporaryDirectory() as name:
        folder, scenes = Path(name), list[Scene]()
        convert = dataclasses.replace(ConvertSettings.of(seed=seed, allow=[name]), step=STEP)
        if banded:
            _, lifelike = sources_of(
                varied_scenarios(folder, SHIPPED, seed), SourceSettings(convert, 1, (SHIPPED,), "none")
            )
            scenes = list(checked(lifelike))
            sensor = seen_through(spectrum_in(read_profile(SHIPPED)), scenes, PERFECT_SENSOR)
            return views_without_observers(scenes, sensor)
        for template, count in SCENARIOS.items():
            scenario, _ = xl.write_template(template, folder / template)
            _, lifelike = sources_of(scenario, SourceSettings(convert, count, (SHIPPED,), "none"))
            scenes += checked(lifelike)
        return views_without_observers(scenes)


def at(detector: Detector, limits: dict[str, float], views: Views, runs: Sequence[Views]) -> Iterator[dict[str, Any]]:
    """What it does on held-out vehicles, and on runs that hold no cut-in, at the limit of each goal."""
    ordered = np.unique([*limits.values()])
    tally = Tally(AtLimits(detector, ordered), "held out")
    for scene, several in views:
        tally.add(scene, several)
    curve, low_high, calm = tally.curve(), tally.curve().rate_interval(), []
    for run in runs:
        alone = Tally(AtLimits(detector, ordered), "run")
        for scene, several in run:
            alone.add(scene, several)
        calm.append(alone.curve().rate)
    for goal, limit in limits.items():
        k = int(np.searchsorted(ordered, limit))
        yield {
            "goal": goal, "threshold": detector.threshold_of(limit), "rate": float(curve.rate[k]),
            "low": float(low_high[0, k]), "high": float(low_high[1, k]), "seen": float(curve.seen(0.0)[k]),
            "lead": float(curve.lead(0.5)[k]), "runs": [float(rates[k]) for rates in calm],
        }  # fmt: skip


def results(
    wheel: Path, half: int, seed: int, homes: Sequence[str], detectors: Sequence[str], runs: Sequence[Views]
) -> Iterator[dict[str, Any]]:
    """A row for each home, detector and goal."""
    goals = [read_goal(text) for text in GOALS]
    tested = real_half(wheel, 1 - half)
    for home, views in homes_of(wheel, half, seed, homes):
        key = {"half": half, "seed": seed, "home": home}
        for one in (*RULES, *(name for name in LEARNERS if name in detectors)):
            name = one.title() if isinstance(one, Detector) else one
            if home == "real" and seed and (isinstance(one, Detector) or one == "logistic"):
                continue  # nothing in it is drawn
            if isinstance(one, Detector):
                trained, at_home = one, scored(one, views)
            else:
                trained, at_home = out_of_fold(learner_of(one, seed), views, home)
            chosen = [carried(goal, trained, at_home, home) for goal in goals]
            limits = {one.home.goal.text: float(one.limits[one.chosen]) for one in chosen if one.home.met}
            for found in at(trained, limits, tested, runs) if limits else ():
                yield {**key, "detector": name, **found}
        if home != "nominal":
            yield {**key, "detector": "shortcut", "goal": "AUC", **told(views, tested)}


def told(home: Views, tested: Views) -> dict[str, float]:
    """AUC of the seconds before a lane change, learnt at home and tried on the tested vehicles, and the other way."""
    own, real = moments_of(home), moments_of(tested)
    fits = [fit_regression(each.columns, each.positive) for each in (own, real)]
    return {
        "there": area(fits[0].log_odds(real.columns), real.positive),
        "back": area(fits[1].log_odds(own.columns), own.positive),
    }


def lines_of(rows: Sequence[dict[str, Any]], goal: str) -> str:
    """Means over seeds and halves; in brackets those of both ends of a 95 % interval by vehicle."""
    found = [row for row in rows if row["goal"] == goal]

    def cell(each: Sequence[dict[str, Any]]) -> str:
        rate, low, high, seen, lead = (float(np.nanmean([row[key] for row in each]))
                                       for key in ("rate", "low", "high", "seen", "lead"))  # fmt: skip
        return f"{rate:.0f} ({low:.0f}-{high:.0f}), {100.0 * seen:.0f}%, {lead:.2f} s"

    return _table(found, cell)


def run_lines(rows: Sequence[dict[str, Any]]) -> str:
    """False alarms an hour on runs without cut-ins at `GOALS[0]`: means, and the least and most of a run's means."""

    def cell(each: Sequence[dict[str, Any]]) -> str:
        runs = np.mean([row["runs"] for row in each], axis=0)
        return f"{runs.mean():.0f} ({runs.min():.0f}-{runs.max():.0f})"

    return _table([row for row in rows if row["goal"] == GOALS[0]], cell)


def told_lines(rows: Sequence[dict[str, Any]]) -> str:
    """The shortcut test from one kind of traffic to another."""
    lines = ["| learnt on | tried on held-out real vehicles | learnt there, tried on it |", "|---" * 3 + "|"]
    for home in dict.fromkeys(row["home"] for row in rows if row["goal"] == "AUC"):
        each = [row for row in rows if (row["goal"], row["home"]) == ("AUC", home)]
        there, back = ([row[key] for row in each] for key in ("there", "back"))
        lines.append(f"| {home} | {_spread(there)} | {_spread(back)} |")
    return "\n".join(lines)


def _spread(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def _table(found: Sequence[dict[str, Any]], cell: Callable[[Sequence[dict[str, Any]]], str]) -> str:
    homes = list(dict.fromkeys(row["home"] for row in found))
    names = [
        name for name in (*(rule.title() for rule in RULES), *LEARNERS) if any(row["detector"] == name for row in found)
    ]
    lines = ["| detector | " + " | ".join(homes) + " |"]
    lines.append("|---" * (1 + len(homes)) + "|")
    for name in names:
        each = [[row for row in found if (row["detector"], row["home"]) == (name, home)] for home in homes]
        lines.append(f"| {name} | " + " | ".join(cell(one) if one else "-" for one in each) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--openacc", type=Path, nargs="+", default=[], metavar="FILE")
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2, 3, 4])
    parser.add_argument("--halves", type=int, nargs="*", default=[0, 1])
    parser.add_argument("--homes", nargs="+", choices=(*HOMES, "unsmoothed"), default=HOMES)
    parser.add_argument("--learners", nargs="*", choices=LEARNERS, default=LEARNERS)
    parser.add_argument("--results", type=Path, default=Path("transfer.jsonl"))
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    runs = [views_without_observers([scene]) for path in args.openacc for scene in run_scenes(path)]
    for seed in args.seeds:
        for half in args.halves:
            for row in results(args.wheel, half, seed, args.homes, args.learners, runs):
                with args.results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    rows = [json.loads(line) for line in args.results.read_text(encoding="utf-8").splitlines()]
    rows.sort(key=lambda row: [*HOMES[:2], "unsmoothed", *HOMES[2:]].index(row["home"]))
    done = sorted({(row["half"], row["seed"]) for row in rows})
    print(f"{len(done)} of home half and seed: {done}")
    print(lines_of(rows, "95%"))
    for goal, marker in (("20/h", "rate"), ("90% 1s", "early")):
        show(lines_of(rows, goal), args.write, f"transfer-{marker}")
    print(told_lines(rows))
    if any(row.get("runs") for row in rows):
        show(run_lines(rows), args.write, "transfer-runs")


if __name__ == "__main__":
    main()
