"""Write scenarios for the purpose: valid, varied, one per seed.

    python -m tests.kit.made FOLDER --seeds FIRST COUNT

`laboratory/agreement.py FOLDER --esmini PATH` then compares. The seeds from 0 on are those that things are mended
with; figures in docs/playing.md are of seeds that nobody had looked at.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from tests.kit.made.scenario import made


def main() -> None:
    """Write them, each in a folder of its own."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 100), metavar=("FIRST", "COUNT"))
    options = parser.parse_args()
    first, count = options.seeds
    for seed in range(first, first + count):
        title, road, scenario = made(seed)
        folder = options.folder / f"{seed:05d}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "road.xodr").write_text(road, encoding="utf-8")
        (folder / f"{title.replace(' ', '_')}.xosc").write_text(scenario, encoding="utf-8")


if __name__ == "__main__":
    main()
