"""Measured drives into a driver profile, and the profile into new offsets.

    python examples/fit_and_sample.py [OUTPUT FOLDER [TABLE OF DRIVES]]

Without a table of your own, three simulated drivers stand in: see `tests/simulators`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from xosc_lateral.driver.fitting import fit_profile
from xosc_lateral.driver.series import all_runs
from xosc_lateral.driver.snippets import sample_free
from xosc_lateral.formats.drives import read_drives
from xosc_lateral.formats.profiles import write_profile


def main(out: Path, table: Path | None = None) -> None:
    """Fit the paper's model and ours; sample ten minutes from both."""
    out.mkdir(parents=True, exist_ok=True)
    drives = read_drives(table if table is not None else simulated(out / "drives.csv.gz"))

    measured = np.concatenate([run.offset for run in all_runs(drives)])
    print(f"measured : {spread(measured)}, {len(measured) / 5 / 3600:.2f} h")
    for model in ("two-level", "best"):
        profile = fit_profile(drives, name=f"example-{model}", model=model)
        write_profile(profile, out / f"{profile.name}.json")
        (sampled,) = sample_free(profile, 600.0, seed=1, speed=33.0)
        print(f"{model:9}: {spread(sampled.offset)}")


def spread(offset: np.ndarray) -> str:
    """Standard deviation of the offset, and of its change within 0.2 s."""
    return f"offset +-{np.std(offset):.3f} m, change in 0.2 s +-{np.std(np.diff(offset)):.3f} m"


def simulated(path: Path) -> Path:
    """Three drivers, ten minutes each, as a drive table."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the simulator lies beside the tests
    from tests.simulators import simulate_population

    simulate_population(3, duration=600.0, seed=3).to_csv(path, index=False)
    return path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3])) if len(sys.argv) > 1 else main(Path("out/examples"))
