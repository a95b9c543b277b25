"""How often the loop calls a residual unexplained on simulated drives without an effect (1 in 20 is what it may).

python -m benchmarks.loop_leftover [--nulls 30] [--duration 3000]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.loop_study import measured
from tests.simulators.driver_simulator import simulate_drive
from xosc_lateral.loop.close import close_loop
from xosc_lateral.loop.leftover import leftover_of

FIRST_SEED = 20


def main() -> None:
    """Print a line per drive, and the count."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--nulls", type=int, default=30)
    ask.add_argument("--duration", type=float, default=3000.0)
    said = ask.parse_args()
    called = 0
    with TemporaryDirectory() as folder:
        for seed in range(FIRST_SEED, FIRST_SEED + said.nulls):
            result = close_loop(measured(simulate_drive(said.duration, seed), Path(folder)), seed=1)
            left = leftover_of(result)
            called += left.clear
            found = ", ".join(finding.effect for finding in result.findings) or "nothing"
            errors = f"error {result.error_after:.4f} m, floor {result.floor:.4f} m, p = {left.p_value:.3f}"
            print(f"{seed}: found {found}; {errors}{'; called unexplained' if left.clear else ''}", flush=True)
    print(f"a residual is called unexplained on {called} of {said.nulls} drives without an effect")


if __name__ == "__main__":
    main()
