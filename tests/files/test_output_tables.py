"""Tables as they are written: bytes, provenance, whose they are; and another format by one function."""

from __future__ import annotations

import gzip
import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.version import __version__
from xosc_lateral.files.output_paths import SIDECAR_SUFFIX, claim, is_own
from xosc_lateral.files.output_tables import (
    ENCODERS,
    METADATA_KEY,
    csv_text,
    output_suffixes,
    write_frame,
    write_table,
)

FRAME = pd.DataFrame({"time": [0.0, 0.2], "offset": [0.1234567, -1.0 / 3.0], "name": ["ego", "=cmd()"], "n": [1, 2]})


def provenance_beside(path: Path) -> dict[str, object]:
    values = json.loads(path.with_name(path.name + SIDECAR_SUFFIX).read_text())
    assert isinstance(values, dict)
    return values


@pytest.mark.parametrize("suffix", output_suffixes())
def test_a_table_comes_back_and_is_ours(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"t{suffix}"
    write_frame(FRAME, path, {"seed": 3})
    read = pd.read_parquet(path) if suffix == ".parquet" else pd.read_csv(path)
    tolerance = 0.0 if suffix == ".parquet" else 5e-7
    np.testing.assert_allclose(read["offset"], FRAME["offset"], atol=tolerance, rtol=0)
    assert read["n"].tolist() == [1, 2]
    assert is_own(path)
    claim([path])


@pytest.mark.parametrize("suffix", output_suffixes())
def test_the_same_table_gives_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_frame(FRAME, tmp_path / name / f"t{suffix}", {"seed": 3})
    assert (tmp_path / "a" / f"t{suffix}").read_bytes() == (tmp_path / "b" / f"t{suffix}").read_bytes()


def test_provenance_lies_beside_a_csv_with_the_hash_of_its_bytes(tmp_path: Path) -> None:
    path = tmp_path / "t.csv.gz"
    write_frame(FRAME, path, {"seed": 3})
    record = provenance_beside(path)
    assert record == {
        "package": f"xosc-lateral {__version__}", "seed": 3, "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }  # fmt: skip
    assert gzip.decompress(path.read_bytes()).decode() == csv_text(FRAME)


def test_provenance_is_inside_a_parquet_file(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    path = tmp_path / "T.PARQUET"
    write_frame(FRAME, path, {"seed": 3})
    assert json.loads(pq.read_schema(path).metadata[METADATA_KEY]) == {
        "package": f"xosc-lateral {__version__}",
        "seed": 3,
    }
    assert [item.name for item in tmp_path.iterdir()] == ["T.PARQUET"]


def test_words_that_look_like_formulas_are_harmless_and_numbers_keep_their_sign() -> None:
    lines = csv_text(FRAME).splitlines()
    assert lines[0] == "time,offset,name,n"
    assert lines[2] == "0.200000,-0.333333,'=cmd(),2"


def test_only_what_is_written_is_made(tmp_path: Path) -> None:
    def never() -> pd.DataFrame:
        raise AssertionError("nobody asked for the frame")

    write_table(tmp_path / "t.csv", {}, frame=never, text=lambda: "a,b\n1,2\n")
    assert (tmp_path / "t.csv").read_text() == "a,b\n1,2\n"


def test_a_table_that_was_edited_is_no_longer_ours(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_frame(FRAME, path, {})
    path.write_text(path.read_text() + "9,9,9,9\n")
    assert not is_own(path)


def test_another_format_is_one_function_and_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ENCODERS, ".jsonl", lambda frame, text: frame().to_json(orient="records", lines=True).encode())
    path = tmp_path / "t.jsonl"
    assert ".jsonl" in output_suffixes()
    write_frame(FRAME, path, {"seed": 3})
    assert [json.loads(line)["n"] for line in path.read_text().splitlines()] == [1, 2]
    assert provenance_beside(path)["seed"] == 3
    assert is_own(path)
    path.write_text("somebody else's")
    assert not is_own(path)


def test_a_new_format_is_written_by_the_verbs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import xosc_lateral as xl

    monkeypatch.setitem(ENCODERS, ".jsonl", lambda frame, text: frame().to_json(orient="records", lines=True).encode())
    offsets = xl.sample("motorway", duration=4.0, seed=1)
    written = offsets.write(tmp_path / "o.jsonl")
    assert len(written.read_text().splitlines()) == len(offsets.to_frame())
