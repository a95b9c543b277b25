"""How well a forest tells lane changes of the cut-in template from real ones, as written and as drivers take them.

    python -m laboratory.cut_in_shape tasi-0.15.4-py3-none-any.whl [--sets 45]

Four seconds around half-way, of changes to the right: durations drawn from the law, everything through the recording's
0.13 Hz; five folds, AUC. The floor is two halves of the real ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import StratifiedKFold, cross_val_predict

import xosc_lateral as xl
from xosc_lateral.extras.detect.tracks import in_lanes
from xosc_lateral.extras.recordings.lane_order import RoadLanes
from xosc_lateral.extras.recordings.reconstruct import changes_of
from xosc_lateral.extras.recordings.recorded import own_lateral, place_tracks
from xosc_lateral.extras.recordings.recordings import read_recording
from xosc_lateral.workflows.batch.request import Request, concrete, document_kind
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.motion.nominal import EntityMotion

FloatArray = NDArray[np.float64]

STEP, HALF, CUTOFF = 0.2, 2.0, 0.13
"""Of rows [s], of the window to either side [s], of the recording [Hz]."""


def window(vehicle: EntityMotion, crossing: int) -> FloatArray | None:
    """Place from the middle of the new lane, and speed, around half-way; None: the track ends within it."""
    time = np.arange(float(vehicle.time[0]), float(vehicle.time[-1]), STEP)
    aside, base, _ = own_lateral(vehicle)
    smooth = sosfiltfilt(butter(2, CUTOFF, fs=1.0 / STEP, output="sos"), np.interp(time, vehicle.time, aside))
    middle = int(np.searchsorted(time, float(vehicle.time[crossing])))
    rows = np.arange(middle - round(HALF / STEP), middle + round(HALF / STEP) + 1)
    if rows[0] < 0 or rows[-1] >= len(time):
        return None
    place = smooth[rows] - base[crossing]
    return np.concatenate((place, np.diff(place) / STEP))


def played(sets: int, lane_changes: str) -> Iterator[FloatArray]:
    """Cut-ins of the template with durations of the law, a drive for each."""
    with TemporaryDirectory() as folder:
        scenario, _ = xl.write_template("cut-in", folder)
        made = xl.vary(scenario, f"{folder}/varied/", like="motorway", count=sets, replace=True)
        request = Request(made.distribution, ConvertSettings())
        for number, (source, _, settings, _) in enumerate(concrete(request, document_kind(made.distribution))):
            output = Path(folder) / "varied" / "out.xosc"
            xl.convert(source, output, parameters=settings.parameters, variant=number + 1, lane_changes=lane_changes,
                       allow=[folder])  # fmt: skip
            run = play_scenario(output, parameters=settings.parameters, allowed=[Path(folder)])
            car = next(one for one in run.motion.entities if one.name == "CutIn")
            car = in_lanes(car, RoadLanes(run.network))
            found = window(car, int(np.argmax(np.diff(car.lane) != 0)) + 1)
            if found is not None:
                yield found


def area(first: FloatArray, second: FloatArray) -> float:
    """Of a forest, out of fold, mean of five seeds."""
    x, y = np.concatenate((first, second)), np.repeat((0, 1), (len(first), len(second)))
    scores = []
    for seed in range(5):
        forest = RandomForestClassifier(200, min_samples_leaf=3, class_weight="balanced", random_state=seed)
        folds = StratifiedKFold(5, shuffle=True, random_state=seed)
        scores.append(roc_auc_score(y, cross_val_predict(forest, x, y, cv=folds, method="predict_proba")[:, 1]))
    return float(np.mean(scores))


def main() -> None:
    """Print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--sets", type=int, default=45)
    args = parser.parse_args()
    kinds = {name: np.array(list(played(args.sets, name))) for name in ("written", "lifelike")}
    traffic = read_recording(args.wheel)
    vehicles = place_tracks(traffic.tracks, traffic.network, *traffic.span).vehicles
    found = changes_of(vehicles, vehicles, RoadLanes(traffic.network))
    pairs = [
        (one.motion, row, facts[-1]) for one in found for row, facts in zip(one.crossing, one.changes, strict=True)
    ]
    windows = [window(motion, row) for motion, row, left in pairs if not left]
    real = np.array([one for one in windows if one is not None])
    order = np.random.default_rng(0).permutation(len(real))
    print(f"{len(real)} real lane changes to the right")
    print(f"real from real: {area(*(real[part] for part in np.array_split(order, 2))):.2f}")
    half = round(HALF / STEP)
    peaks = np.abs(real[:, 2 * half + 1 :]).max(axis=1)
    print(f"real: at half-way {np.std(real[:, half]):.2f} m, peak {np.median(peaks):.2f} m/s")
    for name, made in kinds.items():
        peak = np.median(np.abs(made[:, 2 * half + 1 :]).max(1))
        print(
            f"{name}: {len(made)}, AUC {area(made, real):.2f}, at half-way {np.std(made[:, half]):.2f} m, "
            f"peak {peak:.2f} m/s"
        )


if __name__ == "__main__":
    main()
