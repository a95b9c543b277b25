"""Is the same driver at the same place alike? Laps of a closed road, and what a field per driver would predict.

    python -m laboratory.same_place ASta_040719_platoon3.csv.gz ASta_050719_platoon1.csv.gz

Each lap less its mean, as far as the lane centre (mean path of all laps) goes: two laps of unlike drivers correlate by
minus one over their number by that alone. A held-out lap is predicted by the smoothed mean of the driver's other laps,
shrunk by what they predict of each other.
"""

from __future__ import annotations

import argparse
from collections import Counter
from itertools import combinations, product
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from xosc_lateral.extras.recordings.importers import openacc
from xosc_lateral.extras.recordings.importers.openacc import GRID_STEP

ROW_DISTANCE = 5.0  # [m]
SMOOTHING_SCALES = (0.0, 20.0, 60.0, 150.0)  # of the Gaussian along the road; 60 for the field [m]


def laps(files: list[Path]) -> list[list[np.ndarray]]:
    """Offsets along the road every `ROW_DISTANCE`, less their mean: a list of whole laps for each driver. [m]"""
    cars = [car for path in files for car in openacc._cars(path, Counter(), [])]
    loop, found = openacc._centre_line(cars), []
    for car in cars:
        index, offset = loop.place(car.x, car.y)
        lap = np.cumsum(np.diff(index, prepend=index[0]) < -0.5 * len(loop.points))
        grid = np.arange(10.0, len(loop.points) - 10.0, ROW_DISTANCE / GRID_STEP)
        whole = [lap == k for k in range(lap.max() + 1) if np.ptp(index[lap == k]) > len(loop.points) - 20.0]
        rows = [np.interp(grid, index[part], offset[part]) for part in whole]
        found.append([row - row.mean() for row in rows])
    return found


def explained(drivers: list[list[np.ndarray]], scale: float) -> float:
    """Mean share of a held-out lap's variance that the driver's other laps predict. [-]"""
    shares = []
    for own in drivers:
        for k, lap in enumerate(own):
            rest = own[:k] + own[k + 1 :]
            pairs = [(np.mean(rest[:j] + rest[j + 1 :], axis=0), each) for j, each in enumerate(rest)]
            pairs = [(gaussian_filter1d(field, scale / ROW_DISTANCE), each) for field, each in pairs]
            weight = sum(field @ each for field, each in pairs) / sum(field @ field for field, _ in pairs)
            field = max(weight, 0.0) * gaussian_filter1d(np.mean(rest, axis=0), scale / ROW_DISTANCE)
            shares.append(1.0 - np.var(lap - field) / np.var(lap))
    return float(np.mean(shares))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", help="of OpenACC's AstaZero campaign")
    drivers = [own for own in laps(parser.parse_args().files) if len(own) > 2]
    print(f"laps by driver: {[len(own) for own in drivers]}")
    for scale in SMOOTHING_SCALES:
        smooth = [[gaussian_filter1d(lap, scale / ROW_DISTANCE) if scale else lap for lap in own] for own in drivers]
        same = [np.corrcoef(a, b)[0, 1] for own in smooth for a, b in combinations(own, 2)]
        other = [np.corrcoef(a, b)[0, 1] for one, two in combinations(smooth, 2) for a, b in product(one, two)]
        words = [f"{np.mean(each):.3f} +- {np.std(each) / len(each) ** 0.5:.3f}" for each in (same, other)]
        print(f"smoothed over {scale:.0f} m: correlation of laps of one driver {words[0]}, of two {words[1]}")
    print(f"a held-out lap's variance that a field of 60 m explains: {explained(drivers, 60.0):.1%}")


if __name__ == "__main__":
    main()
