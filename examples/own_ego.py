"""A written output under an ego of your own, in esmini: it cruises, brakes after ten seconds, and drives on.

ESMINI_LIBRARY=libesminiLib.so python examples/own_ego.py [OUT]
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

import xosc_lateral as xl

STEP = 0.01  # [s]


class State(ctypes.Structure):
    """What esmini 3 tells of an object; `lane_offset` counts along the road's t-axis. [m], [rad], [m/s]"""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("id", "model", "control")),
        ("timestamp", ctypes.c_double),
        *((name, ctypes.c_double) for name in ("x", "y", "z", "h", "p", "r")),
        *((name, ctypes.c_int) for name in ("road", "junction")),
        ("t", ctypes.c_double),
        ("lane", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("lane_offset", "s", "speed")),
        ("rest", ctypes.c_char * 256),
    )


def main(folder: Path) -> None:
    scenario = xl.write_template("cut-in", folder, force=True)[0]
    output = xl.convert(scenario, folder / "under_test.xosc", ego="Ego", player="esmini", seed=1, force=True).output
    print(f"written: {output}")
    path = os.environ.get("ESMINI_LIBRARY")
    if path is None:
        print("ESMINI_LIBRARY names no library: nothing is played")
        return
    esmini = ctypes.CDLL(path)
    esmini.SE_SetLogFilePath(str(folder / "esmini.txt").encode())
    esmini.SE_StepDT.argtypes = [ctypes.c_double]
    esmini.SE_ReportObjectSpeed.argtypes = [ctypes.c_int, ctypes.c_double]
    esmini.SE_ReportObjectRoadPos.argtypes = [*[ctypes.c_int] * 3, *[ctypes.c_double] * 2]
    if esmini.SE_Init(str(output).encode(), 0, 0, 0, 0) != 0:  # a reset: SE_Close, then this again
        raise SystemExit(f"esmini can't play {output}: its log says why")
    ego, other = (esmini.SE_GetIdByName(name) for name in (b"Ego", b"CutIn"))
    mine, theirs = State(), State()
    esmini.SE_GetObjectState(ego, ctypes.byref(mine))
    s, speed = mine.s, mine.speed  # the state of your ego, which your system steers from here on
    for step in range(2000):
        speed = max(speed - 4.0 * STEP, 15.0) if step * STEP > 10.0 else speed  # here your system decides
        s += speed * STEP
        esmini.SE_ReportObjectRoadPos(ego, mine.road, mine.lane, 0.0, s)
        esmini.SE_ReportObjectSpeed(ego, speed)
        esmini.SE_StepDT(STEP)
        if step % 400 == 399:
            esmini.SE_GetObjectState(other, ctypes.byref(theirs))
            lane = f"lane {theirs.lane}, {theirs.lane_offset:+.2f} m from its middle"
            print(f"{(step + 1) * STEP:4.1f} s: ego {speed:.1f} m/s; CutIn {theirs.s - s:+.1f} m ahead, {lane}")
    esmini.SE_Close()


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/own_ego")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
