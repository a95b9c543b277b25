"""A stand-in for your own measurement: one driver, three drives of a quarter of an hour, who cuts curves.

python examples/simulated_drives.py [OUTPUT FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd
from driver_simulator import curve_cutting, simulate_drive


def main(out: Path) -> None:
    """Simulate the drives and write them as one drive table."""
    out.mkdir(parents=True, exist_ok=True)
    table = curve_cutter()
    table.to_csv(out / "drives.csv.gz", index=False)
    print(f"{len(table)} rows of {table['drive'].nunique()} drives in {out / 'drives.csv.gz'}")
    print(f"columns: {', '.join(table.columns)}")


def curve_cutter(drives: int = 3, duration: float = 900.0) -> pd.DataFrame:
    """Drives of somebody who aims to the inside of curves, 1.2 s ahead: 0.3 m from sharp right to sharp left ones."""
    effect = curve_cutting(0.3, look_ahead=1.2)
    made = [simulate_drive(duration, seed=11 + number, effects=[effect]).table for number in range(drives)]
    return pd.concat([table.assign(drive=f"day {number}") for number, table in enumerate(made, start=1)])


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/examples"))
