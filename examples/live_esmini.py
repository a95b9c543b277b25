"""Drivers in esmini, beside your own ego: the library of esmini 3 that you have is named by ESMINI_LIBRARY.

ESMINI_LIBRARY=libesminiLib.so python examples/live_esmini.py [OUT]
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

import xosc_lateral as xl


def main(folder: Path) -> None:
    scenario = xl.write_template("cut-in", folder, force=True)[0]
    print(f"scenario: {scenario}")
    path = os.environ.get("ESMINI_LIBRARY")
    if path is None:
        print("ESMINI_LIBRARY names no library: nothing is played")
        return
    esmini = ctypes.CDLL(path)
    esmini.SE_StepDT.argtypes = [ctypes.c_double]
    assert esmini.SE_Init(str(scenario).encode(), 0, 0, 0, 0) == 0
    traffic = xl.EsminiTraffic(esmini, scenario, xl.read_profile("motorway"), ego="Ego", seed=1)
    for _ in range(1000):
        # your ego: SE_ReportObjectRoadPos, SE_ReportObjectSpeed
        traffic.steer(0.01)
        esmini.SE_StepDT(0.01)
        traffic.settle(0.01)
    for name, state in traffic.states().items():
        print(f"{name}: {traffic.offset_of(state):+.3f} m from the lane's centre")
    esmini.SE_Close()


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/live")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
