"""What the loop names on drives of `simulated.preview_driver`.

`python -m laboratory.preview_study design|validation|test [--whole] [KIND ...]`: one line per drive with everything
that is selected, "!" where it is not what was planted. With `--whole` folds and held-out blocks judge as well,
and for a spread that changes with time the ratio of the loudest sixth of the drive to the quietest is shown, measured
and sampled.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from tests.kit.simulated import preview_driver
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.loop.close import LoopResult, close_loop
from xosc_lateral.drivers.loop.identify import usable_columns
from xosc_lateral.drivers.loop.search import Search
from xosc_lateral.drivers.loop.selection import ERROR_BUDGET, Accepted, select
from xosc_lateral.drivers.loop.timeline import Coarse, join_drives
from xosc_lateral.files.drives import drives_of_table

BENDS = {"curvature", "crossfall", "speed"}
"""By which what bends do may be named: crossfall goes along with curvature, and speed changes how the car turns."""

SEEDS = {"design": preview_driver.DESIGN, "validation": preview_driver.VALIDATION, "test": preview_driver.TEST}


def verdict(accepted: Sequence[Accepted], act: preview_driver.Act) -> tuple[str, bool, int]:
    """Everything found, whether what was planted is among it, and how many findings are wrong."""
    planted = bool(act.columns or act.target or act.log_spread or act.camera)
    words, hit, wrong = [], not planted, 0
    for one in accepted:
        columns = set(one.term.columns)
        named = planted and (columns == set(act.columns) if act.columns else one.term.component.startswith("time_"))
        hit |= named
        of_bends = bool(columns) and columns <= BENDS
        wrong += not named and not of_bends
        sign = "" if named or of_bends else "!"
        words.append(f"{sign}{one.term.component} {'*'.join(one.term.columns)} {one.p_value:.0e}")
    return "; ".join(words) or "nothing", hit, wrong


def selected(drives: Sequence[Drive]) -> tuple[Sequence[Accepted], set[str]]:
    """What is selected, and columns that are dismissed as consequences."""
    coarse = Coarse.of(join_drives(drives))
    usable = usable_columns(coarse.timeline)
    with threadpool_limits(1, user_api="blas"):
        found = select(Search.over(coarse, usable.columns, np.random.SeedSequence(1), ERROR_BUDGET))
    return found.accepted, {item.column for item in usable.feedback}


def spread_ratio(result: LoopResult) -> tuple[float, float]:
    """Largest over smallest spread of the sixths of the drive, measured and of the refined profile's runs."""
    real, after = (side["spread by time"] for side in (result.scored.real, result.scored.after))
    high, low = int(np.nanargmax(real)), int(np.nanargmin(real))
    return float(real[high] / real[low]), float(after[high] / after[low])


def main(argv: Sequence[str] | None = None) -> None:
    """Print a line per drive, then the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", choices=list(SEEDS))
    parser.add_argument("kind", nargs="*")
    parser.add_argument("--whole", action="store_true", help="close the loop: folds and held-out blocks judge as well")
    args = parser.parse_args(argv)
    which, names, whole = args.set, args.kind, args.whole
    hits = wrongs = 0
    for kind in names or list(SEEDS[which]):
        drive = preview_driver.simulate(kind, SEEDS[which][kind])
        drives, more = drives_of_table(drive.table, {}), ""
        if whole:
            result = close_loop(drives, seed=1)
            accepted = result.identified.selection.accepted
            follow = {item.column for item in result.identified.usable.feedback}
            more = " | spread ratio {:.2f}, sampled {:.2f}".format(*spread_ratio(result))
            more += f" | {1000 * result.error_before:.1f} -> {1000 * result.error_after:.1f} mm"
        else:
            accepted, follow = selected(drives)
        words, hit, wrong = verdict(accepted, drive.act)
        hits, wrongs = hits + hit, wrongs + wrong
        dismissed = ", ".join(sorted(follow & {"curvature", "crossfall", "grade"})) or "no road"
        print(f"{kind}: {'named' if hit else 'MISSED'} | {words} | dismissed: {dismissed}{more}", flush=True)
    print(f"named {hits} of {len(names or SEEDS[which])}, wrong {wrongs}")


if __name__ == "__main__":
    main()
