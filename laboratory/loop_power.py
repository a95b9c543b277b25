"""Whether `close-loop` finds four of five effects of the size that it states, by planting: what sets `SIZE_MARGIN`.

`python -m laboratory.loop_power [TABLES] [--seed N]`: of so many tables of six drives of five minutes each column's
smallest size is read as the loop states it. Then an effect of this size, and of half of it, is planted into another
movement under the same columns, alone and three at once, by a driver who responds within two to four seconds, and the
stage that is to find it searches. Shares within 70 to 90 % keep the margin; half the size has to be found at most in a
third.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from threadpoolctl import threadpool_limits

from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.extras.loop.column_search import ColumnSearch, SearchedTerm
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import search_of
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.shown import SIZE_MARGIN, what_drives_show
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse

FloatArray = NDArray[np.float64]
DRIVES, SECONDS = 6, 300.0
LOOKS: tuple[tuple[str, type[SearchedTerm]], ...] = (
    ("gust", MeanTerm),
    ("slope", MeanTerm),
    ("switch", MeanTerm),
    ("gap", MeanTerm),
    ("slope", SpreadTerm),
)
"""Columns that are planted, and what they act on."""
TOGETHER = ("gust", "switch", "gap")


def context_of(rng: np.random.Generator) -> dict[str, FloatArray]:
    """Six columns of one drive: two of them nobody responds to."""
    n = round(SECONDS / STEP)
    switch = (wander(rng, n, 15.0) > 0.8).astype(float)
    gap = np.where(wander(rng, n, 15.0) > 0.5, 20.0 + 8.0 * wander(rng, n, 5.0), np.nan)
    numbers = {
        name: wander(rng, n, memory) for name, memory in zip(("gust", "slope", "idle"), (8.0, 25.0, 15.0), strict=True)
    }
    return numbers | {"switch": switch, "gap": gap, "other": (wander(rng, n, 30.0) > 0.0).astype(float)}


def moved(rng: np.random.Generator) -> FloatArray:
    """One drive's own movement: quick and slow."""
    memory = rng.uniform(3.0, 8.0)
    return movement(rng, SECONDS, memory) + 0.5 * movement(rng, SECONDS, 25.0)


def response_of(context: Mapping[str, FloatArray], column: str, response_s: float) -> FloatArray:
    """From 0 to 1 between the ends of a column, as a driver responds to it."""
    values = context[column]
    if column == "gap":
        quantity = np.isfinite(values).astype(float)
    elif column == "switch":
        quantity = values
    else:
        low, high = np.quantile(values, [0.05, 0.95])
        quantity = (values - low) / (high - low)
    keep = float(np.exp(-STEP / response_s))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], quantity))


def tables(number: int, start: int) -> Iterator[tuple[Coarse, Coarse, dict[str, FloatArray], np.random.Generator]]:
    """Drives without an effect, other drives under the same columns, those, and what draws timings."""
    for seed in range(number):
        rng = np.random.default_rng(start + seed)
        parts = [context_of(rng) for _ in range(DRIVES)]
        columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        first, second = (np.concatenate([moved(rng) for _ in range(DRIVES)]) for _ in range(2))
        yield coarse_of(first, columns, drives=DRIVES), coarse_of(second, columns, drives=DRIVES), columns, rng


def found(coarse: Coarse, kind: type[SearchedTerm], columns: Mapping[str, FloatArray]) -> set[str]:
    """Columns that one stage names, one after the other."""
    _, search = search_of(coarse, np.random.SeedSequence(1), ["lane_width"], dict.fromkeys(columns, "road"))
    fitted, named = fit_model(coarse, ()), set[str]()
    while (term := _next(search, kind, fitted)) is not None and len(named) < len(TOGETHER) + 1:
        named |= set(term.columns)
        fitted = fit_model(coarse, (*fitted.terms, term))
    return named


def _next(search: Search, kind: type[SearchedTerm], fitted: object) -> SearchedTerm | None:
    outcome = ColumnSearch(search, kind, fitted).outcome()  # type: ignore[arg-type]
    term = None if outcome is None else outcome.term
    return term if isinstance(term, SearchedTerm) else None


def planted(
    coarse: Coarse, columns: Mapping[str, FloatArray], sizes: Mapping[str, float], acts: str, rng: np.random.Generator
) -> Coarse:
    """With effects of these sizes: shifts [m], or logarithms of factors on the movement."""
    moves = sum(size * response_of(columns, name, rng.uniform(2.0, 4.0)) for name, size in sizes.items())
    offset = coarse.timeline.offset
    offset = offset + moves if acts == "mean" else offset * np.exp(moves)
    return coarse_of(np.asarray(offset), columns, drives=DRIVES)


def main() -> None:
    """Print shares found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="?", type=int, default=40)
    parser.add_argument("--seed", type=int, default=7000, help="of the first table")
    options = parser.parse_args()
    number = options.tables
    hits, tried = Counter[str](), Counter[str]()
    for count, (bare, other, columns, rng) in enumerate(tables(number, options.seed), start=1):
        _, search = search_of(bare, np.random.SeedSequence(1), ["lane_width"], dict.fromkeys(columns, "road"))
        looks = {(one.what, one.acts): one.smallest for one in what_drives_show(search, fit_model(bare, ()))}
        for share in (1.0, 0.5):
            plants = [({name: looks[name, kind.group]}, kind) for name, kind in LOOKS]
            plants.append(({name: looks[name, "mean"] for name in TOGETHER}, MeanTerm))
            for sizes, kind in plants:
                stated = {name: size for name, size in sizes.items() if size is not None}
                acting = {name: share * (np.log(one) if kind is SpreadTerm else one) for name, one in stated.items()}
                named = found(planted(other, columns, acting, kind.group, rng), kind, columns)
                for name in acting:
                    label = f"{share:g} of the size: {name}, {kind.group}{', one of three' * (len(acting) > 1)}"
                    tried[label] += 1
                    hits[label] += name in named
        whole, half = (sum(hits[one] for one in tried if one.startswith(share)) for share in ("1 ", "0.5 "))
        planted_each = sum(times for one, times in tried.items() if one.startswith("1 "))
        print(
            f"table {count}: of {planted_each} at the size {whole} found, at half of it {half}",
            file=sys.stderr,
            flush=True,
        )
    print(f"SIZE_MARGIN {SIZE_MARGIN}, {number} tables")
    for label, times in tried.items():
        print(f"{label:50s} {hits[label]:3d} of {times:3d} = {hits[label] / times:.0%}")


if __name__ == "__main__":
    with threadpool_limits(1, user_api="blas"):
        main()
