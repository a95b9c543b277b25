"""A drive is its file and its own label."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.files.drives import file_labels, read_drives


def write(path: Path, offset: float, drive: object = None) -> Path:
    path.parent.mkdir(exist_ok=True, parents=True)
    time = np.arange(0.0, 20.0, 0.1)
    rows = {"time": time, "offset": offset + 0.0 * time, "lane_width": 3.5}
    table = pd.DataFrame(rows if drive is None else rows | {"drive": drive})
    table.to_parquet(path) if path.suffix == ".parquet" else table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    ("names", "drive"),
    [
        (("a/log.csv", "b/log.csv"), None),
        (("2026.11.21.csv", "2026.11.22.csv"), None),
        (("log.csv", "log.parquet"), None),
        (("a.csv", "b.csv"), 1),
        (("a/log.csv", "b/log.parquet"), "trip"),
    ],
)
def test_drives_of_several_files_are_never_put_together(names, drive, tmp_path: Path) -> None:
    files = [write(tmp_path / name, side, drive) for name, side in zip(names, (-0.5, 0.5), strict=True)]
    out = tmp_path / "all.parquet"
    assert main(["import", "table", *map(str, files), "-o", str(out)]) == 0
    for drives in (read_drives(out), read_drives(files)):
        assert len(drives) == 2 and len({one.name for one in drives}) == 2
        assert sorted(float(np.ptp(one.offset)) for one in drives) == [0.0, 0.0]
        assert sorted(float(one.offset[0]) for one in drives) == [-0.5, 0.5]


def test_a_file_that_is_named_twice_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", 0.0)
    with pytest.raises(FormatError, match="named twice"):
        file_labels([path, path])
    assert file_labels([path, tmp_path / "b.d.csv.gz"]) == ["a", "b.d"]
