"""Rows of long runs: the same numbers in blocks, no more memory than there is, stretches of True."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import xosc_lateral as xl
from xosc_lateral.base.arrays import columns, true_slices
from xosc_lateral.base.segment import Segment
from xosc_lateral.cli import main
from xosc_lateral.workflows.conversion import enrich
from xosc_lateral.world.player import player


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


def test_columns_of_blocks_are_those_of_the_whole() -> None:
    steps, same = np.arange(10.0), np.full(10, 3)
    for size in (1, 3, 10):
        parts = [(steps[k : k + size], same[k : k + size]) for k in range(0, 10, size)]
        together = columns(10, parts)
        np.testing.assert_array_equal(together, [steps, same])
        assert together[1].base is not None and together[1].strides == (0,), "one value in memory"


@pytest.mark.pages
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


def test_more_rows_than_there_is_memory_for_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(player, "free_bytes", lambda: 1e6)
    xl.write_template("dense-traffic", tmp_path)
    output = tmp_path / "c.xosc"
    assert main(["convert", str(tmp_path / "dense-traffic.xosc"), "-o", str(output), "--ego", "none"]) == 1
    line = capsys.readouterr().err
    assert "MB of memory, and 1 MB are free" in line and line.count("\n") == 1
    assert not output.exists()
