"""Whatever is written can be written elsewhere, and read there again."""

from __future__ import annotations

from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main

fsspec = pytest.importorskip("fsspec", reason="extra `cluster` is not installed")


def test_tables_profiles_and_folders_go_where_a_url_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files = fsspec.filesystem("memory")
    offsets = xl.sample("rural", duration=20.0, seed=1)
    offsets.write("memory://out/o.csv")
    offsets.write("o.csv")
    assert files.cat("/out/o.csv") == Path("o.csv").read_bytes()
    assert files.exists("/out/o.csv.json")
    xl.write_profile(xl.read_profile("rural"), "memory://out/p.json")
    assert xl.read_profile("memory://out/p.json").name == "rural"
    assert main(["template", "write", "cut-in", "-o", "memory://out/t/"]) == 0
    assert main(["states", "memory://out/t/cut-in.xosc", "-o", "memory://out/s.csv", "--time-limit", "1"]) == 0
    assert {"/out/t/cut-in.xosc", "/out/t/cut-in.xodr", "/out/s.csv"} <= {*files.find("/out")}
    assert [one.name for one in tmp_path.iterdir() if one.name.startswith("memory")] == []
