"""Are vehicles that react told apart from the same drivers' replays, by how they move within their lanes?

    python -m laboratory.told_apart [--seeds 100 8] [--speed 30] [--library libesminiLib.so]

Six cars drive on a straight motorway for 60 s behind, beside and before a vehicle under test, which none of them comes
near to. The same seeds are converted twice: as replays, and so that the cars react. Both are played, and cut into
windows of 5 s from 6 s on, when nobody is still led to where he drives. Stated in `docs/design/offset_chains.md`:

- AUC of a logistic regression and of boosted trees, on seeds that they have not seen: 0.5 by chance, 1 always.
- spectrum of the lateral speed by bands, over that of the replays; rms of lateral acceleration; the longest time
  within 60 s in which a car moves sideways by less than 1 mm.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.find import player
from tests.kit.made import reactive
from tests.kit.made.roads import Map, plan_view, road
from xosc_lateral.workflows.conversion.load import play_scenario

FloatArray = NDArray[np.float64]

STEP, WINDOW, BEGIN, SECONDS = 0.1, 5.0, 6.0, 60.0
"""Of samples, of windows, where they begin, and of runs. [s]"""
BANDS = (0.15, 0.45, 0.8, 1.5, 3.0, 5.0)
"""Edges in which spectra are compared. [Hz]"""
STILL = 0.001
"""A car that moves less sideways rests. [m]"""
CARS = 6


def scenario(folder: Path, speed: float) -> Path:
    """Cars that would brake if the vehicle under test came within 1 m of them."""
    view, length, _ = plan_view([("line", 5000.0, 0.0, 0.0)], (0.0, 0.0, 0.0))
    made = Map([road("1", view, length, 3)], 3, False, length)
    cars = [("Ego", -2, 100.0, speed)]
    cars += [(f"T{k}", -1 - k % 3, 160.0 + 80.0 * k, speed) for k in range(CARS)]
    near = (reactive._distance("Ego", name, 1.0, "lessThan") for name, *_ in cars[1:])
    groups = [
        reactive._group(name, reactive._event(f"brake {name}", trigger, reactive._speed(10.0, 3.0)))
        for (name, *_), trigger in zip(cars[1:], near, strict=True)
    ]
    text = reactive._scenario(cars, groups, reactive._time(SECONDS))
    name = text.split('LogicFile filepath="')[1].split('"')[0]
    (folder / name).write_text(made.xml())
    path = folder / "free.xosc"
    path.write_text(text)
    return path


def offsets(path: Path, speed: float, library: Path | None) -> FloatArray:
    """Of each car every `STEP`, shape (cars, n). [m]"""
    moments = np.arange(0.0, SECONDS - STEP, STEP)
    if library is None:
        entities = play_scenario(path).motion.entities
        tracks = [(one.time, one.offset) for one in entities if one.name != "Ego"]
    else:
        way = player.ego_path(player.apart(player.run, str(library), path, SECONDS), speed)
        rows = player.apart(player.run, str(library), path, SECONDS, "1.0", way)["rows"]
        tracks = [(one[:, 0], one[:, 7]) for name, one in sorted(rows.items()) if name != "Ego"]
    return np.array([np.interp(moments, time, offset) for time, offset in tracks])


def windows(paths: FloatArray) -> FloatArray:
    """Shape (n, samples)."""
    rows = round(WINDOW / STEP)
    starts = range(round(BEGIN / STEP), paths.shape[1] - rows, rows)
    return np.concatenate([paths[:, start : start + rows] for start in starts])


def features(cut: FloatArray, speed: float) -> FloatArray:
    """Sizes and largest values of lateral speed, acceleration, jerk and yaw rate, and the spectrum, shape (n, k)."""
    columns, values = list[FloatArray](), cut
    for _ in range(3):
        values = np.diff(values, axis=1) / STEP
        columns += [np.log(values.std(axis=1) + 1e-9), np.log(np.abs(values).max(axis=1) + 1e-9)]
        columns.append((values[:, 1:] * values[:, :-1]).mean(axis=1) / ((values**2).mean(axis=1) + 1e-15))
    yaw = np.diff(np.arctan2(np.diff(cut, axis=1), speed * STEP), axis=1) / STEP
    columns += [np.log(yaw.std(axis=1) + 1e-9), np.log(np.abs(yaw).max(axis=1) + 1e-9)]
    power = spectrum(cut)[1]
    width = 4
    columns += [np.log(power[:, k : k + width].mean(axis=1) + 1e-12) for k in range(1, power.shape[1] - width, width)]
    return np.column_stack(columns)


def spectrum(cut: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz], and power of the lateral speed, shape (n, frequencies)."""
    speed = np.diff(cut, axis=1) / STEP
    taper = np.hanning(speed.shape[1])
    power = np.abs(np.fft.rfft((speed - speed.mean(axis=1, keepdims=True)) * taper)) ** 2
    return np.fft.rfftfreq(speed.shape[1], STEP), power


def apart(kinds: Sequence[FloatArray], seeds: FloatArray, speed: float) -> dict[str, float]:
    """Area under the ROC curve of either classifier, on seeds that it has not seen."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.linear_model import LogisticRegression
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import GroupKFold, cross_val_predict
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    shown = np.concatenate([features(cut, speed) for cut in kinds])
    truth, groups = np.repeat((0, 1), [len(cut) for cut in kinds]), np.concatenate((seeds, seeds))
    models = {
        "logistic": make_pipeline(StandardScaler(), LogisticRegression(max_iter=2000, C=0.1)),
        "trees": HistGradientBoostingClassifier(max_iter=100, random_state=0),
    }
    folds = GroupKFold(min(5, len(np.unique(groups))))
    scores = {
        name: cross_val_predict(model, shown, truth, cv=folds, groups=groups, method="predict_proba")[:, 1]
        for name, model in models.items()
    }
    return {name: float(roc_auc_score(truth, score)) for name, score in scores.items()}


def longest_rest(paths: FloatArray) -> float:
    """Of all cars. [s]"""
    longest = 0
    for path in paths:
        first = 0
        for k in range(len(path)):
            while np.abs(path[k] - path[first]) > STILL:
                first += 1
            longest = max(longest, k - first)
    return STEP * longest


def measure(first: int, count: int, speed: float, library: Path | None) -> dict[str, object]:
    """All of it."""
    kinds: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    with tempfile.TemporaryDirectory() as folder:
        source = scenario(Path(folder), speed)
        for seed in range(first, first + count):
            for paths, ego in zip(kinds, (["none"], ["Ego"]), strict=True):
                output = Path(folder) / f"{ego[0]}.xosc"
                xl.convert(source, output, ego=ego if ego == ["Ego"] else "none", seed=seed, force=True)
                paths.append(offsets(output, speed, library))
    cuts = [np.concatenate([windows(one) for one in paths]) for paths in kinds]
    seeds = np.repeat(np.arange(count), len(cuts[0]) // count)
    (frequency, replay), (_, reacting) = (spectrum(cut) for cut in cuts)
    bands = [(frequency >= low) & (frequency < high) for low, high in pairwise(BANDS)]
    ratios = [float(reacting[:, band].sum() / replay[:, band].sum()) for band in bands]
    acceleration = [float(np.sqrt(np.mean(np.diff(cut, 2, axis=1) ** 2))) / STEP**2 for cut in cuts]
    return {
        "windows": len(cuts[0]),
        "auc": apart(cuts, seeds, speed),
        "spectrum": dict(zip((f"{a}-{b} Hz" for a, b in pairwise(BANDS)), ratios, strict=True)),
        "acceleration_m_s2": acceleration,
        "longest_rest_s": [longest_rest(np.concatenate(paths)) for paths in kinds],
    }


def main() -> None:
    """Print it as JSON: replays first where there are two numbers."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--seeds", type=int, nargs=2, default=(100, 8), metavar=("FIRST", "COUNT"))
    words.add_argument("--speed", type=float, default=30.0, help="[m/s]")
    words.add_argument("--library", type=Path)
    chosen = words.parse_args()
    print(json.dumps(measure(*chosen.seeds, chosen.speed, chosen.library), indent=1))


if __name__ == "__main__":
    main()
