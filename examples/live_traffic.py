"""Drivers inside your own simulation: told once per step what it knows, they say where their vehicles are.

python examples/live_traffic.py [OUT]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import xosc_lateral as xl

DT = 0.01


def main(folder: Path) -> None:
    traffic = xl.Traffic(xl.read_profile("motorway"), seed=1)
    names = ("car", "truck", "ego")
    speed, width = np.array([36.0, 24.0, 33.0]), np.full(3, 3.75)
    driven, is_truck = np.array([True, True, False]), np.array([False, True, False])
    offset, lines = np.zeros(3), ["time,name,offset"]
    for k in range(1001):
        changing = np.array([4.0 < k * DT < 8.0, False, False])  # your lane change moves the car then
        context = {"lane_index": np.array([1.0, 0.0, 0.0])}
        moment = xl.Moment(names, speed, width, offset, ~changing, driven, is_truck, context=context)
        moves = traffic.step(k * DT, moment)
        offset = moves.offset  # and rate, heading: put your vehicles there
        if k % 100 == 0:
            lines += [f"{k * DT:.1f},{name},{at:.4f}" for name, at in zip(names, offset, strict=True)]
    (folder / "offsets.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines[:7]))


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/live")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
