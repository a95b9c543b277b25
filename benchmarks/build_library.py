"""Build the shipped driver profiles from the public recording: what `make profiles` runs.

python -m benchmarks.build_library tasi-0.15.4-py3-none-any.whl -o FOLDER [--cards docs/profiles.md] [--keep-refined]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.evaluation.movement_summary import summary_of
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.profiles import read_profile, write_profile
from xosc_lateral.pipeline.library import build_library
from xosc_lateral.pipeline.refined import NAME
from xosc_lateral.report.cards import amount, provenance_items, spread_text

PAGE = """# The profile library

`xosc-lateral profiles list` names the shipped profiles, `profiles show NAME` prints a card, `profiles compare A B` compares two. This page and the profiles
are written by `make profiles` from a public recording, byte for byte the same every time (`motorway-refined` by `make refined`). How the data was read and
what may be shipped: [real data](real_data.md).

Which one to take? `motorway` draws a new driver of that road for every vehicle. It contains what vehicle class (`is_truck`), lane and speed do to mean and
spread, so one profile serves trucks, cars and all lanes, and how far drivers keep from vehicles beside them. Where these columns are missing, class, lane and
speed are at their means and nobody is beside. Take a single vehicle where it has to be the same driver every time. Profiles contain the sensor error of the
recording (`--with sensor`), except `motorway-refined`, which is the result of [closing the loop](closing_the_loop.md) from a two-level model and is meant
for scenarios whose context has the columns that it reacts to.
"""


def library_page(profiles: Sequence[DriverProfile]) -> str:
    """Markdown page of the library: which profile is for what, and a row of each."""
    rows = ["| profile | fitted on | mean offset | spread | lateral speed, rms |", "|---|---|---|---|---|"]
    notes = []
    for profile in profiles:
        summary = summary_of(profile)
        side = "left" if summary.mean_offset > 0 else "right"
        rows.append(
            f"| `{profile.name}` | {amount(profile)} | {abs(summary.mean_offset):.2f} m to the {side} "
            f"| {spread_text(profile, summary)} | {summary.lateral_speed:.3f} m/s |"
        )
        items = [f"{name}: {value}" for name, value in provenance_items(profile.provenance)]
        notes.append(f"- `{profile.name}`: {'; '.join([profile.provenance.notes.rstrip('.'), *items])}")
    return "\n".join([PAGE, *rows, "", *notes, ""])


def main(argv: Sequence[str] | None = None) -> None:
    """Build the library and write it, with its cards."""
    parser = argparse.ArgumentParser(description="Build the shipped driver profiles from the public recording.")
    parser.add_argument("source", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--cards", type=Path, metavar="PAGE.md")
    parser.add_argument("--model", default="best")
    parser.add_argument(
        "--keep-refined", action="store_true", help="leave what the closed loop made as it is in FOLDER"
    )
    args = parser.parse_args(argv)
    profiles = build_library(args.source, model=args.model, refine=not args.keep_refined)
    for profile in profiles:
        write_profile(profile, args.output / f"{profile.name}.json")
    if args.keep_refined:
        profiles.insert(1, read_profile(args.output / f"{NAME}.json"))
    if args.cards is not None:
        write_atomically(args.cards, library_page(profiles))


if __name__ == "__main__":
    main()
