"""A fit on another processor: linear algebra adds up in another order there, and the profile is the same bytes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

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
