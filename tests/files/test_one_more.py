"""One more importer and one more output table, by what CONTRIBUTING's recipes name and nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings import importers
from xosc_lateral.files import output_tables

IMPORTER = '''
"""A log in centimetres."""
import pandas as pd


def import_acme(source, **options):
    log = pd.read_csv(source)
    return pd.DataFrame({"time": log["t"], "offset": log["left_cm"] / 100, "lane_width": 3.5, "speed": 30.0})
'''


def test_an_importer_is_a_function_and_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "acme_reader.py").write_text(IMPORTER, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(importers.IMPORTERS, "acme", "acme_reader:import_acme")
    log = tmp_path / "log.csv"
    log.write_text("t,left_cm\n" + "".join(f"{k / 10},{20 + k % 3}\n" for k in range(300)), encoding="utf-8")
    imported = xl.import_drives("acme", log)
    assert imported.to_frame()["offset"].iloc[0] == pytest.approx(0.20)
    assert main(["import", "acme", str(log), "-o", str(tmp_path / "drives.csv")]) == 0
    header, *rows = (tmp_path / "drives.csv").read_text(encoding="utf-8").splitlines()
    assert "offset" in header.split(",") and len(rows) == 300


def test_an_output_table_is_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        output_tables.ENCODERS, ".jsonl", lambda frame, text: frame().to_json(orient="records", lines=True).encode()
    )
    target = tmp_path / "offsets.jsonl"
    arguments = ["sample", "--profile", "motorway-vehicle-1", "--duration", "5", "--speed", "30", "-o", str(target)]
    assert main(arguments) == 0
    rows = [json.loads(line) for line in target.read_text(encoding="utf-8").splitlines()]
    assert len(rows) > 20 and {"time", "offset"} <= rows[0].keys()
