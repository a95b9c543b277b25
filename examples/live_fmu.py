"""A driver as an FMU, simulated with fmpy: the extra `fmu`, and fmpy.

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

        xl.export_fmu(xl.read_profile("motorway-vehicle-3"), unit)
    except (ImportError, xl.SimulationError) as error:
        (folder / "missing.txt").write_text(str(error), encoding="utf-8")
        print(f"nothing is simulated:\n{error}")
        return
    found = fmpy.simulate_fmu(str(unit), stop_time=10.0, step_size=0.05, start_values={"seed": 1}, output=["offset"])
    print(f"{unit}: {len(found)} rows")
    print(f"offset after 10 s: {found['offset'][-1]:+.3f} m")


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/live")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
