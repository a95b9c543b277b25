"""Build the shipped driver profiles from the public recordings: what `make profiles` runs.

python -m laboratory.build_library tasi-0.15.4-py3-none-any.whl --gnss ASta_040719_platoon3.csv.gz \\
    --gnss ASta_050719_platoon1.csv.gz -o FOLDER [--keep-refined]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from laboratory.library import build_library
from laboratory.refined import NAME as REFINED
from xosc_lateral.files.profiles import read_profile, write_profile


def main(argv: Sequence[str] | None = None) -> None:
    """Build the library and write it."""
    parser = argparse.ArgumentParser(description="Build the shipped driver profiles from the public recordings.")
    parser.add_argument("source", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--model", default="best")
    parser.add_argument(
        "--gnss", type=Path, action="append", required=True, metavar="FILE", help="of OpenACC's AstaZero campaign"
    )
    parser.add_argument(
        "--keep-refined", action="store_true", help="leave what the closed loop made as it is in FOLDER"
    )
    args = parser.parse_args(argv)
    kept = read_profile(args.output / f"{REFINED}.json") if args.keep_refined else None
    profiles = build_library(args.source, args.gnss, model=args.model, kept=kept)
    for profile in profiles:
        write_profile(profile, args.output / f"{profile.name}.json")


if __name__ == "__main__":
    main()
