"""Rows of long runs: the same numbers wherever they lie, no more memory than is allowed, stretches of True."""

from __future__ import annotations

import errno
import gc
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import xosc_lateral as xl
from xosc_lateral.base import rows
from xosc_lateral.base.rows import true_slices
from xosc_lateral.base.segment import Segment
from xosc_lateral.cli import main
from xosc_lateral.workflows.conversion import enrich


@pytest.mark.parametrize(
    ("mask", "expected"),
    [("", []), ("0", []), ("1", [(0, 1)]), ("0110", [(1, 3)]), ("1101", [(0, 2), (3, 4)])],
)
def test_stretches_are_the_longest_slices_of_true(mask, expected):
    values = np.array([one == "1" for one in mask], dtype=bool)
    assert [(part.start, part.stop) for part in true_slices(values)] == expected


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("long")
    xl.write_template("dense-traffic", folder)
    return folder / "dense-traffic.xosc"


def test_rows_in_a_file_give_the_same_bytes(scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    in_memory = xl.convert(scenario, scenario.with_name("a.xosc"), ego="none")
    monkeypatch.setattr(rows, "IN_MEMORY", 0.0)
    monkeypatch.setattr(rows, "MAPPED_MEMORY", 0.0)
    sizes: list[int] = []
    grown = rows._Store.grown
    monkeypatch.setattr(rows._Store, "grown", lambda store, size: sizes.append(size) or grown(store, size))
    in_file = xl.convert(scenario, scenario.with_name("b.xosc"), ego="none")
    assert sizes, "nothing lay in the file"
    assert in_file.data == in_memory.data
    assert {path.suffix for path in scenario.parent.iterdir()} == {".xosc", ".xodr"}, "the file has no name"


@pytest.mark.skipif(rows.status_bytes(2) == 0, reason="the system does not say what is in memory")
def test_pages_of_the_file_leave_memory_by_themselves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "IN_MEMORY", 0.0)
    before = rows.status_bytes(2)
    with rows.spilling_to(tmp_path):
        column = rows.empty(20_000_000)
        column[:] = np.arange(20_000_000)
    deadline = time.monotonic() + 20.0
    while rows.status_bytes(2) - before > rows.MAPPED_MEMORY and time.monotonic() < deadline:
        time.sleep(0.02)
    assert rows.status_bytes(2) - before <= rows.MAPPED_MEMORY
    assert column[-1] == 19_999_999 and (np.diff(column[:1000]) == 1.0).all()


def test_what_drivers_see_is_gone_before_paths_are_made(scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty columns a driver: of an hour of 500 cars they are three gigabytes."""
    monkeypatch.setattr(enrich, "KEPT_ROWS", 0)
    displace, alive = enrich.displace, list[int]()

    def counted(*args: Any) -> Any:
        alive.append(sum(type(one) is Segment for one in gc.get_objects()))
        return displace(*args)

    monkeypatch.setattr(enrich, "displace", counted)
    gc.collect()
    before = sum(type(one) is Segment for one in gc.get_objects())
    xl.convert(scenario, ego="none")
    assert alive and max(alive) <= before


def test_a_full_disk_is_one_line(
    scenario: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(rows, "IN_MEMORY", 0.0)
    monkeypatch.setattr(os, "posix_fallocate", full)
    output = scenario.with_name("c.xosc")
    assert main(["convert", str(scenario), "-o", str(output), "--ego", "none"]) == 1
    line = capsys.readouterr().err
    assert "no space left on device" in line and "rows of a long run" in line and line.count("\n") == 1
    assert not output.exists()
