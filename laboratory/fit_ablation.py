"""Which settings of the fit does the recording ask for? The memory's length by prediction, the rest by held-out drives.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.fit_ablation dlr.parquet [--halves 4] [--write PAGE.md]

The sensor's part is taken out first, as `fit` does. Order: mean squared error of the coarse movement one second ahead,
five folds over drives, beside the best order, with its standard error over drives. Settings of the rounds: drives are
halved at random, one half is fitted, snippets of the other half are sampled from their starts; mean distance of the ten
metrics less that of the shipped settings, on the same drives, with the standard error over the halves.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.markers import show
from laboratory.model_choice import LENGTHS, snippets
from tests.kit.snippet_distances import snippet_distances
from xosc_lateral.drivers.drives.drive import STEP, Run, all_runs
from xosc_lateral.drivers.evaluation.metrics import split_groups
from xosc_lateral.drivers.fitting.fitting import driver_runs
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import DEFAULT_SETTINGS
from xosc_lateral.drivers.fitting.models.autoregressive_fit import fit_autoregressive, simulate
from xosc_lateral.drivers.fitting.models.likelihood import fit_autoregression
from xosc_lateral.drivers.model.core.autoregressive.parameters import COARSE_EVERY, split_bands
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]
ORDERS = (1, 2, 3, 4, 6, 8, 12, 16, 20, 24)
FOLDS = 5
SEED = 20261122
VARIANTS: dict[str, dict[str, object]] = {
    "as shipped": {},
    "order 4": {"order": 4},
    "order 8": {"order": 8},
    "order 12": {"order": 12},
    "order 20": {"order": 20},
    "no rounds": {"rounds": 0},
    "1 round": {"rounds": 1},
    "2 rounds": {"rounds": 2},
    "4 rounds": {"rounds": 4},
    "8 rounds": {"rounds": 8},
}


def order_table(runs: Sequence[Run]) -> list[str]:
    """Prediction error by order, held out by drive."""
    mean = float(np.concatenate([run.rel_offset for run in runs]).mean())
    slow = [split_bands(run.rel_offset - mean, STEP)[0] for run in runs]
    names = sorted({run.drive for run in runs})
    fold = dict(zip(names, np.random.default_rng(SEED).permutation(len(names)) % FOLDS, strict=True))
    errors = np.array([_errors(order, runs, slow, fold) for order in ORDERS])
    errors = errors[:, np.isfinite(errors).all(axis=0)]
    total = errors.mean(axis=1)
    best = int(np.argmin(total))
    spread = (errors - errors[best]).std(axis=1) / np.sqrt(errors.shape[1]) / total[best]
    lines = ["| order [s] | error over the best order's | standard error |", "|---|---|---|"]
    lines += [
        f"| {order} | {value / total[best] - 1.0:+.2%} | {error:.2%} |"
        for order, value, error in zip(ORDERS, total, spread, strict=True)
    ]
    near = next(k for k in range(len(ORDERS)) if total[k] <= total[best] * (1.0 + spread[k]))
    return [
        *lines,
        "",
        f"Least error at {ORDERS[best]} s; the smallest order within a standard error of it: {ORDERS[near]} s.",
    ]


def _errors(order: int, runs: Sequence[Run], slow: Sequence[FloatArray], fold: dict[str, int]) -> list[float]:
    """Mean squared error of each drive over all moments that every order can predict, in square lane widths."""
    past = COARSE_EVERY * max(ORDERS)
    sums: dict[str, list[float]] = {name: [0.0, 0.0] for name in fold}
    for number in range(FOLDS):
        train = [k for k, run in enumerate(runs) if fold[run.drive] != number]
        model, _ = fit_autoregression(
            [slow[k] for k in train], order, every=COARSE_EVERY, drivers=[runs[k].drive for k in train]
        )
        for run, series in zip(runs, slow, strict=True):
            if fold[run.drive] == number and len(series) > past + COARSE_EVERY:
                lags = [series[past - COARSE_EVERY * k : len(series) - COARSE_EVERY * k] for k in range(1, order + 1)]
                rest = series[past:] - np.array(lags).T @ model.coefficients
                sums[run.drive][0] += float(rest @ rest)
                sums[run.drive][1] += len(rest)
    return [total / count if count else np.nan for total, count in sums.values()]


def variant_table(runs: Sequence[Run], halves: int) -> list[str]:
    """Held-out distance of every variant beside the shipped one's."""
    rng = np.random.default_rng(SEED)
    drives = np.array([run.drive for run in runs])
    found: dict[str, list[list[float]]] = {name: [] for name in VARIANTS}
    for _ in range(-(-halves // 2)):
        chosen = split_groups(drives, rng)
        for taken in (chosen, ~chosen):
            train, test = ([run for run, one in zip(runs, side, strict=True) if one] for side in (taken, ~taken))
            for name, settings in VARIANTS.items():
                found[name].append(_distances(train, test, settings))
    shipped = np.array(found["as shipped"])
    lines = ["| settings | " + " | ".join(f"ten metrics, {one}" for one in LENGTHS) + " |", "|---" * 3 + "|"]
    for name, rows in found.items():
        apart = np.array(rows) - shipped
        error = apart.std(axis=0, ddof=1) / np.sqrt(len(apart))
        cells = [f"{a:+.4f} ± {e:.4f}" for a, e in zip(apart.mean(axis=0), error, strict=True)]
        if name == "as shipped":
            cells = [f"{value:.4f}" for value in shipped.mean(axis=0)]
        lines.append("| " + " | ".join([name, *cells]) + " |")
        print(lines[-1], flush=True)
    return [*lines, "", f"{len(shipped)} halves."]


def _distances(train: Sequence[Run], test: Sequence[Run], settings: dict[str, object]) -> list[float]:
    model = fit_autoregressive(
        [run.rel_offset for run in train],
        [run.drive for run in train],
        dataclasses.replace(DEFAULT_SETTINGS, **settings),  # type: ignore[arg-type]
    )
    found = []
    for length in LENGTHS.values():
        real, _ = snippets(test, length)
        made = [simulate(model, length, SEED + k, drivers=len(real), starts=real[:, 0]) for k in range(4)]
        found.append(float(np.mean([snippet_distances(real, one).mean for one in made])))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--halves", type=int, default=4)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    drives = read_drives(args.table)
    runs, _ = driver_runs(all_runs(drives), drives)
    show("\n".join([*order_table(runs), "", *variant_table(runs, args.halves)]), args.write, "fit-ablation")


if __name__ == "__main__":
    main()
