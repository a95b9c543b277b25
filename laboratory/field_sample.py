"""A random sample of field scenarios in which everything is played, beside the reference player.

    python -m laboratory.field_sample FOLDER... --esmini PATH [--count 40] [--seed 40]

One scenario per name is drawn, in an order that the seed gives; what has a remark or a note, or can't be played here or
there, is passed over. Printed are the differences of all rows, and actions that start at other times. What is left to
a person: to read the scenarios in which anything differs.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from laboratory.agreement import difference, own_rows, reference_rows, scenarios
from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.workflows.conversion.load import Played, play_scenario

STEP, LIMIT = 0.02, 60.0
"""Of the runs. [s]"""
_STARTED = re.compile(r"^\[([0-9.]+)\] \[info\] (.+) (?:initState|standbyState) -> startTransition -> runningState")
Start = tuple[float, str]


def drawn(folders: Sequence[Path], seed: int) -> Iterator[Path]:
    """Scenarios in random order, one of each name."""
    names: dict[str, list[Path]] = {}
    for path in scenarios(folders, None):
        names.setdefault(path.stem.lower(), []).append(path)
    rng = np.random.default_rng(seed)
    for k in rng.permutation(len(names)):
        paths = names[sorted(names)[k]]
        yield paths[int(rng.integers(len(paths)))]


def starts_of(messages: Path) -> list[Start]:
    """When what started, as the reference player's log has it."""
    lines = messages.read_text(errors="replace").splitlines() if messages.is_file() else []
    return [(float(found[1]), found[2]) for found in map(_STARTED.match, lines) if found]


def other_starts(played: Played, there: list[Start]) -> list[Start]:
    """Actions of the storyboard that start at another time there, or not at all."""
    own = [(action.start, action.action.name) for action in played.motion.actions if action.start > 0.0]
    return [
        (time, name)
        for time, name in own
        if time < LIMIT and not any(name == other and abs(time - at) < 1.5 * STEP for at, other in there)
    ]


def main() -> None:
    """Print a line per scenario."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--esmini", type=Path, required=True)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=40)
    options = parser.parse_args()
    esmini, taken, alike = options.esmini.resolve(), 0, 0
    for path in drawn(options.folder, options.seed):
        try:
            played = play_scenario(path, allowed=options.folder)
        except XoscLateralError:
            continue
        if played.motion.notes or played.scenario.remarks:
            continue
        with tempfile.TemporaryDirectory() as folder:
            messages = Path(folder) / "log.txt"
            rows = reference_rows(esmini, path, STEP, LIMIT, messages=messages)
            there = starts_of(messages)
        if rows["time"].nunique() < 3:
            continue
        found = difference(rows, own_rows(played), STEP, LIMIT)
        starts = other_starts(played, there)
        taken, alike = taken + 1, alike + (not found and not starts)
        print(f"{path.name}: {found or 'rows agree'}; starts that differ: {starts or 'none'}", flush=True)
        if taken == options.count:
            break
    print(f"{alike} of {taken} agree in all rows and starts")


if __name__ == "__main__":
    main()
