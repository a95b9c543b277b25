"""What drives can show: of every look, whether it was taken, the smallest effect that it finds, and an upper bound.

A silent loop says little without its power. The standard error of an effect on which nothing rests but chance is known
before any is sought: with the score that chance gives, it says what is found with 80 % probability. What was not found
is below the largest size that any timing leaves open.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from xosc_lateral.drivers.model.effects.base import LOG_LIMIT
from xosc_lateral.extras.loop.candidates import Family
from xosc_lateral.extras.loop.column_search import ColumnSearch, SearchedTerm
from xosc_lateral.extras.loop.dictionary import TIMINGS, Search, beside
from xosc_lateral.extras.loop.drives import BOUND_Z, FEWEST, FEWEST_BETWEEN, POWER_Z, Pooled, counted
from xosc_lateral.extras.loop.model import CLIP, Fitted
from xosc_lateral.extras.loop.terms import spread
from xosc_lateral.extras.loop.terms.between import (
    BetweenSpreadTerm,
    BetweenTerm,
    between_drives,
    can_be_told,
    whole_drive_columns,
)
from xosc_lateral.extras.loop.terms.column import DRIVING_QUANTILES, of_kind
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.time import StepTerm, mean_alike, spread_alike

# By how much the stated size and bound exceed the formula's: an effect is in the noise that it is compared with, and
# drivers respond more slowly than the middle of the timings (laboratory.loop_power: with a margin of 1.45, of 144
# effects of the stated size 102 are found, of half of it 8; by these two shares four of five need a tenth more. With
# it, on others (`6 --seed 57000`, `4 --seed 91500`, `4 --seed 91600`), of 112 effects 91, of half the size 15). [-]
SIZE_MARGIN, BOUND_MARGIN = 1.6, 1.15
# Effects beyond these are no driver's: a look that finds only such is none. [m], log
LARGEST_SIZES = {"mean": 1.0, "spread": LOG_LIMIT}
# Round sizes that minutes are stated for: a tenth of a metre, and a factor of a half more. [m], log
AIMS = {"mean": 0.1, "spread": float(np.log(1.5))}
IN_PROFILE = "in the profile"  # Of what was found, or the base has: it is not looked for any more.


@dataclass(frozen=True, slots=True)
class Shown:
    """One look at the drives. Sizes in [m] for the mean, factors for the spread; None: not known."""

    what: str  # A column, "time", "cycle" ...
    acts: str  # "mean" or "spread".
    tested: bool
    why: str  # Why not, or what it rests on.
    smallest: float | None = None  # Found with 80 % probability.
    bound: float | None = None  # What an effect that was not found is below, at 95 %.
    more_minutes: float | None = None  # Of such driving until 0.1 m, or a factor of 1.5, is found as often.


def what_drives_show(search: Search, fitted: Fitted, *, plan: bool = False) -> list[Shown]:
    """Every look that may find a cause. Before effects are sought (`plan`) there are no bounds."""
    shown: list[Shown] = []
    for kind in (MeanTerm, spread.SpreadTerm):
        shown += _of_columns(search, fitted, kind)
    shown += [*_of_whole_drives(search, fitted), *_of_time(search, fitted)]
    if not plan:
        return shown
    return [replace(one, why="would be tested" if one.tested else one.why, bound=None) for one in shown]


def _entry(fitted: Fitted, what: str, acts: str, why: str, smallest: float, bound: float) -> Shown:
    """Sizes of the spread are logarithms until here."""
    more = float(fitted.coarse.valid.sum()) / 60.0 * max((smallest / AIMS[acts]) ** 2 - 1.0, 0.0)

    def stated(size: float) -> float | None:
        return None if size > LARGEST_SIZES[acts] else float(np.exp(size)) if acts == "spread" else size

    return Shown(what, acts, True, why, stated(smallest), stated(bound), more)


def _of_columns(search: Search, fitted: Fitted, kind: type[SearchedTerm]) -> Iterator[Shown]:
    """What changes within drives, by one scoring."""
    acts, columns = kind.group, ColumnSearch(search, kind, fitted)
    limits = columns.limits(search.levels[kind.component])
    if limits is None:
        return
    problem, known, critical = limits
    unit = 1.0
    if acts == "spread":  # of a standardised square to that of a logarithm of a standard deviation
        squares = spread.quick_squares(fitted)
        clipped = np.minimum(squares.values, CLIP)[squares.valid]
        unit = 0.5 * float(clipped.std() / max(float(clipped.mean()), 1e-300))
    left = beside(known, problem.observed)
    noise = unit * float(left.std())
    named = {name for term in of_kind(fitted, kind) for name in term.columns}
    entries: dict[str, list[tuple[float, float, float]]] = {}
    for index, candidate in enumerate(search.quantities.candidates):
        if candidate.family is not Family.PLAIN:
            continue
        for response_s, lags in TIMINGS.items():
            response = search.quantities.responses(np.array([index]), response_s).astype(np.float64)
            for moved, (rows,) in ((moved, rows.T) for moved, rows in problem.whitener.at_lags(response, lags)):
                if float(rows @ rows) <= 1e-9 * float(np.square(moved).sum()):  # constant within drives
                    continue
                rows = beside(known, rows)
                power = max(float(rows @ rows), 1e-300)
                low, high = np.quantile(moved, DRIVING_QUANTILES)
                reach = float(high - low if high > low else np.ptp(moved))
                error, size = reach * noise / np.sqrt(power), reach * unit * float(rows @ left) / power
                entries.setdefault(candidate.columns[0], []).append((error, size, candidate.cost))
    for name, timings in sorted(entries.items()):
        errors, sizes, costs = np.array(timings).T
        smallest = SIZE_MARGIN * float(np.median(errors * (np.sqrt(np.maximum(critical + costs, 0.0)) + POWER_Z)))
        bound = BOUND_MARGIN * float(np.max(np.abs(sizes) + BOUND_Z * errors))
        if name in named:
            yield Shown(name, acts, True, IN_PROFILE)
        else:
            why = "not found" if smallest <= LARGEST_SIZES[acts] else "not found; it hardly changes within drives"
            yield _entry(fitted, name, acts, why, smallest, bound)


def between_drives_of(column: str) -> str:
    """What the look at a column that is constant in every drive is called."""
    return f"{column} (between drives)"


def _of_whole_drives(search: Search, fitted: Fitted) -> Iterator[Shown]:
    """Columns that are constant in every drive."""
    columns = whole_drive_columns(search)
    number = max(1, sum(map(can_be_told, columns.values())))
    for name, values in columns.items():
        for kind in (BetweenTerm, BetweenSpreadTerm):
            what = between_drives_of(name)
            if not can_be_told(values):
                there = int(np.isfinite(values).sum())
                why = f"cannot be told from the own differences of {there} drives"
                why += ": one drive alone differs" if there >= FEWEST_BETWEEN else f"; {FEWEST_BETWEEN} are needed"
                yield Shown(what, kind.group, False, why)
            elif any(isinstance(term, kind) and name in term.columns for term in fitted.terms):
                yield Shown(what, kind.group, True, IN_PROFILE)
            else:
                level = search.levels[kind.component] / number
                yield _pooled(fitted, what, kind.group, between_drives(fitted, kind, values), level, np.ptp(values))


def _pooled(fitted: Fitted, what: str, acts: str, pooled: Pooled, level: float, reach: float) -> Shown:
    """Over the whole range of what it is by."""
    why = f"not found; over {pooled.drives} drives"
    return _entry(fitted, what, acts, why, reach * pooled.detectable_size(level), reach * pooled.bound)


def _of_time(search: Search, fitted: Fitted) -> Iterator[Shown]:
    """What no column explains."""
    coarse, there = fitted.coarse, {term.component for term in fitted.terms}
    seconds = counted(coarse)
    looks = (("mean", "time_mean", mean_alike), ("spread", "time_spread", spread_alike))
    for acts, component, alike in looks:
        pooled = alike(fitted)
        if component in there:
            yield Shown("time", acts, True, IN_PROFILE)
        elif pooled is not None:
            yield _pooled(fitted, "time", acts, pooled, search.levels[component], float(seconds.max()))
        elif coarse.lasts:
            yield Shown("time", acts, True, "not found; its power is not known for fewer than three drives")
        else:
            yield Shown("time", acts, False, f"fewer than {FEWEST} drives of two minutes, and none of ten")
    single, known = coarse.drives == 1 and coarse.lasts, "not found; 0.12 m is found on 9 of 10 sets of short drives"
    products = any(one.family is Family.PRODUCT for one in search.quantities.candidates)
    none = "several drives have no common step" if coarse.drives > 1 else "under ten minutes"
    hidden = (
        ("step", "mean", single, StepTerm in map(type, fitted.terms), "not found", none),
        ("cycle", "mean", bool(seconds.any()), "cycle" in there, known, "needs a drive of two minutes"),
        ("regimes", "spread", coarse.lasts, "regimes" in there, "not found", "needs a drive of ten minutes"),
        (
            "products of two columns",
            "mean and spread",
            products,
            False,
            "no size is stated",
            "there are no two columns",
        ),
    )
    for what, acts, tested, kept, silent, untested in hidden:
        yield Shown(what, acts, tested, IN_PROFILE if kept else silent if tested else untested)
