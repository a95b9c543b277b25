"""A fit on another processor: linear algebra adds up in another order there, and the profile is the same bytes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from xosc_lateral.drivers.fitting.models.two_level import fit_two_level
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.profiles import write_profile

pytestmark = pytest.mark.pages

FIT = """
import sys
from examples.driver_simulator.simulator import simulate_drive
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.files.drives import drives_of_table
from xosc_lateral.files.profiles import write_profile

table = simulate_drive(800.0, seed=5, sensor_rate=20.0).table
write_profile(fit_profile(drives_of_table(table, {}, "drive"), name="drive"), sys.argv[1])
"""


def fitted_on(processor: dict[str, str], path: Path) -> bytes:
    """The profile's file, by the kernels that OpenBLAS has for a processor; other libraries have one kind for all."""
    subprocess.run([sys.executable, "-c", FIT, str(path)], check=True, env=os.environ | processor, timeout=300)
    return path.read_bytes()


@pytest.mark.slow
def test_profiles_fitted_on_another_processor_are_the_same_bytes(tmp_path: Path) -> None:
    here = fitted_on({}, tmp_path / "here.json")
    elsewhere = fitted_on({"OPENBLAS_CORETYPE": "Prescott"}, tmp_path / "elsewhere.json")  # runs on any x86-64
    assert here == elsewhere


MADE = """
import sys
from xosc_lateral.cli import main

words = ["template write cut-in -o .", "convert cut-in.xosc -o o.xosc --report t.mcap --time-limit 12 --seed 3",
         "export c -o c -p motorway", "export fmu -o d.fmu -p rural", "export c -o two -p two.json",
         "sample -o s.csv --duration 60 -p motorway", "sample -o two.csv --duration 60 -p two.json"]
sys.exit(any(main(line.split()) for line in words))
"""
"""Everything that is exported; `two.json` lies there."""


@pytest.mark.slow
def test_what_is_exported_on_another_processor_is_the_same_bytes(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    run = np.convolve(rng.normal(size=6000), np.ones(25) / 60.0, mode="same")
    made = dict[str, dict[str, bytes]]()
    for kernels in ("", "Prescott", "Haswell"):  # the latter two run on any x86-64 of the last ten years
        folder = tmp_path / (kernels or "here")
        folder.mkdir()
        write_profile(DriverProfile("two", fit_two_level([run]), lane_width=3.6), folder / "two.json")
        environment = os.environ | ({"OPENBLAS_CORETYPE": kernels} if kernels else {})
        subprocess.run([sys.executable, "-c", MADE], check=True, env=environment, cwd=folder, timeout=300)
        found = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        made[kernels] = found
    assert len(made[""]) > 18
    for found in made.values():
        assert [name for name in found if found[name] != made[""][name]] == []
