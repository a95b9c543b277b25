"""What each part of the loop's selection is worth: parts switched off in turn, on design drives of three simulators.

`python -m benchmarks.loop_ablation [PART ...]`: for each part the effects that are named without it and the wrong ones,
beside those of the whole method. Selection alone: what folds or held-out errors judge is not here.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from unittest.mock import patch

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from benchmarks import simulated as plants
from benchmarks.identification_drives import long_drive, offset_of, smoothed_tracks, with_mean, with_spread
from benchmarks.simulated import preview_driver
from xosc_lateral.formats.drives import drives_of_table
from xosc_lateral.identification import column_search, dictionary, innovations, regression, selection
from xosc_lateral.identification.identify import usable_columns
from xosc_lateral.identification.regression import Coarse
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.terms.spread import FineNoiseTerm, SlowSpreadTerm
from xosc_lateral.identification.terms.time import TimeSpreadTerm
from xosc_lateral.identification.timeline import join_drives

Drive = tuple[str, pd.DataFrame, set[str]]
BENDS = {"curvature", "crossfall", "speed"}


def drives() -> Iterator[Drive]:
    """Name, table, and the columns that something may be named by; "time" for what none explains."""
    for kind in ("wind", "lead_in_lane", "rain", "fatigue", "two_drivers"):
        one = preview_driver.simulate(kind, preview_driver.DESIGN[kind])
        yield f"preview {kind}", one.table, {*one.act.columns} or {"time"}
    own = {"truck": plants.truck_avoidance(0.25), "tired": plants.Fatigue(3.0), "weave": plants.CyclicTarget(0.2, 12.0)}
    for number, (name, plant) in enumerate(own.items()):
        yield (
            f"steering {name}",
            plants.simulate_drive(3000.0, 700 + number, effects=[plant]).table,
            {*plant.columns} or {"time"},
        )
    for number, kind in enumerate(("truck alongside", "cross wind", "grade, threshold")):
        table = with_mean(long_drive("clustered", 3000.0, 710 + number), kind, 0.2, 710 + number)
        wanted = {"truck alongside": {"truck_right"}, "cross wind": {"wind_speed", "wind_direction"}}.get(
            kind, {"grade"}
        )
        yield f"planted {kind}", smoothed_tracks(table) if number else table, wanted
    yield "planted rain", with_spread(long_drive("wandering", 3000.0, 713), "spread by rain", 1.8, 713), {"rain"}
    yield "nothing", long_drive("bursts", 3000.0, 714), set()


def without_kind(kind: type) -> Callable[[], object]:
    """No term of a kind is looked for."""
    stages = tuple(tuple(one for one in stage if one is not kind) for stage in selection.STAGES)
    return lambda: patch.object(selection, "STAGES", stages)


PARTS: dict[str, Callable[[], object]] = {
    "the whole": lambda: patch.object(column_search, "ROUNDS", column_search.ROUNDS),
    "second look at what acts": lambda: patch.object(column_search, "ROUNDS", 1),
    "movement must not grow": lambda: patch.object(column_search, "_grows", lambda before, after: False),
    "tested again": lambda: patch.object(selection, "_tested_again", lambda search, found, one: found),
    "loudness of own rows": lambda: patch.object(dictionary, "_beside_loud_stretches", lambda scores, *rest: scores),
    "3 cm of noise": lambda: patch.object(regression, "FLOOR", 0.0),
    "responses smoothed as seen": lambda: patch.object(
        innovations, "smoothed_as_seen", lambda moved, seen, *rest: seen
    ),
    "slow spread": without_kind(SlowSpreadTerm),
    "fine noise": without_kind(FineNoiseTerm),
    "spread by time": without_kind(TimeSpreadTerm),
}


@contextmanager
def switched(part: str) -> Iterator[None]:
    """The method without a part."""
    with ExitStack() as stack:
        stack.enter_context(PARTS[part]())  # type: ignore[arg-type]
        yield


def named(table: pd.DataFrame, wanted: set[str]) -> tuple[bool, int]:
    """Whether what acts is named, and how many findings are wrong."""
    coarse = Coarse.of(join_drives(drives_of_table(table, {})))
    columns = usable_columns(coarse.timeline).columns
    with threadpool_limits(1, user_api="blas"):
        found = selection.select(Search.over(coarse, columns, np.random.SeedSequence(1), selection.ERROR_BUDGET))
    sets = [set(one.term.columns) or {"time"} for one in found.accepted]
    return any(one <= wanted for one in sets), sum(not one <= wanted and not one <= BENDS for one in sets)


def main(argv: Sequence[str] | None = None) -> None:
    """A line per part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="*", choices=[*PARTS, []], help="all, if none is named")
    parts = parser.parse_args(argv).part
    tables = list(drives())
    assert all(np.isfinite(offset_of(table)).all() for _, table, _ in tables if "distance_left" in table)
    for part in parts or list(PARTS):
        with switched(part):
            outcomes = [named(table, wanted) for _, table, wanted in tables]
        hits = sum(hit for (hit, _), (_, _, wanted) in zip(outcomes, tables, strict=True) if wanted)
        missed = [name for (hit, _), (name, _, wanted) in zip(outcomes, tables, strict=True) if wanted and not hit]
        print(f"without {part}: {hits} named, {sum(wrong for _, wrong in outcomes)} wrong; missed {missed}", flush=True)


if __name__ == "__main__":
    main()
