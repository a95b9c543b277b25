"""One cut-in, many ways: settings of a template times seeds, in one table.

python examples/vary_scenario.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.pipeline.convert import convert_scenario
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.templates import find_template


def main(out: Path) -> None:
    """Convert every combination and show how the smallest gap of the two cars varies."""
    print("lane width [m]  seed  gap nominal [m]  gap lifelike [m]")
    for width, seed in product(("3.25", "3.75"), (1, 2, 3)):
        folder = out / f"cut-in_{width}m"
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in find_template("cut-in").files({"lane_width": width}).items():
            write_atomically(folder / name, text)
        result = convert_scenario(
            folder / "cut-in.xosc", folder / f"cut-in_{seed}.xosc", ConvertSettings(seed=seed)
        ).enriched
        gaps = [
            {gap.names: gap.distance for gap in side}[("Ego", "CutIn")]
            for side in (result.gaps_before, result.gaps_after)
        ]
        print(f"{width:>14}  {seed:>4}  {gaps[0]:>15.2f}  {gaps[1]:>16.2f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
