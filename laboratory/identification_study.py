"""The protocol of proof, run: what is named on drives with known truth, beside what an oracle can see.

    python -m laboratory.identification_study --set SET [--only NAME] [-o OUT.jsonl]

SET is design, validation or test, alone or with _2 to _9 for the later rounds.

docs/validation/identification.toml fixes seeds, movements, kinds, sizes and counts; `--share` runs a part of them. One
line per drive goes to OUT.jsonl as it is finished; `--table OUT.jsonl...` prints the tables of the documents.
"""

from __future__ import annotations

import argparse
import math
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from laboratory.identification_cases import PROTOCOL, SETS, cases, planted_drive
from laboratory.identification_oracle import coarse_of, oracle, oracle_between
from laboratory.identification_tables import calibration, summary, table
from laboratory.outcome_lines import append_outcome, read_outcomes
from xosc_lateral.extras.loop.identify import VETOED, identify
from xosc_lateral.extras.loop.selection import TERMS
from xosc_lateral.extras.loop.timeline import Coarse, coarse_mean


def run(case: dict[str, Any], protocol: dict[str, Any], seconds: float) -> dict[str, Any]:
    """Make one drive, identify, and compare with the truth."""
    bare, table = planted_drive(case, protocol, seconds)
    started = time.process_time()
    coarse = coarse_of(table)
    found = identify(coarse, np.random.SeedSequence(1))
    outcome = dict(case)
    outcome["cpu_s"] = round(time.process_time() - started, 1)
    outcome["named"] = [
        [one.term.kind, sorted(one.term.columns), one.p_value, one.term.component, [sorted(x) for x in one.term.alike]]
        for one in found.selection.accepted
    ]
    kinds = {term.component: term.kind for term in TERMS}
    outcome["vetoed"] = [
        [kinds[one.component], sorted(one.columns), one.p_value, one.component]
        for one in found.selection.rejected
        if one.why == VETOED
    ]
    outcome["feedback"] = [
        [one.column, round(one.coherence, 3), round(one.predicted_share, 3), one.doubtful]
        for one in found.usable.feedback
    ]
    outcome["p"] = {one.component: one.p_value for one in found.selection.rejected}
    outcome["p"] |= {one.term.component: one.p_value for one in found.selection.accepted}
    if case["name"].startswith("slow vehicles"):
        outcome |= oracle_between(case, table)
    elif "size" in case:
        outcome |= oracle(case, bare, coarse)
        outcome |= _size(case, found, coarse, bare)
    return outcome


def _size(case: dict[str, Any], found: Any, coarse: Coarse, bare: pd.DataFrame) -> dict[str, float]:
    """Size and error of the right finding; positive where it moves the car as what was planted does."""
    accepted = [sorted(columns) for columns in case["accepted"]]
    terms = [one.term for one in found.selection.accepted if one.term.kind == "location"]
    right = next((term for term in terms if sorted(term.columns) in accepted), None)
    if right is None:
        return {}
    effects = right.estimate(found.selection.final)
    told = right.describe(found.selection.final, effects, "")
    planted = coarse.offset - coarse_of(bare).offset
    strength = coarse_mean(coarse.strength(effects[0]))[coarse.valid]
    alike = float(np.sign(np.cov(strength, planted[coarse.valid])[0, 1]))
    return {"found_size": alike * abs(told.size_m), "found_error": told.size_error}


def main() -> None:
    """Run a set, or print the tables of one that was run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", default="design", choices=SETS)
    parser.add_argument("--only", default="")
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--part", default="0/1", help="K/N: every N-th drive from the K-th on")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--table", type=Path, nargs="+")
    args = parser.parse_args()
    if args.table is not None:
        outcomes = read_outcomes(args.table)
        print(summary(outcomes), calibration(outcomes), table(outcomes), sep="\n\n")
        return
    protocol = tomllib.loads(PROTOCOL.read_text(encoding="utf-8"))
    part, parts = map(int, args.part.split("/"))
    outcomes = []
    for place, case in enumerate(cases(protocol, args.set, args.share)):
        if place % parts != part or args.only not in case["name"]:
            continue
        outcome = run(case, protocol, args.seconds or protocol["drives"]["long_s"])
        outcomes.append(outcome)
        named = (f"{part} {'*'.join(columns) or '-'} {p:.1e}" for _, columns, p, part, _ in outcome["named"])
        words = "; ".join(named) or "nothing"
        print(
            case["name"],
            case.get("size", case.get("factor", "")),
            case["movement"],
            case["seed"],
            f"z {outcome.get('oracle_z', math.nan):.1f}:",
            words,
            f"({outcome['cpu_s']} s)",
            flush=True,
        )
        append_outcome(args.output, outcome)
    print(summary(outcomes), calibration(outcomes), table(outcomes), sep="\n\n")


if __name__ == "__main__":
    main()
