"""One cut-in, many ways: settings of a template times seeds, in one table.

python examples/vary_scenario.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

import xosc_lateral as xl


def main(out: Path) -> None:
    """Convert every combination and show how the smallest gap of two cars varies; no scenario is kept."""
    print("lane width [m]  seed  gap nominal [m]  gap lifelike [m]")
    for width, seed in product((3.25, 3.75), (1, 2, 3)):
        scenario, _road = xl.write_template("cut-in", out / f"cut-in_{width}m", lane_width=width)
        before, after = xl.convert(scenario, seed=seed).smallest_gap
        print(f"{width:>14}  {seed:>4}  {before:>15.2f}  {after:>16.2f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
