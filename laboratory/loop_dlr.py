"""The closed loop over real motorway traffic: figures and tables of docs/closing_the_loop.md.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.loop_dlr dlr.parquet [--seed 20241007] [--write PAGE.md]
        [--figures docs/figures]

Starts from a two-level model of the same drives, as `make loop-dlr` does.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from laboratory.library import SEED
from laboratory.markers import show
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.extras.loop.close import LoopResult, close_loop
from xosc_lateral.extras.loop.loop_figures import DRAWINGS, effect_figure, residual_figure, spectrum_figure
from xosc_lateral.extras.loop.loop_words import loop_text
from xosc_lateral.extras.loop.residual import LackOfFit
from xosc_lateral.files.drives import read_drives


def main() -> None:
    """Run the loop, print what it found, write figures and table where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--write", type=Path, metavar="PAGE.md")
    parser.add_argument("--figures", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    started = time.perf_counter()
    drives = read_drives([args.table])
    base = fit_profile(drives, name="motorway-base", model=ModelKind.TWO_LEVEL)
    result = close_loop(drives, base, seed=args.seed, name="motorway-refined")
    took = time.perf_counter() - started
    show(
        f"```\n{loop_text(result)}\n```\n\nIn {took:.0f} s.\n\n{group_table(result.lack_of_fit)}",
        args.write,
        "loop-dlr",
    )
    if args.figures is not None:
        draw(result, args.figures)


def group_table(lack_of_fit: LackOfFit) -> str:
    """Every group of cells, most left unexplained first."""
    rows = ["| cells | before [mm] | after [mm] | floor [mm] | after / floor |", "|---|---|---|---|---|"]
    for group in sorted(lack_of_fit.groups, key=lambda group: group.floor**2 - group.after**2):
        numbers = f"{1e3 * group.before:.1f} | {1e3 * group.after:.1f} | {1e3 * group.floor:.1f}"
        rows.append(f"| {group.name} | {numbers} | {group.after / group.floor:.2f} |")
    return "\n".join(rows)


def draw(result: LoopResult, folder: Path) -> None:
    """Figures on white, which light and dark pages show alike."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, finding in enumerate(result.findings, 1):
        if finding.columns:
            name = "_".join([str(number), *finding.columns])  # one column may act in several ways
            effect_figure(result, finding).save(folder / f"loop_dlr_{name}.svg")
        else:
            figure, _ = DRAWINGS[finding.kind]
            figure(result, finding).save(folder / f"loop_dlr_{finding.kind}.svg")
    spectrum_figure(result).save(folder / "loop_dlr_spectrum.svg")
    residual_figure(result, "mean").save(folder / "loop_dlr_residual.svg")


if __name__ == "__main__":
    main()
