"""Draw the picture of the README: nominal beside enriched paths of the cut-in template. `make picture` runs it."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import xosc_lateral as xl


def main(target: Path) -> None:
    """Convert the template and draw its paths, stretched across the road."""
    with tempfile.TemporaryDirectory() as folder:
        scenario, _road = xl.write_template("cut-in", folder, duration=30)
        figure = xl.convert(scenario, seed=4).plot()
    assert figure is not None, "the template has a road"
    figure.suptitle("A cut-in: dashed as the maneuvers say, coloured as people drive", x=0.01, ha="left", fontsize=11)
    figure.savefig(target, dpi=110, facecolor="white", metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".png"))
