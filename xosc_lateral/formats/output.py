"""Writing files so that nobody ever sees half of one."""

from __future__ import annotations

import secrets
from pathlib import Path


def write_whole(path: Path, data: bytes | str) -> None:
    """Write a file beside its target and move it there: it appears whole or not at all.

    Parameters
    ----------
    path : Path
        Missing folders are made.
    data : bytes or str
        Text is written as UTF-8, with line ends as they are.

    Raises
    ------
    OSError
        When the file can't be written; the target is as it was.
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        beside.write_bytes(content)
        beside.replace(path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
