"""Manifest and timings on disk."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import BATCH_JOBS
from xosc_lateral.files.atomic import LARGEST_RECORD
from xosc_lateral.workflows.batch import manifest
from xosc_lateral.workflows.batch.journal import CLOCK_TICK, MOST_RUNS, Journal, _known, folder_lock
from xosc_lateral.workflows.batch.manifest import (
    MANIFEST,
    ManifestRow,
    Timing,
    read_manifest,
    read_timings,
    write_manifest,
    write_timings,
)

ROW = ManifestRow(
    output="a/x.xosc",
    scenario="a/x.xosc",
    scenario_sha256="12",
    variant=2,
    seed=7,
    profile="auto",
    parameters={"Speed": "30", "Straße": "ä"},
    settings="34",
    package_version="1.0",
    output_sha256="56",
    road="../r.xodr",
    road_sha256="78",
    inputs={"a/x.xosc": "12", "../r.xodr": "78"},
    profiles={"Ego": "car"},
    profile_sha256={"car": "90"},
    entities=3,
    enriched=("Ego", "Truck"),
    segment_seconds=12.5,
    offset_spread=0.21,
    gap_before=1.5,
    gap_after=None,
    warnings=("one", "two"),
)
FAILED = replace(ROW, output="b.xosc", output_sha256="", error="b.xosc:3: Event 'x': what")


def test_rows_come_back_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "manifest.parquet"
    rows = [replace(ROW, output=f"{index:05d}.xosc") for index in range(2500)] + [FAILED]
    write_manifest(rows, path)
    assert list(read_manifest(path)) == rows


def test_the_same_rows_give_the_same_bytes(tmp_path: Path) -> None:
    write_manifest([ROW, FAILED], tmp_path / "a")
    write_manifest([ROW, FAILED], tmp_path / "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_others_can_read_it(tmp_path: Path) -> None:
    write_manifest([ROW, FAILED], tmp_path / "manifest.parquet")
    table = pd.read_parquet(tmp_path / "manifest.parquet").set_index("output")
    assert table.loc["a/x.xosc", "segment_seconds"] == 12.5
    assert list(table.loc["a/x.xosc", "enriched"]) == ["Ego", "Truck"]
    assert table.loc["b.xosc", "error"] == FAILED.error
    assert pd.isna(table.loc["a/x.xosc", "gap_after"])


def test_a_foreign_file_of_that_name_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "manifest.parquet"
    path.write_text("mine")
    with pytest.raises(FormatError, match=r"manifest\.parquet: can't be read as Parquet"):
        list(read_manifest(path))
    pd.DataFrame({"x": [1]}).to_parquet(path)
    with pytest.raises(FormatError, match="not a manifest of this package"):
        list(read_manifest(path))


def test_what_an_older_program_did_not_know_of_an_output_counts_as_none() -> None:
    """A row of its first columns alone; its variants count from 0."""
    old = ("output", "scenario", "scenario_sha256", "variant", "seed", "profile", "parameters", "settings")
    row = ManifestRow.from_dict({name: getattr(ROW, name) for name in (*old, "package_version")})
    assert (row.variant, row.behaviour, row.player) == (ROW.variant + 1, 1, "standard")
    counted = (row.entities, row.segment_seconds, row.offset_spread, row.trial_contacts, len(row.enriched))
    assert counted == (0, 0.0, 0.0, 0, 0) and (row.gap_before, row.gap_after, row.only) == (None, None, None)
    assert not (row.with_sensor or row.cut_off or row.stale or row.error or row.warnings or row.modes or row.options)


@pytest.mark.parametrize(
    ("changed", "written", "is_kept"),
    [(0, 0, True), (CLOCK_TICK + 1, CLOCK_TICK + 1, True), (CLOCK_TICK, 0, False), (0, CLOCK_TICK, False)],
)
def test_a_state_is_kept_if_any_later_edit_would_change_it(changed: int, written: int, is_kept: bool) -> None:
    """Of a file whose state or bytes changed `changed` and `written` ns ago; 0: long ago."""
    now = 10**18
    times = [now - ago if ago else 1 for ago in (changed, written)]
    timing = Timing(2.0, f"17 {times[0]} {times[1]} 4711")
    assert _known(timing, now) == (timing if is_kept else Timing(2.0))


def test_timings_come_back(tmp_path: Path) -> None:
    written = {"a": Timing(0.5), "b": Timing(1.0, "1 2 3 4")}
    write_timings(written.items(), tmp_path / "t")
    assert read_timings(tmp_path / "t") == written
    assert read_timings(tmp_path / "none") == {}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of memory are Linux' own")
def test_a_manifest_of_texts_that_fill_any_memory_is_none(tmp_path: Path) -> None:
    """3 MB a row and column, once in the file."""
    texts = pa.DictionaryArray.from_arrays(np.zeros(1000, np.int32), pa.array(["x" * 3_000_000]))
    pq.write_table(pa.table(dict.fromkeys(("output", "scenario"), texts)), tmp_path / MANIFEST, compression="zstd")
    assert (tmp_path / MANIFEST).stat().st_size < 1_000_000
    with pytest.raises(FormatError, match="not enough memory"):
        list(read_manifest(tmp_path / MANIFEST))


def test_tables_of_a_folder_have_as_many_rows_as_a_batch_outputs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(manifest, "BATCH_JOBS", replace(BATCH_JOBS, value=10))
    for count in (10, 11):
        write_manifest((replace(ROW, output=f"{index}.xosc") for index in range(count)), tmp_path / MANIFEST)
        write_timings(((str(index), Timing(1.0)) for index in range(count)), tmp_path / "t")
        if count == 10:
            assert len(list(read_manifest(tmp_path / MANIFEST))) == len(read_timings(tmp_path / "t")) == 10
    for read in (lambda: list(read_manifest(tmp_path / MANIFEST)), lambda: read_timings(tmp_path / "t")):
        with pytest.raises(FormatError, match="outputs of one batch: 11, at most 10"):
            read()


def test_a_line_of_a_journal_and_a_lock_have_so_many_bytes_and_no_more(tmp_path: Path) -> None:
    path, lines = tmp_path / "j.jsonl", []
    for size in (0, LARGEST_RECORD, LARGEST_RECORD + 1):
        line = json.dumps({"row": replace(ROW, output=f"{size}.xosc", error="@").to_dict(), "seconds": 1.0})
        lines.append(line.replace("@", "x" * max(size - len(line), 1)))
    path.write_text("".join(f"{line}\n" for line in lines))
    with Journal(tmp_path / "out", path, print) as journal:
        assert list(journal) == ["0.xosc", f"{LARGEST_RECORD}.xosc"]
        journal.drop()
    path.write_bytes(b"")
    os.truncate(path, 1 << 40)  # one line, of which nothing lies on the disk
    with Journal(tmp_path / "out", path, print) as journal:
        assert not list(journal)
        journal.drop()
    killed = [f"{number:012x}" for number in range(2 * MOST_RUNS)]
    path.write_text(json.dumps({"runs": killed}))
    with folder_lock(path) as runs:
        assert runs[1:] == killed[: MOST_RUNS - 1]
    path.write_text("{" + " " * LARGEST_RECORD + f'"runs": ["{killed[0]}"]}}')
    with folder_lock(path) as runs:
        assert not runs[1:]
