"""How much of the board's ranking is the luck of the split? Scores of both halves, over several splits of the vehicles.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m benchmarks.board_stability dlr.parquet [--seeds 0 1 2 ...] [--model NAME ...] [--cache FOLDER]
        [--write PAGE.md]

Seed 0 is the split of the published board. Every split fits every model twice, which takes a quarter of an hour of
processor time; with `--cache`, what is there is not done again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from benchmarks.board.benchmark import fit_and_sample, split_in_halves
from benchmarks.board.contestants import contestants
from benchmarks.board.models.catalogue import MODELS
from benchmarks.board.ranking import half_score, kendall_tau
from benchmarks.markers import show
from xosc_lateral.drives.cuts import all_runs
from xosc_lateral.drives.drive import Run
from xosc_lateral.formats.drives import read_drives

Scores = Mapping[str, tuple[float, float]]


def scores_of(runs: Sequence[Run], seed: int, models: Sequence[str], cache: Path | None) -> Scores:
    """Score of each model on either half, as on the board."""
    split = split_in_halves(runs, seed)
    found: dict[str, tuple[float, float]] = {}
    for number, entry in enumerate(contestants(None, ())):
        if entry.key not in models:
            continue
        kept = None if cache is None else cache / f"{entry.key}-{seed}.json"
        if kept is not None and kept.exists():
            one, other = json.loads(kept.read_text(encoding="utf-8"))
        else:
            sampled = [fit_and_sample(entry, half, (seed, 3, number, which)) for which, half in enumerate(split)]
            one, other = (half_score(half, own) for half, own in zip(split, sampled, strict=True))
            if kept is not None:
                kept.write_text(json.dumps([one, other]), encoding="utf-8")
        found[entry.key] = one, other
    return found


def swapped(scores: Scores) -> list[tuple[str, str]]:
    """Pairs of models whose order the halves do not agree on."""
    return [
        (a, b)
        for a, b in combinations(scores, 2)
        if (scores[a][0] - scores[b][0]) * (scores[a][1] - scores[b][1]) < 0.0
    ]


def table(by_seed: Mapping[int, Scores]) -> str:
    every = list(by_seed.values())
    mean = {key: float(np.exp(np.mean(np.log([one[key] for one in every])))) for key in every[0]}
    order = sorted(mean, key=lambda key: mean[key])
    lines = [
        "| model | " + " | ".join(f"split {seed}" for seed in by_seed) + " |",
        "|---" * (len(by_seed) + 1) + "|",
        *(
            f"| {MODELS[key].title} | " + " | ".join(f"{one[key][0]:.2f} / {one[key][1]:.2f}" for one in every) + " |"
            for key in order
        ),
    ]
    taus = [kendall_tau(*np.array([one[key] for key in order]).T.tolist()) for one in every]
    lines.append("| Kendall's tau | " + " | ".join(f"{tau:.3f}" for tau in taus) + " |")
    text = "\n".join(lines) + "\n"
    if len(taus) > 1:
        text += f"\nTau: mean {np.mean(taus):.3f}, {min(taus):.3f} to {max(taus):.3f}."
    pairs = [f"{MODELS[a].title} and {MODELS[b].title}" for one in every for a, b in swapped(one)]
    return (
        text
        + "\nSwapped: "
        + ("; ".join(f"{pair} ({pairs.count(pair)})" for pair in dict.fromkeys(pairs)) or "none")
        + "."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--model", nargs="+", choices=list(MODELS), default=list(MODELS))
    parser.add_argument("--cache", type=Path)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    if args.cache is not None:
        args.cache.mkdir(parents=True, exist_ok=True)
    runs = all_runs(read_drives(args.table))
    show(
        table({seed: scores_of(runs, seed, args.model, args.cache) for seed in args.seeds}),
        args.write,
        "board-stability",
    )


if __name__ == "__main__":
    main()
