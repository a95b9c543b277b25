"""Build the shipped driver profiles from the public recording: no verb, but what `make profiles` runs.

python -m xosc_lateral.cli.build_library tasi-0.15.4-py3-none-any.whl -o FOLDER [--cards docs/profiles.md]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.profiles import write_profile
from xosc_lateral.pipeline.library import build_library
from xosc_lateral.report.cards import card_markdown

CARDS_HEAD = """# The profile library

`xosc-lateral profiles list` names them, `profiles show NAME` prints a card, `profiles compare A B` sets two side by
side. This page and the profiles are written by `make profiles` from the public wheel: the same bytes every time, on any
number of threads (another family of processors may change a ninth digit). How the data was read, and what may be
shipped: [real_data.md](real_data.md).

Which one? `motorway` draws a new driver of that road for every vehicle; take `motorway-car` and `motorway-truck`
where classes are known, a single vehicle where it has to be the same person every time. `motorway-refined` is the
closed loop's road to the same place. It starts from the two-level model, finds that it lacks memory, that drivers
differ, and that vehicles of less than 25 m/s (trucks) keep 0.2 m further right, and ends at a `best` profile with that
effect. It saw a little less than `motorway`, since the loop cuts 6 s around lane changes instead of 4. Held out, on the
same half of the vehicles and at their own speeds, both do as well: see the cards. Take `motorway-refined` where slow
and fast vehicles mix and their classes are not known, and `motorway` otherwise
([closing_the_loop.md](closing_the_loop.md), section 6).
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Build the library and write it, with its cards."""
    ask = argparse.ArgumentParser(description="Build the shipped driver profiles from the public recording.")
    ask.add_argument("source", type=Path)
    ask.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    ask.add_argument("--cards", type=Path, metavar="PAGE.md")
    ask.add_argument("--model", default="best")
    said = ask.parse_args(argv)
    profiles = build_library(said.source, model=said.model)
    for profile in profiles:
        write_profile(profile, said.output / f"{profile.name}.json")
    if said.cards is not None:
        write_atomically(said.cards, "\n".join([CARDS_HEAD, *map(card_markdown, profiles)]))


if __name__ == "__main__":
    main()
