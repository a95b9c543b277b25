"""From a recording to a scenario: two cars on a motorway, one cuts in before the other, and the gap is varied.

python examples/reconstruct.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

import xosc_lateral as xl

GAPS = (30.0, 38.0, 46.0)  # [m]


def main(out: Path) -> None:
    """Make tracks, reconstruct them, and play the cut-in at other gaps than the recorded one."""
    out.mkdir(parents=True, exist_ok=True)
    _, road = xl.write_template("cut-in", out / "road")
    recording = out / "tracks.csv"
    recorded_on(road, out).to_csv(recording, index=False)
    made = xl.reconstruct(recording, out / "scenario", road=road, host="ego", relative=True)
    print(made)
    scenario = out / "scenario" / "tracks.xosc"
    for gap in GAPS:
        rows = xl.play(scenario, parameters={"other_change1_distance": gap}).to_frame()
        other = rows[rows["name"] == "other"]
        begin = other.loc[other["offset_t"].abs() > 0.05, "time"].min()
        print(f"cut-in at {gap:g} m: begins at {begin:.1f} s")


def recorded_on(road: Path, out: Path) -> pd.DataFrame:
    """A stand-in for a recording: x, y of both cars' middles at 25 Hz, with the sway of a driver."""
    scenario = road.with_suffix(".xosc")
    states = xl.play(scenario, step=0.04, parameters={"deceleration": 0.5}).to_frame()
    cars = []
    for name, entity in (("ego", "Ego"), ("other", "CutIn")):
        rows = states[states["name"] == entity]
        sway = 0.15 * np.sin(2 * np.pi * rows["time"] / 11) + 0.1 * np.sin(2 * np.pi * rows["time"] / 4.7 + len(name))
        ahead = 1.4  # [m] from the rear axle to the middle
        heading = rows["h"]
        x = rows["x"] + ahead * np.cos(heading) - sway * np.sin(heading)
        y = rows["y"] + ahead * np.sin(heading) + sway * np.cos(heading)
        cars.append(pd.DataFrame({"time": rows["time"], "id": name, "x": x, "y": y, "length": 4.8, "width": 1.9}))
    return pd.concat(cars)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
