"""Build the shipped driver profiles from the public recordings: what `make profiles` runs.

python -m laboratory.build_library tasi-0.15.4-py3-none-any.whl --gnss ASta_040719_platoon3.csv.gz \\
    --gnss ASta_050719_platoon1.csv.gz -o FOLDER
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from laboratory.library import build_library
from xosc_lateral.files.profiles import write_profile


def main(argv: Sequence[str] | None = None) -> None:
    """Build the library and write it."""
    parser = argparse.ArgumentParser(description="Build the shipped driver profiles from the public recordings.")
    parser.add_argument("source", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--model", default="best")
    parser.add_argument(
        "--gnss", type=Path, action="append", required=True, metavar="FILE", help="of OpenACC's AstaZero campaign"
    )
    args = parser.parse_args(argv)
    profiles = build_library(args.source, args.gnss, model=args.model)
    for profile in profiles:
        write_profile(profile, args.output / f"{profile.name}.json")


if __name__ == "__main__":
    main()
