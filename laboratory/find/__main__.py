"""Find what nobody thought of: scenarios, recordings and drivers from seeds, judged and shrunk.

    python -m laboratory.find OUT [--minutes 20] [--seed N] [--only scenarios recordings drivers] [--library PATH]

OUT/table.md: kinds, told by a message or silent, how often, with the seed of the smallest input of each; OUT/kinds/
holds these inputs, OUT/NAME.jsonl a line per seed. A seed gives the same input and the same findings again. Scenarios
are played by esmini's library (PATH, or what `ESMINI_LIBRARY` names), else by our own player alone. `--null N` plays N
scenarios against themselves instead: nothing may be found.
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from pathlib import Path

from laboratory.find.drivers import Drivers
from laboratory.find.engine import HEAD, Machine, find, spec_of
from laboratory.find.recordings import Recordings
from laboratory.find.scenarios import Planted, Scenarios

SHARES = {"scenarios": 0.5, "recordings": 0.15, "drivers": 0.35}
"""Of the time: a scenario takes seconds, a recording a third of one, a closed loop half a minute. [-]"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder")
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, help="the first; default: by the clock")
    parser.add_argument("--most", type=int, help="seeds of each machine")
    parser.add_argument("--only", nargs="+", choices=list(SHARES), default=list(SHARES))
    parser.add_argument("--library", default=os.environ.get("ESMINI_LIBRARY"))
    parser.add_argument("--null", type=int, metavar="N")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    first = int(time.time()) % 10**6 * 1000 if options.seed is None else options.seed
    if options.null:
        machine = Planted()
        found = {seed: machine.look(spec_of(machine, seed)) for seed in range(first, first + options.null)}
        print(f"{sum(map(bool, found.values()))} of {options.null} scenarios from seed {first} differ from themselves")
        return
    machines: list[Machine] = [Scenarios(options.library), Recordings(), Drivers()]
    rows = [HEAD]
    whole = sum(SHARES[name] for name in options.only)
    for machine in machines:
        if machine.name in options.only:
            seconds = 60.0 * options.minutes * SHARES[machine.name] / whole
            rows += find(machine, options.out, seconds, first, most=options.most)
            page = "\n".join([f"Seeds from {first} on.\n", *rows, ""])
            (options.out / "table.md").write_text(page, encoding="utf-8")
    print("\n".join(rows), f"seeds from {first} on: {options.out / 'table.md'}", sep="\n")


if __name__ == "__main__":
    main()
