"""A driver who cuts curves: found in a drive, added to the profile, scored on stretches held out.

python examples/close_the_loop.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from xosc_lateral.formats.drives import read_drives
from xosc_lateral.formats.profiles import write_profile
from xosc_lateral.loop.close import close_loop
from xosc_lateral.report.loop import loop_text


def main(out: Path) -> None:
    """Plant an effect in a simulated drive, let the loop find it, keep the refined profile."""
    out.mkdir(parents=True, exist_ok=True)
    result = close_loop(read_drives(simulated(out / "curve_cutter.parquet")), seed=1, name="curve-cutter")
    print(loop_text(result))
    write_profile(result.refined, out / "curve-cutter.json")


def simulated(path: Path) -> Path:
    """Forty minutes of a driver who aims up to 0.3 m to the inside of curves, 1.2 s ahead of them."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the simulator lies beside the tests
    from tests.simulators import CurveCutting, simulate_drive

    simulate_drive(2400.0, seed=11, effects=[CurveCutting(0.3, look_ahead=1.2)]).table.to_parquet(path)
    return path


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
