"""Logs of the player esmini (`--csv_logger`): one row per step with all vehicles side by side, as a table of tracks."""

from __future__ import annotations

import re
from typing import IO, TYPE_CHECKING

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.source import open_source
from xosc_lateral.formats.tables import foreign_errors, unpacked_text

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

FIRST = b"esmini "
"""Begins the lines before the table, which name the player's version."""

HEAD = "Index [-]"
MOST_LINES = 50
"""Before the table's head; a player writes seven."""

COLUMNS = {
    "vehicle": "Entity_Name",
    "x": "World_Position_X",
    "y": "World_Position_Y",
    "heading": "World_Heading_Angle",
    "speed": "Current_Speed",
    "length": "bb_length",
    "width": "bb_width",
    "rear": "bb_x",
}
"""Column of a table of tracks -> the log's. Positions are those of the rear axle, `bb_x` behind the box's middle."""

_NAME = re.compile(r"\s*#(\d+)\s+(\w+)")


def is_esmini_log(path: Path) -> bool:
    """Whether a file begins like one."""
    with open_source(path) as source:
        return unpacked_text(source).read(len(FIRST)) == FIRST


def read_esmini_log(path: Path) -> pd.DataFrame:
    """Rows of all vehicles, one below the other: the columns of `COLUMNS`, and `time`.

    Raises
    ------
    FormatError
        A column is missing, or the table is damaged.
    """
    import pandas as pd

    with open_source(path) as source, foreign_errors(path, "can't be read as a log of esmini"):
        text = unpacked_text(source)
        names = _head(text, path)
        table = pd.read_csv(text, header=None, names=range(len(names)), skipinitialspace=True, index_col=False)
    places: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        if found := _NAME.match(name):
            places.setdefault(found[1], {})[found[2]] = column
    frames = []
    for number, mine in places.items():
        if missing := sorted(set(COLUMNS.values()) - mine.keys()):
            raise FormatError(f"vehicle #{number}: no column {missing[0]}", path=path)
        frame = pd.DataFrame({name: table[mine[theirs]] for name, theirs in COLUMNS.items()})
        frames.append(frame.assign(time=table[1]).dropna(subset=["vehicle"]))  # one that has not come yet is empty
    if not frames:
        raise FormatError("no vehicle in the table's head", path=path)
    rows = pd.concat(frames, ignore_index=True)
    rows["vehicle"] = rows["vehicle"].astype(str).str.strip()
    return rows


def _head(text: IO[bytes], path: Path) -> list[str]:
    for _ in range(MOST_LINES):
        line = text.readline().decode("utf-8", "replace")
        if line.startswith(HEAD):
            return line.rstrip().rstrip(",").split(",")
    raise FormatError(f"a log of esmini without a line that begins with '{HEAD}'", path=path)
