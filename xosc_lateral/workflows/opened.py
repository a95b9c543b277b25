"""One opening for whatever stands for inputs: each becomes a path, on disk or in memory; readers know files."""

from __future__ import annotations

import io
import os
from glob import has_magic
from pathlib import Path, PosixPath, WindowsPath
from typing import Any, TypeAlias

from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.files.held import Held, hold
from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.files.remote import inputs_of
from xosc_lateral.files.tables import frame_of, read_table
from xosc_lateral.workflows.inputs import document, several

InputLike: TypeAlias = Any
"""A path, URL, pattern or folder; bytes, text or a file-like object; a data frame, a `Drive`, a result of ours."""

KINDS = {b"PAR1": ".parquet", b"ARROW1": ".feather", b"<": ".xml", b"\xef\xbb\xbf<": ".xml"}


DOCUMENTS = {b"<OpenSCENARIO": ".xosc", b"<OpenDRIVE": ".xodr"}


class HeldPath(WindowsPath if os.name == "nt" else PosixPath):  # type: ignore[misc]
    """A path in memory that keeps what lies there."""

    held: Held


def opened(stated: InputLike, name: str = "input") -> list[Path]:
    """Paths of all that is stated, in order."""
    items = several(stated)
    paths = list[Path]()
    for number, item in enumerate(items, start=1):
        label = name if len(items) == 1 else f"{name} {number}"
        if isinstance(item, str | os.PathLike) and not str(item).lstrip("\ufeff \t\r\n").startswith("<"):
            paths += inputs_of([item])  # type: ignore[list-item]
        else:
            paths.append(_in_memory(item, label))
    return paths


def opened_as_one(stated: InputLike, columns: MappingLike | None = None, name: str = "recording") -> Path:
    """The only path, or that of a table of which the stated ones are parts."""
    paths = opened(stated, name)
    if len(paths) == 1:
        return paths[0]
    import pandas as pd

    mapping = as_mapping(columns)
    return _in_memory(pd.concat([read_table(path, mapping) for path in paths], ignore_index=True), name)


def _in_memory(item: InputLike, name: str) -> Path:
    made = getattr(item, "data", None)  # of a conversion
    data = made if isinstance(made, bytes) else _frame_bytes(item)
    if data is None:
        data = document(item, name)
        assert data is not None
    stem = Path(str(getattr(item, "name", "") or name)).name if hasattr(item, "read") else name
    ending = next((end for magic, end in KINDS.items() if data.startswith(magic)), ".csv")
    ending = next((end for tag, end in DOCUMENTS.items() if tag in data[:4096]), ending)
    file = stem if Path(stem).suffix else f"{stem}{ending}"
    held = hold({file: data})
    path = HeldPath(held.folder / file)
    path.held = held
    return path


def _frame_bytes(frame: InputLike) -> bytes | None:
    """Bytes of a table that is in memory; None: it is none."""
    if isinstance(frame, Drive):
        frame = {"time": frame.time, "offset": frame.offset, **frame.context, "drive": [frame.name] * len(frame)}
    elif hasattr(frame, "headline"):
        frame = frame.to_frame()
    try:
        frame = frame_of(frame)
    except TypeError:
        return None
    import pyarrow as pa
    import pyarrow.feather as feather

    frame = frame.rename(columns=str).reset_index(drop=True)
    if not frame.columns.is_unique:
        raise FormatError(f"column {frame.columns[frame.columns.duplicated()][0]!r} appears twice")
    out = io.BytesIO()
    try:
        table = pa.Table.from_pandas(frame, preserve_index=False)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError):  # cells of several kinds become text
        mixed = [name for name in frame.columns if frame[name].dtype == object]
        texts = {name: frame[name].map(str, na_action="ignore") for name in mixed}
        table = pa.Table.from_pandas(frame.assign(**texts), preserve_index=False)
    feather.write_feather(table, out, compression="uncompressed")
    return out.getvalue()


def is_document(item: InputLike) -> bool:
    """Whether it is a scenario, or a path or folder of some, and no table in memory."""
    if isinstance(item, bytes | bytearray | memoryview):
        return bytes(item[:64]).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")
    if isinstance(item, str | os.PathLike) or hasattr(item, "read"):
        return not has_magic(str(item)) or hasattr(item, "read")
    return not isinstance(item, Drive) and not hasattr(item, "headline") and _frame_bytes(item) is None
