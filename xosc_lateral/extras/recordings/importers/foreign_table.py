"""Somebody's tables, read by a saved mapping."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from xosc_lateral.base.lazy import pd
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS
from xosc_lateral.extras.recordings.importers import ImportedDrives, imported, paths_of
from xosc_lateral.files.drives import drives_of_table, file_labels, labels_apart, rows_of_drives, translated
from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.files.tables import read_table, tables_at
from xosc_lateral.workflows.options import declare_options


@declare_options
def import_table(sources: Path | Sequence[Path], *, columns: MappingLike | None = None) -> ImportedDrives:
    """Tables of drives under a company's own names, units and words, by a saved mapping.

    A drive is called after its file, its label and how often its clock began
    again. All rows that are chosen are in the table; the record says which of them are in no drive, and why.
    """
    known, files = as_mapping(columns), [table for path in paths_of(sources) for table in tables_at(path)]
    made, lost, drives = list[pd.DataFrame](), Counter[str](), list[Drive]()
    for path, label in zip(files, file_labels(files), strict=True):
        read = read_table(path, known)
        table = translated(read, known, path)
        lost["not chosen"] += len(read) - len(table)
        drives += drives_of_table(table, known, path, lost, is_translated=True)
        names = np.empty(len(table), dtype=object)
        for name, rows in rows_of_drives(table, path, label):
            names[rows] = name
        table = table.drop(columns=["drive", "recording"], errors="ignore")
        table.insert(0, "drive", names)
        made.append(table)
    for table, apart in zip(made, labels_apart(files, [table["drive"].unique() for table in made]), strict=True):
        table["drive"] = table["drive"].map(apart)
    table = pd.concat(made, ignore_index=True)
    step = float(np.median(np.concatenate([np.diff(drive.time) for drive in drives])))
    recorded = imported(
        table.assign(state=KEPT_ROWS), format="table", sources=files, licence="your own recording", settings={},
        step=step,
    )  # fmt: skip
    kept = sum(map(len, drives))
    record = replace(
        recorded.provenance, rows=dict(+Counter({KEPT_ROWS: kept, **lost})), hours=round(kept * step / 3600.0, 3)
    )
    return ImportedDrives(table, record)
