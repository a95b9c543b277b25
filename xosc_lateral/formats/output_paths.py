"""Where outputs go, and what may be written over.

A path that ends in a slash, or is a folder, means a file of the usual name in it. The suffix decides the format. A file
that this package did not write stays, unless the user says otherwise.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import refuse_outputs
from xosc_lateral.formats.own_files import is_own

STDOUT = "-"
"""Name of the standard output where an output is asked for."""


LONGEST_NAME = 255
"""Of a file, on all common systems. [byte]"""


def file_name(name: str, what: str) -> str:
    """A name that others gave, as the name of a file: the one gate to paths.

    Parameters
    ----------
    name : str
    what : str
        Whose name it is, for the message.

    Raises
    ------
    FormatError
        It could lead to another folder, or no file can have it.
    """
    wrong = name in ("", ".", "..") or any(sign in "/\\" or sign < " " for sign in name)
    if wrong or len(name.encode(errors="replace")) > LONGEST_NAME:
        raise FormatError(f"{what} {name[:60]!r}: expected the name of a file, without a folder")
    return name


def path_below(folder: Path, name: str, what: str) -> Path:
    """A path below a folder from names that others gave, with forward slashes.

    Raises
    ------
    FormatError
        It leads elsewhere.
    """
    return folder.joinpath(*(file_name(part, what) for part in name.split("/")))


def output_file(output: str | Path, usual_name: str, suffixes: Sequence[str]) -> Path:
    """Path of an output file.

    Raises `FormatError` for another suffix.

    Parameters
    ----------
    output : str or Path
        As the user gave it. Ends in a slash, or is a folder: `usual_name` in that folder.
    usual_name : str
        File name in a folder.
    suffixes : sequence of str
        Formats that can be written, lower case with their dot.
    """
    path = output_folder(output) / file_name(usual_name, "name") if is_folder(output) else Path(output)
    if not path.name.lower().endswith(tuple(suffixes)):
        kind = path.suffix or "a file without suffix"
        raise FormatError(f"can't write {kind}: expected a name ending in {' or '.join(suffixes)}", path=path)
    return path


def is_folder(output: str | Path) -> bool:
    """Whether an output means a folder: it is one, or ends in a slash."""
    text = str(output)
    return text.endswith(("/", os.sep)) or Path(output).is_dir()


def output_folder(output: str | Path) -> Path:
    """Path of an output folder, which need not be there yet.

    Raises `FormatError` if a file is there.
    """
    path = Path(output)
    if path.is_file():
        raise FormatError("is a file, expected a folder", path=path)
    return path


def claim(outputs: Iterable[Path | None], inputs: Iterable[Path] = (), *, force: bool = False) -> None:
    """Refuse outputs that can't be meant, or that would replace somebody else's file, before any work is done.

    Raises `FormatError`: see `refuse_outputs`; or a file is there that this package did not write.

    Parameters
    ----------
    outputs : iterable of Path or None
        Files to be written; None: not wanted.
    inputs : iterable of Path
        Files that are read.
    force : bool
        Replace whatever is there, apart from inputs.
    """
    wanted = [output for output in outputs if output is not None]
    refuse_outputs(wanted, inputs)
    for output in wanted:
        if not force and output.exists() and not is_own(output):
            raise FormatError("exists and was not written by xosc-lateral; --force replaces it", path=output)
