"""Lateral models of the field on measured drives: fitted on one half, scored on the other, ranked.

python -m laboratory.board DRIVES... -o FOLDER [--model NAME ...] [--profile NAME ...] [--seed 0] [--resamples 200]
    [--no-classify] [--map NAME=COLUMN ...]

Written are board.json (all numbers, as `laboratory.board_table` reads them) and board.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from laboratory.board.benchmark import benchmark_realism
from laboratory.board.models.catalogue import MODELS
from laboratory.board.record import board_record
from laboratory.board.text import board_markdown, board_text
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.mapping import parse_map
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.files.source import parsed_hashes


def main(argv: Sequence[str] | None = None) -> None:
    """Rank the models, print the board and write it."""
    parser = argparse.ArgumentParser(description="Rank lateral models of the field on measured drives.")
    parser.add_argument("drives", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--model", action="append", choices=list(MODELS), help="only these models")
    parser.add_argument("--profile", action="append", default=[], help="also score this profile, as it is")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resamples", type=int, default=200, help="of the vehicles, for the intervals")
    parser.add_argument("--no-classify", action="store_true", help="train no classifiers, which take minutes")
    parser.add_argument("--map", action="append", default=[], metavar="NAME=COLUMN")
    args = parser.parse_args(argv)
    board = benchmark_realism(
        all_runs(read_drives(args.drives, parse_map(args.map))),
        models=args.model,
        profiles=[read_profile(profile) for profile in args.profile],
        seed=args.seed,
        resamples=args.resamples,
        classify=not args.no_classify,
    )
    record = json.dumps(board_record(board, parsed_hashes(args.drives)), indent=1, ensure_ascii=False, allow_nan=False)
    args.output.mkdir(parents=True, exist_ok=True)
    write_atomically(args.output / "board.json", f"{record}\n")
    write_atomically(args.output / "board.md", board_markdown(board))
    print(board_text(board))


if __name__ == "__main__":
    main()
