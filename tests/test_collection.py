"""The same tests are collected under every hash seed and at any time: pytest-xdist refuses to run otherwise."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def _collected(hash_seed: str) -> list[str]:
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "tests"]
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTEST_ADDOPTS": ""}
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    return [line for line in run.stdout.splitlines() if "::" in line]


def test_the_same_tests_are_collected_every_time(request: pytest.FixtureRequest) -> None:
    """Workers under hash seeds of their own compare what they collected; a single process collects twice."""
    if hasattr(request.config, "workerinput") and "PYTHONHASHSEED" not in os.environ:
        first = [item.nodeid for item in request.session.items]
    else:
        first = _collected("1")
        assert len(first) > 1000
        assert first == _collected("2")
    assert len(set(first)) == len(first), "two tests have the same id"
    assert not [name for name in first if " object at 0x" in name]
