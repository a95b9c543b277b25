"""Whoever has neither a home nor a folder for caches: a service's user in a container."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

NOBODY = """
import pathlib, pwd, sys

def unknown(*_):
    raise KeyError("uid not found")

pwd.getpwuid = unknown
try:
    pathlib.Path.home()
except RuntimeError:
    pass
else:
    raise AssertionError("there is a home")

import numba.core.caching as caching
for implementation in (caching.CodeLibraryCacheImpl, caching.CompileResultCacheImpl):
    implementation._locator_classes = []  # as where no folder can be written

from xosc_lateral.cli import main
from xosc_lateral.drivers.model.linear_filters import WORTH_IMPORTING

for words in (
    ["template", "write", "cut-in", "-o", "."],
    ["convert", "cut-in.xosc", "-o", "out.xosc", "--time-limit", "3", "--report", "report.html"],
    ["convert", "cut-in.xosc", "missing.xosc", "-o", "batch", "--time-limit", "3"],
    ["profiles", "list"],
    ["sample", "-p", "motorway", "--duration", str(0.21 * WORTH_IMPORTING), "-o", "offsets.csv"],
):
    print(words[0], main(words), flush=True)
"""


@pytest.mark.pages
@pytest.mark.skipif(sys.platform == "win32", reason="homes of POSIX users")
def test_everything_runs_without_a_home_and_without_a_cache(tmp_path: Path) -> None:
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    words = [sys.executable, "-c", NOBODY]
    run = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    codes = [line.split() for line in run.stdout.splitlines() if line.split()[-1:] in (["0"], ["1"])]
    assert ["convert", "0"] in codes and ["sample", "0"] in codes and ["profiles", "0"] in codes
    assert "Traceback" not in run.stderr
    for name in ("out.xosc", "report.html", "offsets.csv"):
        assert (tmp_path / name).stat().st_size > 1000
