"""A driver as an FMU in C, simulated with fmpy: a C compiler, and fmpy.

python examples/live_fmu.py [OUT]
"""

from __future__ import annotations

import sys
from pathlib import Path

import xosc_lateral as xl


def main(folder: Path) -> None:
    unit = folder / "driver.fmu"
    try:
        import fmpy
    except ImportError as error:
        print(f"nothing is simulated: {error}")
        return
    if not xl.export_fmu(xl.read_profile("motorway-vehicle-1"), unit):
        print(f"{unit}: source alone, for there is no C compiler here")
        return
    run = fmpy.simulate_fmu(str(unit), stop_time=10.0, step_size=0.05, start_values={"seed": 1}, output=["offset"])
    print(f"{unit}: {len(run)} rows")
    print(f"offset after 10 s: {run['offset'][-1]:+.3f} m")


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/live")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
