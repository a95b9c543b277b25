"""Tables that this package writes, with their provenance inside (Parquet) or in a file beside them; that of states."""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.lazy import pa, parquet, pd
from xosc_lateral.base.names import in_csv
from xosc_lateral.base.version import __version__
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.json_text import canonical_json
from xosc_lateral.files.output_paths import SIDECAR_SUFFIX
from xosc_lateral.files.source import hash_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork

METADATA_KEY = b"xosc-lateral"  # key of the provenance in a Parquet file's schema metadata
Encoder: TypeAlias = "Callable[[Callable[[], pd.DataFrame], Callable[[], str]], bytes]"
"""A table's bytes, from what gives it as a frame and what gives it as CSV; only one of both is asked for."""

PARQUET = ".parquet"

ENCODERS: dict[str, Encoder] = {
    ".csv": lambda frame, text: text().encode(),
    ".csv.gz": lambda frame, text: gzip.compress(text().encode(), mtime=0),
}
"""Suffix -> the bytes of a table, whose provenance goes into a file beside it. Parquet holds its own."""


def output_suffixes() -> tuple[str, ...]:
    """Of all formats that a table can be written in."""
    return (*ENCODERS, PARQUET)


def write_frame(frame: pd.DataFrame, path: Path, provenance: Mapping[str, Any]) -> None:
    """Write a table in the format of the suffix, six decimals in CSV, every bit in Parquet; same frame, same bytes."""
    write_table(path, provenance, frame=lambda: frame, text=lambda: csv_text(frame))


def write_table(
    path: Path, provenance: Mapping[str, Any], *, frame: Callable[[], pd.DataFrame], text: Callable[[], str]
) -> None:
    """As `write_frame`, for tables that have a CSV of their own; whole or not at all."""
    name = path.name.lower()
    if name.endswith(PARQUET):
        plain = frame().copy(deep=False)
        plain.attrs = {}  # which some releases of pyarrow write
        for name in plain.columns if len(plain) else ():
            if isinstance(plain[name].iloc[0], dict):  # no column holds an empty record
                plain[name] = plain[name].map(canonical_json)
        table, buffer = pa.Table.from_pandas(plain, preserve_index=False), io.BytesIO()
        metadata = {**(table.schema.metadata or {}), METADATA_KEY: canonical_json(stamped(provenance)).encode()}
        parquet.write_table(table.replace_schema_metadata(metadata), buffer, compression="zstd")
        write_atomically(path, buffer.getvalue())
        return
    data = next(encode for suffix, encode in ENCODERS.items() if name.endswith(suffix))(frame, text)
    record = stamped(provenance) | {"sha256": hash_of(data)}
    with together():
        write_atomically(path, data)
        write_atomically(path.with_name(path.name + SIDECAR_SUFFIX), canonical_json(record) + "\n")


def csv_text(frame: pd.DataFrame) -> str:
    """The table as CSV with six decimals; words that look like a formula are made harmless."""
    return str(harmless_frame(frame).to_csv(index=False, float_format="%.6f", lineterminator="\n"))


def harmless_frame(frame: pd.DataFrame) -> pd.DataFrame:
    """The table with words that no spreadsheet takes for a formula."""
    words = {
        name: frame[name].map(lambda value: in_csv(value) if isinstance(value, str) else value)
        for name in frame.columns
        if frame[name].dtype.kind not in "fiubM"
    }
    frame = frame.assign(**words) if words else frame
    return frame.rename(columns=lambda name: in_csv(name) if isinstance(name, str) else name)


def stamped(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance with the package that wrote it."""
    return {"package": f"xosc-lateral {__version__}", **provenance}


COLUMNS = {
    "time": "%.3f", "name": "%s", "x": "%.4f", "y": "%.4f", "z": "%.4f", "h": "%.6f", "speed": "%.4f", "road": "%s",
    "lane": "%d", "offset_t": "%.4f", "s": "%.4f",
}  # fmt: skip
"""Name -> how it is written; [s], -, [m], [m], [m], [rad], [m/s], road id, lane id, [m] from the lane's centre along
+t, [m]. `_columns` has their values."""

RECOGNISED_BY = ("time", "name", "x", "y", "h", "speed", "road", "lane", "s")
"""What every table of states has, of a played scenario or of live drivers: one with more is one, too."""


def states_csv(motion: NominalMotion, network: RoadNetwork) -> str:
    """Inertial states of all entities that exist at a time, ordered by time and then as in the scenario, as CSV."""
    lines = [",".join(COLUMNS)]
    for rows in zip(*(_lines(entity, network) for entity in motion.entities), strict=True):
        lines += [row for row in rows if row]
    return "\n".join(lines) + "\n"


def _lines(motion: EntityMotion, network: RoadNetwork) -> Iterator[str]:
    columns, written = (
        [values.tolist() for values in _columns(motion, network, _quoted).values()],
        ",".join(COLUMNS.values()),
    )
    for row, activity in zip(zip(*columns, strict=True), motion.activity.tolist(), strict=True):
        yield written % row if activity & Activity.ACTIVE else ""


def states_frame(motion: NominalMotion, network: RoadNetwork) -> pd.DataFrame:
    """The same rows as a frame, every digit kept."""
    frames = [
        pd.DataFrame(_columns(entity, network, str) | {"entity": number}).loc[(entity.activity & Activity.ACTIVE) != 0]
        for number, entity in enumerate(motion.entities)
    ]
    if not frames:
        return pd.DataFrame(columns=list(COLUMNS))
    rows: pd.DataFrame = pd.concat(frames, ignore_index=True)
    return rows.sort_values(["time", "entity"], kind="stable", ignore_index=True)[list(COLUMNS)]


def _columns(motion: EntityMotion, network: RoadNetwork, text: Callable[[str], str]) -> dict[str, NDArray[Any]]:
    """By their names in the table, shape (n,) each; `text`: how names are written."""
    on_road = motion.road >= 0
    offset_t = np.zeros(len(motion.time))
    offset_t[on_road] = network.travel_directions(motion.road[on_road], motion.lane[on_road]) * motion.offset[on_road]
    ids = np.array([*map(text, network.road_ids), ""], dtype=object)
    name = np.full(len(motion.time), text(motion.name), dtype=object)
    pose = network.header_offset.apply(motion.x, motion.y, motion.z, motion.heading)
    columns = motion.time, name, *pose, motion.speed, ids[motion.road], motion.lane, offset_t, motion.s
    return dict(zip(COLUMNS, columns, strict=True))


def _quoted(text: str) -> str:
    text = in_csv(text)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text
