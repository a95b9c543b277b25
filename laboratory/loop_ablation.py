"""What each part of the loop's selection is worth: parts switched off in turn, on design drives of three simulators.

`python -m laboratory.loop_ablation [PART ...]`: for each part the effects that are named without it and the wrong
findings, beside those of the whole method. Selection alone: folds and held-out errors do not judge here.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from laboratory.identification_cases import PROTOCOL, cases, planted_drive
from tests.kit import simulated as plants
from tests.kit.simulated import preview_driver
from xosc_lateral.extras.loop import (
    autocorrelation,
    candidates,
    column_search,
    columns,
    dictionary,
    model,
    refinement,
    selection,
)
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.terms import spread
from xosc_lateral.extras.loop.terms.spread import SlowSpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse, join_drives
from xosc_lateral.files.drives import drives_of_table

Named = tuple[frozenset[str], ...]
Drive = tuple[str, pd.DataFrame, Named, bool]
"""Name, table, sets of columns that count as right (no columns: by time), and whether it is a table of short drives."""
BENDS = frozenset({"curvature", "crossfall", "speed"})
SKIPPED = 2
"""Of the protocol's design set every so many-th long drive is left out."""


def drives() -> Iterator[Drive]:
    """The design drives."""
    for kind in ("wind", "lead_in_lane", "rain", "fatigue", "two_drivers", "bends"):
        if kind in preview_driver.DESIGN:
            one = preview_driver.simulate(kind, preview_driver.DESIGN[kind])
            right = () if kind == "bends" else (frozenset(one.act.columns),)
        yield f"preview {kind}", one.table, right, False
    own = {"truck": plants.truck_avoidance(0.25), "tired": plants.Fatigue(3.0), "weave": plants.CyclicTarget(0.2, 12.0)}
    for number, (name, plant) in enumerate(own.items()):
        table = plants.simulate_drive(3000.0, 700 + number, effects=[plant]).table
        yield f"steering {name}", table, (frozenset(plant.columns),), False
    protocol = tomllib.loads(PROTOCOL.read_text())
    for number, case in enumerate(cases(protocol, "design_9", 0.1)):
        short = case["type"].endswith("short")
        if (number % 3 == SKIPPED and not short) or (short and case["seed"] % 2):
            continue
        right = tuple(frozenset(names) for names in case.get("accepted", ()))
        _, table = planted_drive(case, protocol, protocol["drives"]["long_s"])
        yield f"{case['movement']} {case['name']} {case.get('size', case.get('factor', ''))}", table, right, short


def without_kinds(*kinds: type) -> list[Any]:
    """No term of some kinds is tested."""
    stages = tuple(tuple(one for one in stage if one not in kinds) for stage in selection.STAGES)
    return [patch.object(selection, "STAGES", stages)]


PARTS: dict[str, Callable[[], list[Any]]] = {
    "the whole": lambda: [],
    "3 cm of noise": lambda: [patch.object(model, "MEASUREMENT_NOISE", 0.0)],
    "responses smoothed as seen": lambda: [patch.object(model, "smoothed_as_seen", lambda moved, seen, *rest: seen)],
    "slow spread": lambda: without_kinds(SlowSpreadTerm),
    "second look at what acts": lambda: [patch.object(column_search, "ROUNDS", 1)],
    "tested again": lambda: [patch.object(selection, "_tested_again", lambda search, found, one: found)],
    "loudness of own rows": lambda: [patch.object(dictionary, "_beside_loud_stretches", lambda scores, *rest: scores)],
    "scales and centres of products, curves": lambda: [
        patch.object(refinement, "other_scales", lambda effect, shares: ()),
        patch.object(refinement, "other_centres", lambda effect, coarse: ()),
        patch.object(candidates, "_curves", lambda column, values: []),
    ],
    "what a column may do, beside time": lambda: [patch.object(spread, "MAY_ACT", 0.0)],
    "direction of time": lambda: [patch.object(columns, "_predicted_share", lambda values, moved, rows: 0.0)],
    "bias of short drives": lambda: [
        patch.object(model, "unbiased", lambda process, *rest, **more: process),
    ],
    **{
        f"{name} {value}": lambda owner=owner, name=name, value=value: [patch.object(owner, name, value)]
        for owner, name, values in (
            (column_search, "CONTENDERS", (1, 2, 8)),
            (autocorrelation, "ROWS_PER_COEFFICIENT", (10, 40)),
        )
        for value in values
    },
}
"""Also numbers that were chosen: named with half and twice of them, they say how much hangs on the choice."""
SHORT_ONLY = frozenset({"bias of short drives"})


def named(table: pd.DataFrame, right: Named) -> tuple[bool, list[str]]:
    """Whether what acts is named, and the findings that are wrong."""
    coarse = Coarse.of(join_drives(drives_of_table(table, {})))
    columns = usable_columns(coarse.timeline).columns
    with threadpool_limits(1, user_api="blas"):
        found = selection.select(Search.over(coarse, columns, np.random.SeedSequence(1), selection.ERROR_BUDGET))
    sets = [frozenset(one.term.columns) for one in found.accepted]
    parts = frozenset().union(*right) if right else frozenset()
    wrong = [
        f"{one.term.component}({'*'.join(one.term.columns)})"
        for one, columns_ in zip(found.accepted, sets, strict=True)
        if columns_ not in right and not (columns_ and columns_ <= parts) and not (columns_ and columns_ <= BENDS)
    ]
    return any(one in right for one in sets), wrong


def main(argv: Sequence[str] | None = None) -> None:
    """A line per part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="*", help="all, if none is named")
    parts = parser.parse_args(argv).part or list(PARTS)
    tables = list(drives())
    for part in parts:
        start, hits, asked, missed, wrongs = time.perf_counter(), 0, 0, [], []
        with ExitStack() as stack:
            for one in PARTS[part]():
                stack.enter_context(one)
            for name, table, right, short in tables:
                if part in SHORT_ONLY and not short:
                    continue
                hit, wrong = named(table, right)
                asked += bool(right)
                hits += hit and bool(right)
                missed += [name] if right and not hit else []
                wrongs += [f"{name}: {one}" for one in wrong]
        took = time.perf_counter() - start
        how = "with" if part[-1].isdigit() else "without"
        print(f"{how} {part}: {hits} of {asked} named, {len(wrongs)} wrong, {took:.0f} s", flush=True)
        print(f"   missed: {'; '.join(missed)}\n   wrong: {'; '.join(wrongs)}", flush=True)


if __name__ == "__main__":
    main()
