"""Other ways to find what moves a driver, on the same drives as the loop.

    python -m laboratory.other_methods --set test [--share 0.25] -o OUT.jsonl
    python -m laboratory.other_methods --table OUT.jsonl --loop LOOP.jsonl

Each method names columns at its own usual level (0.05 for the whole table, where it has p-values). Needs tigramite and
statsmodels, which nothing else here needs: `pip install tigramite statsmodels`.

PCMCI+ [1]_, and J-PCMCI+ on the first 40 drives of a table of many [2]_: partial correlation, lags up to 4 s, at most
three conditions, Benjamini and Hochberg's correction; named is what has a link into the offset. Additive model: cubic
splines of every column, whitened with the offset by an autoregression of 12 s, F test per column, Holm's correction
[3]_. Boosting: gradient-boosted trees on columns now and 2 and 4 s ago, permutation importance on held-out blocks of
150 s or whole vehicles; named is what is above zero by two standard errors over the folds [4]_.

References
----------
.. [1] J. Runge, "Discovering contemporaneous and lagged causal relations in autocorrelated nonlinear time series
   datasets", UAI 2020.
.. [2] W. Guenther, U. Ninad, J. Runge, "Causal discovery for time series from multiple datasets with latent contexts",
   UAI 2023.
.. [3] S. Wood, "Generalized Additive Models", 2017, chapter 6.
.. [4] L. Breiman, "Random forests", Machine Learning 45, 2001.
"""

from __future__ import annotations

import argparse
import json
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from laboratory.identification_cases import PROTOCOL, SETS, cases, planted_drive
from laboratory.identification_drives import offset_of
from laboratory.identification_tables import false, right

Values = np.ndarray
LAGS_S = 4
PCMCI_SETTINGS: dict[str, Any] = {"tau_max": LAGS_S, "pc_alpha": 0.01, "fdr_method": "fdr_bh", "max_conds_dim": 3}
MISSING = 999.0
JOINT_DRIVES = 40
"""Of 60 it needs two and a half minutes."""
FAR = 200.0
"""Distance that stands for "there is none": none of the methods knows missing or infinite values. [m]"""


def by_second(table: pd.DataFrame) -> tuple[Values, dict[str, Values], Values]:
    """Offset, columns and drive at 1 Hz; angles as sine and cosine."""
    drive = table["drive"].astype("category").cat.codes.to_numpy() if "drive" in table else np.zeros(len(table), int)
    offset = table["offset"].to_numpy() if "offset" in table else offset_of(table)
    group = pd.Series(drive).astype(str) + "/" + np.floor(table["time"].to_numpy()).astype(int).astype(str)
    keys = group.factorize()[0]
    skipped = ("drive", "time", "offset", "distance_left", "distance_right", "lane_change", "lateral_velocity")
    columns = {name: table[name].to_numpy(dtype=float) for name in table if name not in skipped}
    for name in [one for one in columns if one.endswith("direction")]:
        angle = np.radians(columns.pop(name))
        columns |= {f"{name} sine": np.sin(angle), f"{name} cosine": np.cos(angle)}
    count = np.bincount(keys)
    mean = {
        name: np.bincount(keys, np.nan_to_num(values, nan=FAR, posinf=FAR)) / count for name, values in columns.items()
    }
    own = np.bincount(keys, drive) / count
    return np.bincount(keys, offset) / count, {k: v for k, v in mean.items() if np.ptp(v) > 0}, own.astype(int)


def pcmci_plus(offset: Values, columns: dict[str, Values], drive: Values) -> list[str]:
    """PCMCI+; of many drives each about its own mean, which is what a space context does to linear links."""
    from tigramite.data_processing import DataFrame
    from tigramite.independence_tests.parcorr import ParCorr
    from tigramite.pcmci import PCMCI

    data = _noisy(np.stack([offset, *columns.values()], axis=1))
    gap = np.full((2 * LAGS_S + 1, data.shape[1]), MISSING)
    pieces = [part for one in np.unique(drive) for part in (data[drive == one] - data[drive == one].mean(axis=0), gap)]
    frame = DataFrame(np.concatenate(pieces), missing_flag=MISSING)
    return _parents(PCMCI(frame, ParCorr(), verbosity=0).run_pcmciplus(**PCMCI_SETTINGS), columns)


def joint_pcmci_plus(offset: Values, columns: dict[str, Values], drive: Values) -> list[str]:
    """J-PCMCI+ with every drive as a space context, of the first drives only: its time grows with their square."""
    from tigramite.data_processing import DataFrame
    from tigramite.independence_tests.parcorr_mult import ParCorrMult
    from tigramite.jpcmciplus import JPCMCIplus

    data = _noisy(np.stack([offset, *columns.values()], axis=1))
    drives = np.unique(drive)[:JOINT_DRIVES]
    variables, count = data.shape[1], len(drives)
    length = min(int((drive == one).sum()) for one in drives)
    sets = {
        index: np.concatenate([data[drive == one][:length], np.tile(np.eye(count)[index], (length, 1))], axis=1)
        for index, one in enumerate(drives)
    }
    kinds = dict.fromkeys(range(variables), "system") | {variables: "space_dummy"}
    vectors = {at: [(at, 0)] for at in range(variables)} | {variables: [(variables + k, 0) for k in range(count)]}
    frame = DataFrame(sets, analysis_mode="multiple", vector_vars=vectors)
    search = JPCMCIplus(dataframe=frame, cond_ind_test=ParCorrMult(), node_classification=kinds, verbosity=0)
    return _parents(search.run_jpcmciplus(**PCMCI_SETTINGS), columns)


def _noisy(data: Values) -> Values:
    """What is constant for a while has no partial correlation."""
    return np.asarray(data + 1e-6 * np.random.default_rng(1).normal(size=data.shape) * data.std(axis=0))


def _parents(found: dict[str, Any], columns: dict[str, Values]) -> list[str]:
    """Columns with a link into the offset, or one without a direction."""
    graph = found["graph"]
    return [name for at, name in enumerate(columns, 1) if any(one in ("-->", "o-o", "o->") for one in graph[at, 0])]


def additive(offset: Values, columns: dict[str, Values], drive: Values) -> list[str]:
    """Additive model, whitened."""
    from scipy.stats import f as f_distribution
    from statsmodels.gam.api import BSplines
    from statsmodels.stats.multitest import multipletests

    from xosc_lateral.extras.loop.autocorrelation import Whitener, fit_autoregression

    valid = np.concatenate([[True], np.diff(drive) == 0])  # one second between drives
    level = np.bincount(drive, offset) / np.bincount(drive)
    process = fit_autoregression(np.where(valid, offset - level[drive], 0.0), valid, 12)
    whitener = Whitener(process, valid, drive, np.ones(len(offset)))
    bases = {}
    for name, values in columns.items():
        few = len(np.unique(values)) < 8
        basis = values[:, None] if few else BSplines(values[:, None], df=[5], degree=[3]).basis
        bases[name] = whitener.rows(basis - basis.mean(axis=0))
    response = whitener.rows(offset)
    everything = np.concatenate(list(bases.values()), axis=1)

    def squares(design: Values) -> tuple[float, int]:
        fitted = np.linalg.lstsq(design, response, rcond=1e-8)
        return float(np.square(response - design @ fitted[0]).sum()), int(fitted[2])

    full, rank = squares(everything)
    freedom = int(valid.sum()) - rank
    p_values = []
    for name in columns:
        rest, less = squares(np.concatenate([one for other, one in bases.items() if other != name], axis=1))
        extra = max(1, rank - less)
        p_values.append(float(f_distribution.sf((rest - full) / extra / (full / freedom), extra, freedom)))
    named = multipletests(p_values, 0.05, method="holm")[0]
    return [name for name, one in zip(columns, named, strict=True) if one]


def boosting(offset: Values, columns: dict[str, Values], drive: Values) -> list[str]:
    """Boosted trees with permutation importance under blocked cross-validation."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.inspection import permutation_importance

    lags = (0, 2, 4)
    design = np.concatenate([np.stack([np.roll(v, lag) for lag in lags], axis=1) for v in columns.values()], axis=1)
    many = len(np.unique(drive)) > 1
    fold = (drive if many else np.arange(len(offset)) // 150) % 5
    gains = []
    for one in range(5):
        held = fold == one
        model = HistGradientBoostingRegressor(max_iter=100, learning_rate=0.05, min_samples_leaf=60, random_state=1)
        model.fit(design[~held], offset[~held])
        seen = permutation_importance(model, design[held], offset[held], n_repeats=3, random_state=1)
        gains.append(seen.importances_mean.reshape(len(columns), len(lags)).sum(axis=1))
    mean, error = np.mean(gains, axis=0), np.std(gains, axis=0, ddof=1) / np.sqrt(5)
    return [name for name, m, e in zip(columns, mean, error, strict=True) if m > 2.0 * e and m > 0.0]


METHODS: dict[str, Callable[[Values, dict[str, Values], Values], list[str]]] = {
    "PCMCI+": pcmci_plus,
    "J-PCMCI+": joint_pcmci_plus,
    "additive model": additive,
    "boosting": boosting,
}


def judged(case: dict[str, Any], named: list[str]) -> tuple[bool | None, list[str]]:
    """Whether all planted columns are named, and what else is; products are sets of columns here."""
    plain = sorted({name.split(" ")[0] for name in named})
    if "accepted" not in case:
        return None, plain
    allowed = {column for one in case["accepted"] for column in one}
    return any(set(one) <= set(plain) for one in case["accepted"]), [one for one in plain if one not in allowed]


def run(case: dict[str, Any], protocol: dict[str, Any]) -> dict[str, Any]:
    """All methods on one drive."""
    series = by_second(planted_drive(case, protocol, protocol["drives"]["long_s"])[1])
    outcome = dict(case)
    for name, method in METHODS.items():
        if name == "J-PCMCI+" and not case["type"].endswith("short"):
            continue
        started = time.process_time()
        named = method(*series)
        correct, other = judged(case, named)
        outcome[name] = {"right": correct, "false": other, "cpu_s": round(time.process_time() - started, 1)}
    return outcome


def table_of(outcomes: list[dict[str, Any]], loop: dict[int, dict[str, Any]]) -> str:
    """Markdown: right, missed, tables with something false, seconds; by method."""
    lines = ["| method | drives | effects | right | missed | false | seconds |", "|---|---|---|---|---|---|---|"]
    for short in (False, True):
        own = [one for one in outcomes if one["type"].endswith("short") == short and one["seed"] in loop]
        planted = [one for one in own if "accepted" in one]
        what = "many short" if short else "one long"
        for name in (name for name in METHODS if own and name in own[0]):
            hits = sum(one[name]["right"] for one in planted)
            wrong = sum(bool(one[name]["false"]) for one in own)
            seconds = np.median([one[name]["cpu_s"] for one in own])
            lines.append(_line(name, f"{len(own)}, {what}", len(planted), hits, wrong, seconds))
        mine = [loop[one["seed"]] for one in own]
        hits = sum(right(one) for one in mine if "accepted" in one)
        wrong = sum(bool(false(one)) for one in mine)
        seconds = np.median([one["cpu_s"] for one in mine])
        lines.append(_line("this loop", f"{len(own)}, {what}", len(planted), hits, wrong, seconds))
    return "\n".join(lines)


def _line(method: str, drives: str, planted: int, hits: int, wrong: int, seconds: float) -> str:
    return f"| {method} | {drives} | {planted} | {hits} | {planted - hits} | {wrong} | {seconds:.1f} |"


def main() -> None:
    """Run, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", default="design", choices=SETS)
    parser.add_argument("--every", type=int, default=1, help="every N-th drive of the set")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th of them from the K-th on")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--loop", type=Path, help="what identification_study wrote for the same set")
    args = parser.parse_args()
    if args.table is not None:
        read = [json.loads(line) for line in args.table.read_text(encoding="utf-8").splitlines()]
        loop = [json.loads(line) for line in args.loop.read_text(encoding="utf-8").splitlines()]
        print(table_of(read, {one["seed"]: one for one in loop}))
        return
    protocol = tomllib.loads(PROTOCOL.read_text(encoding="utf-8"))
    chosen = [
        case
        for case in cases(protocol, args.set, 1.0)
        if case["type"] in ("null", "null_short", "effect", "effect_short")
        and "factor" not in case
        and not case["name"].startswith("slow vehicles")
    ]
    part, parts = map(int, args.part.split("/"))
    for case in chosen[:: args.every][part::parts]:
        outcome = run(case, protocol)
        print(
            case["name"],
            case.get("size", ""),
            case["seed"],
            {k: v for k, v in outcome.items() if k in METHODS},
            flush=True,
        )
        if args.output is not None:
            with args.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(outcome) + "\n")


if __name__ == "__main__":
    main()
