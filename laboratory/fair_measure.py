"""How near are free runs to real ones, beside other real drivers? The fair measure on held-out vehicles.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.fair_measure dlr.parquet [--seed 0] [--no-classify]
        [--write PAGE.md]

A profile is fitted to a random half of the vehicles and measured on the other half, and the other way round; numbers
are means of both.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import Drive, all_runs
from xosc_lateral.drivers.evaluation.realism import ConditionScores, Realism, score_realism
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.files.drives import read_drives
from xosc_lateral.workflows.profiles.realism_text import FAMILY_LABELS


def halves(drives: Sequence[Drive], seed: int) -> tuple[list[Drive], list[Drive]]:
    names = sorted(drive.name for drive in drives)
    chosen = set(np.random.default_rng(seed).permutation(names)[: len(names) // 2].tolist())
    return [one for one in drives if one.name in chosen], [one for one in drives if one.name not in chosen]


def measure(drives: Sequence[Drive], seed: int, model: str, *, classify: bool) -> list[Realism]:
    one, other = halves(drives, seed)
    found = []
    for fitted, held_out in ((one, other), (other, one)):
        profile = fit_profile(fitted, name="half", model=model)
        found.append(score_realism(profile, all_runs(held_out), seed=seed, classify=classify))
    return found


def table(parts: Sequence[Realism]) -> list[str]:
    columns = list(FAMILY_LABELS.values())
    columns += ["AUC", "with context", "AUC of real drivers", "AUC by convolutions"]
    lines = [f"| snippets | sampled | {' | '.join(columns)} |", "|---" * (len(columns) + 2) + "|"]
    for scores in parts[0].conditions:
        several = [part.of(scores.condition) for part in parts]
        known = [one for one in several if one is not None]
        lines.append(_line(known))
    return lines


def _line(parts: Sequence[ConditionScores]) -> str:
    cells = []
    for family in FAMILY_LABELS:
        found = [one.families[family] for one in parts if family in one.families]
        ratio = np.exp(np.mean([np.log(one.ratio) for one in found])) if found else np.nan
        cells.append(f"{ratio:.2f}" if found else "")
    for which in ("alone", "jointly", "floor"):
        areas = [area for one in parts if (area := getattr(one, which)) is not None]
        cells.append(" / ".join(f"{area.auc:.3f}" for area in areas))
    what = "driver and sensor" if parts[0].with_sensor else "driver"
    return f"| {parts[0].condition.name} | {what} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--model", default=ModelKind.AUTOREGRESSIVE)
    parser.add_argument("--no-classify", action="store_true")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    parts = measure(read_drives(args.table), args.seed, args.model, classify=not args.no_classify)
    show("\n".join(table(parts)), args.write, "fair-measure")


if __name__ == "__main__":
    main()
