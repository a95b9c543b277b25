"""Sets of variants in the reference player: what it draws from a set, row for row beside the variant itself.

    python -m benchmarks.variant_sets SCENARIO... --esmini PATH [--variants 2]

Converts each scenario into variants and their set, plays every variant alone and as drawn from the distribution, and
prints the largest difference of any row.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.agreement import reference_rows
from xosc_lateral.cli import main as run
from xosc_lateral.errors import XoscLateralError

STEP, LIMIT = 0.02, 60.0
"""Of the runs. [s]"""


def differences(scenario: Path, esmini: Path, variants: int) -> list[tuple[float, float]]:
    """Of every variant and its draw: the largest distance [m] and difference in speed [m/s]; infinite if rows lack."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "x.xosc"
        words = ["convert", str(scenario), "-o", str(target), "--variants", str(variants), "-q", "--allow", "/"]
        if run(words) != 0:
            raise XoscLateralError(f"{scenario}: not converted")
        for k in range(variants):
            alone = reference_rows(esmini, target.with_name(f"x_{k + 1:02d}.xosc"), STEP, LIMIT)
            chosen = ("--param_permutation", str(k))
            drawn = reference_rows(esmini, target.with_name("x_distribution.xosc"), STEP, LIMIT, chosen)
            if len(drawn) != len(alone) or not len(alone) or not (drawn["name"] == alone["name"]).all():
                found.append((np.inf, np.inf))
                continue
            away = np.hypot(drawn["x"] - alone["x"], drawn["y"] - alone["y"]).max()
            found.append((float(away), float((drawn["speed"] - alone["speed"]).abs().max())))
    return found


def main() -> None:
    """Print a line per scenario, and the largest difference of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", type=Path, nargs="+")
    parser.add_argument("--esmini", type=Path, required=True)
    parser.add_argument("--variants", type=int, default=2)
    options = parser.parse_args()
    every = []
    for path in options.scenario:
        try:
            found = differences(path, options.esmini.resolve(), options.variants)
        except XoscLateralError as error:
            print(error)
            continue
        every += found
        print(f"{path.name}: {max(found)}", flush=True)
    away, faster = np.max(every, axis=0)
    print(f"{len(every)} draws: at most {away:g} m and {faster:g} m/s from the variant alone")


if __name__ == "__main__":
    main()
