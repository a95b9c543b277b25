"""An effect of your own: a driver who cuts curves, in a scenario with curves.

    python examples/cut_curves.py [OUTPUT FOLDER]

An effect that `close-loop` finds on measured drives goes the same way.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import xosc_lateral as xl
from xosc_lateral.drivers.model.effects import Acts, Linear

RADIUS = 700.0  # of the bends [m]
TO_THE_INSIDE = 0.3  # in such a bend [m]


def main(out: Path) -> None:
    """Give a shipped profile the effect, drive through bends, measure what came out."""
    effect = Linear(
        column="curvature",
        acts=Acts.LOCATION,
        coefficients=(TO_THE_INSIDE * RADIUS,),  # left bends have positive curvature, and their inside is on the left
        errors=(0.0,),
        reference=(0.0,),
    )
    cutter = xl.read_profile("motorway").with_effects(effect, name="curve-cutter")
    xl.write_profile(cutter, out / "curve-cutter.json")

    scenario, _road = xl.write_template("curves", out, radius=RADIUS)
    drives = [
        xl.convert(scenario, profile=cutter, only=["Ego"], ego="none", seed=seed).to_frame() for seed in range(20)
    ]
    ego = [drive[drive["name"] == "Ego"] for drive in drives]  # one drive is mostly chance: take the mean of many
    deviation = np.mean([rows["deviation"] for rows in ego], axis=0)

    x, y = ego[0]["x_nominal"].to_numpy(), ego[0]["y_nominal"].to_numpy()
    way, heading = np.hypot(np.gradient(x), np.gradient(y)), np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    bend = RADIUS * np.gradient(heading) / way  # 1 in left bends, -1 in right ones
    left, right = (deviation[np.abs(bend - sign) < 0.05].mean() for sign in (1.0, -1.0))
    print(f"mean offset in left bends {left:+.2f} m, in right bends {right:+.2f} m")
    print(f"so to the inside {(left - right) / 2:.2f} m; the profile says {TO_THE_INSIDE:.2f} m")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
