"""Slow and standing cars of the template `jam-end` in the reference player, beside its nominal run there.

    python -m laboratory.jam_end ESMINI [--seeds 40]

ESMINI is esmini's executable. Lateral movement over 2 s at 3 to 8 m/s over that at 10 to 12.5 m/s, with an interval by
drawing cars; how far standing cars are spread, and moves while standing. States: `docs/validation/driver_model.md`.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

import xosc_lateral as xl
from laboratory.agreement import reference_rows

STEP, WINDOW, END = 0.05, 40, 55.0
SLOW, FASTER = (3.0, 8.0), (10.0, 12.5)
"""[m/s]"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("esmini", type=Path)
    parser.add_argument("--seeds", type=int, default=40)
    args = parser.parse_args()
    sums, standing, slid = [], [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        template, _ = xl.write_template("jam-end", folder)
        nominal = reference_rows(args.esmini, template, STEP, END)
        for seed in range(1, 1 + args.seeds):
            output = Path(folder) / "moved.xosc"
            xl.convert(template, output, seed=seed, ego=["none"], mode="trajectory", neighbours="none")
            both = reference_rows(args.esmini, output, STEP, END).merge(
                nominal, on=["name", "time"], suffixes=("", "_0")
            )
            for _, rows in both.groupby("name"):
                x, y, heading = (rows[name].to_numpy() for name in ("x", "y", "h_0"))
                beside = (y - rows["y_0"].to_numpy()) * np.cos(heading) - (x - rows["x_0"].to_numpy()) * np.sin(heading)
                moved = np.abs(beside[WINDOW:] - beside[:-WINDOW])
                speed = np.lib.stride_tricks.sliding_window_view(rows["speed_0"].to_numpy(), WINDOW + 1)
                mean, stands = speed.mean(axis=1), speed.max(axis=1) == 0.0
                parts = [moved[(mean >= low) & (mean < high)] for low, high in (SLOW, FASTER)]
                sums.append([value for part in parts for value in (float(part @ part), len(part))])
                if stands.any():
                    standing.append(beside[-1])
                    slid = max(slid, float(moved[stands].max()))
    table, rng = np.array(sums), np.random.default_rng(1)
    drawn = [table[rng.integers(0, len(table), len(table))].sum(axis=0) for _ in range(1000)]
    ratios = [float(np.sqrt(a / n / (b / m))) for a, n, b, m in [table.sum(axis=0), *drawn]]
    low, high = np.quantile(ratios[1:], [0.025, 0.975])
    print(f"lateral speed at 3 to 8 m/s: {ratios[0]:.2f} ({low:.2f} to {high:.2f}) of that at 10 to 12.5 m/s")
    print(f"{len(standing)} standing cars: spread {np.std(standing):.2f} m, {slid:.4f} m at most while they stand")


if __name__ == "__main__":
    main()
