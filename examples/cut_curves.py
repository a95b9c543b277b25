"""An effect of your own: a driver who cuts curves, in a scenario with curves.

    python examples/cut_curves.py [OUTPUT FOLDER]

An effect that `close-loop` finds on measured drives goes the same way.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from xosc_lateral.driver.effects import Acts, Linear
from xosc_lateral.enrich.enrich import enrich
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.profiles import read_profile, write_profile
from xosc_lateral.pipeline.load import play_scenario
from xosc_lateral.templates import find_template

RADIUS = 700.0  # of the bends [m]
TO_THE_INSIDE = 0.3  # in such a bend [m]
LOOK_AHEAD = 1.2  # [s]


def main(out: Path) -> None:
    """Give a shipped profile the effect, drive through bends, measure what came out."""
    out.mkdir(parents=True, exist_ok=True)
    effect = Linear(
        column="curvature",
        acts=Acts.LOCATION,
        coefficients=(TO_THE_INSIDE * RADIUS,),  # left bends have positive curvature, and their inside is on the left
        errors=(0.0,),
        reference=(0.0,),
        lag_s=-LOOK_AHEAD,
    )
    calm = read_profile("motorway-car")
    cutter = replace(calm, name="curve-cutter", effects=(*calm.effects, effect))
    write_profile(cutter, out / "curve-cutter.json")

    for name, text in find_template("curves").files({"radius": f"{RADIUS:g}"}).items():
        write_atomically(out / name, text)
    played = play_scenario(out / "curves.xosc")
    offsets = []
    for seed in range(40):  # one drive is mostly chance
        ego = enrich(played.motion, played.network, {"Ego": cutter}, seed=seed).entity("Ego")
        offsets.append(ego.deviation)
    mean = np.mean(offsets, axis=0)

    motion = ego.motion
    ahead = motion.s + LOOK_AHEAD * motion.speed
    curvature = played.network.lane_curvature(motion.road, motion.lane, ahead)
    left, right = (mean[np.abs(curvature * RADIUS - bend) < 0.05].mean() for bend in (1.0, -1.0))
    print(f"mean offset in left bends {left:+.2f} m, in right bends {right:+.2f} m")
    print(f"so to the inside {(left - right) / 2:.2f} m; the profile says {TO_THE_INSIDE:.2f} m")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
