"""What the loop names on drives of `simulated.preview_driver`.

`python -m benchmarks.preview_study design|validation|test [KIND ...]`

One line per drive: what was found, whether it is what was planted, columns that were dismissed, and for a spread that
changes with time the ratio of the loudest sixth of the drive to the quietest, measured and sampled.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.simulated import preview_driver
from xosc_lateral.formats.drives import drives_of_table
from xosc_lateral.identification.close import LoopResult, close_loop

BENDS = ({"curvature"}, {"crossfall"}, {"curvature", "speed"}, {"crossfall", "speed"})
"""By which the effect of the bends may be named: crossfall follows from curvature."""


def verdict(result: LoopResult, act: preview_driver.Act) -> tuple[str, bool, int]:
    """Everything found, whether what was planted is among it, and how many findings are wrong."""
    planted = bool(act.columns or act.target or act.log_spread or act.camera)
    words, hit, wrong = [], not planted, 0
    for one in result.findings:
        columns = set(one.columns)
        right = planted and (columns <= set(act.columns) if act.columns else not columns and one.kind != "regime")
        hit |= right and bool(columns) == bool(act.columns)
        wrong += not right and columns not in BENDS
        size = f"{one.size_m:.2f} p {one.p_value:.0e} {one.shape}"
        words.append(f"{'' if right or columns in BENDS else '!'}{one.kind} {'*'.join(one.columns) or 'time'} {size}")
    return "; ".join(words) or "nothing", hit, wrong


def spread_ratio(result: LoopResult) -> tuple[float, float]:
    """Largest over smallest spread of the sixths of the drive, measured and of the refined profile's runs."""
    real, after = (side["spread by time"] for side in (result.scored.real, result.scored.after))
    high, low = int(np.nanargmax(real)), int(np.nanargmin(real))
    return float(real[high] / real[low]), float(after[high] / after[low])


def main(which: str, names: list[str]) -> None:
    """Print a line per drive, then the sums."""
    seeds = {"design": preview_driver.DESIGN, "validation": preview_driver.VALIDATION, "test": preview_driver.TEST}[
        which
    ]
    hits = wrongs = 0
    for kind in names or list(seeds):
        drive = preview_driver.simulate(kind, seeds[kind])
        result = close_loop(drives_of_table(drive.table, {}), seed=1)
        words, hit, wrong = verdict(result, drive.act)
        hits, wrongs = hits + hit, wrongs + wrong
        road = {"curvature", "crossfall", "grade"}
        dismissed = road & {item.column for item in result.identified.usable.feedback}
        back = "; ".join(f"{one.component} {'*'.join(one.columns)}" for one in result.identified.taken_back)
        ratio = "{:.2f} sampled {:.2f}".format(*spread_ratio(result))
        error = f"{1000 * result.error_before:.1f} -> {1000 * result.error_after:.1f} ({1000 * result.floor:.1f}) mm"
        print(f"{kind}: {'ok' if hit else 'MISSED'} | {words} | back: {back or '-'} | dismissed {dismissed or '-'} "
              f"| spread ratio {ratio} | {error}", flush=True)  # fmt: skip
    print(f"named {hits} of {len(names or seeds)}, wrong {wrongs}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
