"""A driver who cuts curves: found in a drive, added to the profile, scored on stretches held out.

python examples/close_the_loop.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from driver_simulator import curve_cutting, simulate_drive

import xosc_lateral as xl


def main(out: Path) -> None:
    """Plant an effect in a simulated drive, let the loop find it, keep the refined profile."""
    out.mkdir(parents=True, exist_ok=True)
    # Forty minutes of somebody who aims to the inside of curves, 1.2 s ahead: 0.15 m in sharp ones.
    drive = simulate_drive(2400.0, seed=11, effects=[curve_cutting(0.3, look_ahead=1.2)])

    result = xl.close_loop(drive.table, seed=1, name="curve-cutter")

    print(result)
    print(result.to_frame()[["effect", "size_m", "lag_s", "p_value"]].to_string(index=False))
    xl.write_profile(result.profile, out / "curve-cutter.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
