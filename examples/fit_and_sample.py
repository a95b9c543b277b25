"""Measured drives into a driver profile, and the profile into new offsets.

    python examples/fit_and_sample.py [OUTPUT FOLDER [TABLE OF DRIVES]]

Without a table of your own, three simulated drivers stand in.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from driver_simulator import simulate_population

import xosc_lateral as xl


def main(out: Path, table: Path | None = None) -> None:
    """Fit the paper's model and ours; sample ten minutes from both."""
    out.mkdir(parents=True, exist_ok=True)
    drives = simulate_population(3, duration=600.0, seed=3) if table is None else table  # a frame or a file: the same

    measured = np.concatenate([drive.offset for drive in xl.read_drives(drives)])
    print(f"measured      : offset +-{measured.std():.3f} m")
    for model in ("two-level", "autoregressive"):
        profile = xl.fit(drives, name=f"example-{model}", model=model)
        xl.write_profile(profile, out / f"{profile.name}.json")
        offsets = xl.sample(profile, duration=600.0, speed=33.0, seed=1)
        print(f"{model:14}: offset +-{offsets.to_frame()['offset'].std():.3f} m")
        offsets.write(out / f"{profile.name}.csv")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3])) if len(sys.argv) > 1 else main(Path("out/examples"))
