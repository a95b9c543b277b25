"""What the loop names on drives of `simulated.preview_driver`, beside what an oracle can see.

    python -m laboratory.preview_study design|validation|test|SEED [--rounds N] [--whole] [-o OUT.jsonl] [KIND ...]

A line for each drive with everything that is selected, "!" where it is not what was planted. The sets are those of the
page; from SEED on, the k-th kind of the r-th round has seed SEED + 100 r + k. With `--whole` folds and held-out blocks
judge as well. `--table OUT.jsonl ...` sums up what was run.

The oracle knows the drive without the effect and what the effect does, up to its size; its z is the size over the
standard error that rotations of that drive give.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from laboratory.identification_oracle import coarse_of, power_of_rotations
from laboratory.outcome_lines import append_outcome, read_outcomes
from tests.kit.simulated import preview_driver
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.close import close_loop
from xosc_lateral.extras.loop.dictionary import Search, beside, orthonormal
from xosc_lateral.extras.loop.identify import name_time_beside, usable_columns
from xosc_lateral.extras.loop.model import CLIP, fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, Accepted, select
from xosc_lateral.extras.loop.terms.mean import RESPONSE_S, CourseTerm
from xosc_lateral.files.drives import drives_of_table

BENDS = {"curvature", "crossfall", "speed"}
"""By which what bends do may be named: crossfall goes along with curvature, and speed changes how the car turns."""

SEEDS = {"design": preview_driver.DESIGN, "validation": preview_driver.VALIDATION, "test": preview_driver.TEST}
HANDS_S = (0.0, 1.0, 2.0, 3.0)
"""Delays with which the car may follow its target. [s]"""
SURE = 7.0
"""The oracle's z from which an effect has to be named."""


def oracle_z(drive: preview_driver.PreviewDrive, seed: int) -> float:
    """What the data can show of the planted effect, of its mean and of its spread the surer one; 0: nothing planted.

    What bends do is taken out by a course of curvature. A target is met through the best of the delays that the hands
    may have: the difference of two drives would not do, since hands that act now and then make it grow by chance.
    """
    act, bare = drive.act, preview_driver.simulate("bends", seed)
    seen, without = (coarse_of(table) for table in (drive.table, bare.table))
    bends = CourseTerm.of(Linear(acts=Acts.LOCATION, column="curvature", response_s=RESPONSE_S))
    fitted = fit_model(without, (bends,))
    valid, white = seen.valid & without.valid, fitted.whitener.rows
    basis = orthonormal(white(fitted.columns)[valid])
    noise, rows = (beside(basis, white(coarse.offset)[valid]) for coarse in (without, seen))
    time = preview_driver.STEP * np.arange(len(drive.context["speed"]))
    scores = [0.0]
    paths = [act.target(drive.context, time)] if act.target else []
    paths += [act.camera(time)] if act.camera else []
    for path in paths:
        for late in HANDS_S:
            effect = beside(basis, white(np.interp(seen.time - late, time, path))[valid])
            scores.append(float(abs(effect @ rows) / np.sqrt(power_of_rotations(effect[:, None], noise)[0, 0])))
    if act.log_spread:
        log_spread = np.interp(seen.time, time, act.log_spread(drive.context, time))[valid]
        squares, plain = (np.minimum(np.square(own / noise.std()), CLIP) for own in (rows, noise))
        log_spread, plain = log_spread - log_spread.mean(), plain - plain.mean()
        scores.append(float(log_spread @ squares / np.sqrt(power_of_rotations(log_spread[:, None], plain)[0, 0])))
    return max(scores)


def verdict(accepted: Sequence[Accepted], act: preview_driver.Act) -> dict[str, Any]:
    """Everything found, whether what was planted is among it, and the findings that are wrong."""
    planted = bool(act.columns or act.target or act.log_spread or act.camera)
    words, hit, wrong, quantities = [], False, [], []
    for one in accepted:
        columns = set(one.term.columns)
        named = planted and (columns == set(act.columns) if act.columns else one.term.component.startswith("time_"))
        of_bends = bool(columns) and columns <= BENDS
        # a column, or a change with time: which of the two it is, other drives decide
        named |= planted and (act.columns or ("time",)) in one.term.alike and not (columns and act.columns)
        hit |= named
        name = f"{one.term.component} {'*'.join(one.term.columns)}"
        wrong += [] if named or of_bends else [name]
        words.append(f"{'' if named or of_bends else '!'}{name} {one.p_value:.0e}")
        quantities.append([one.term.group if columns else one.term.component, sorted(columns)])
    twice = sum(quantities.count(one) > 1 for one in quantities)
    return {"named": hit if planted else None, "wrong": wrong, "twice": twice, "words": "; ".join(words) or "nothing"}


def study(kind: str, seed: int, *, whole: bool) -> dict[str, Any]:
    """One drive."""
    drive = preview_driver.simulate(kind, seed)
    drives, more = drives_of_table(drive.table, {}), dict[str, Any]()
    if whole:
        result = close_loop(drives, seed=1)
        accepted, usable = result.identified.selection.accepted, result.identified.usable
        more = {"error_mm": [1000.0 * result.error_before, 1000.0 * result.error_after]}
        more |= {"taken_back": [f"{one.component} {'*'.join(one.columns)}" for one in result.identified.taken_back]}
    else:
        coarse = coarse_of(drive.table)
        usable = usable_columns(coarse.timeline)
        with threadpool_limits(1, user_api="blas"):
            search = Search.over(coarse, usable.columns, np.random.SeedSequence(1), ERROR_BUDGET)
            accepted = name_time_beside(search, select(search)).accepted
    dismissed = {item.column for item in usable.feedback} & {"curvature", "crossfall", "grade"}
    outcome = {"kind": kind, "seed": seed, "z": oracle_z(drive, seed), **verdict(accepted, drive.act)}
    return outcome | {"dismissed": sorted(dismissed)} | more


def summary(outcomes: Sequence[Mapping[str, Any]]) -> str:
    """Counts."""
    sure = [one for one in outcomes if one["named"] is not None and one["z"] >= SURE]
    lines = [
        f"drives {len(outcomes)}; planted effects named {sum(one['named'] is True for one in outcomes)} of "
        f"{sum(one['named'] is not None for one in outcomes)}; from an oracle's z of {SURE:g} on "
        f"{sum(one['named'] for one in sure)} of {len(sure)}",
        f"findings that are wrong {sum(len(one['wrong']) for one in outcomes)}, on "
        f"{sum(bool(one['wrong']) for one in outcomes)} drives; one quantity twice "
        f"{sum(one['twice'] for one in outcomes)}; road dismissed {sum(bool(one['dismissed']) for one in outcomes)}",
    ]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> None:
    """Print a line per drive, then the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", nargs="?", help=f"{', '.join(SEEDS)}, or the first seed")
    parser.add_argument("kind", nargs="*")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--whole", action="store_true", help="close the loop: folds and held-out blocks judge as well")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--table", type=Path, nargs="+")
    args = parser.parse_args(argv)
    if args.table is not None:
        print(summary(read_outcomes(args.table)))
        return
    wanted = args.kind or list(preview_driver.kinds())
    if args.set in SEEDS:
        seeds = [(kind, SEEDS[args.set][kind]) for kind in wanted if kind in SEEDS[args.set]]
    else:
        number = {kind: index for index, kind in enumerate(preview_driver.kinds())}
        first = (int(args.set) + 100 * turn for turn in range(args.rounds))
        seeds = [(kind, seed + number[kind]) for seed in first for kind in wanted]
    outcomes = []
    for kind, seed in seeds:
        try:
            outcome = study(kind, seed, whole=args.whole)
        except (FormatError, NotEnoughDataError) as error:  # a driver who leaves the road, now and then
            print(f"{kind} {seed}: {str(error)[:80]}", flush=True)
            continue
        outcomes.append(outcome)
        append_outcome(args.output, outcome)
        named = {None: "-", True: "named", False: "MISSED"}[outcome["named"]]
        rest = {key: value for key, value in outcome.items() if key in ("dismissed", "error_mm", "taken_back")}
        print(f"{kind} {seed}: z {outcome['z']:.1f} {named} | {outcome['words']} | {json.dumps(rest)}", flush=True)
    print(summary(outcomes))


if __name__ == "__main__":
    main()
