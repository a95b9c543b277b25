"""A maneuver-based scenario in, a lifelike one out: the result as arrays, and as a page.

python examples/convert_scenario.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import xosc_lateral as xl


def main(out: Path) -> None:
    """Write a template, convert it, say what changed."""
    scenario, _road = xl.write_template("overtake-truck", out, ego_speed=35)

    result = xl.convert(scenario, out / "overtake-truck_lifelike.xosc", seed=7)

    print(repr(result))
    frame = result.to_frame()  # one row per entity and step
    for name, rows in frame.groupby("name", sort=False):
        spread, largest = rows["deviation"].std(), rows["deviation"].abs().max()
        print(f"{name:9} offsets +-{spread:.2f} m, at most {largest:.2f} m")
    before, after = result.smallest_gap
    print(f"smallest gap of two cars: {before:.2f} m -> {after:.2f} m")
    page = result.write_report(out / "overtake-truck_report.html")
    print(f"written: {result.output} and {page}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
