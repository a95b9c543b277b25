"""Everything that this package raises on purpose. Imports nothing, so that every layer can raise it.

Exit codes of the command line follow from this tree: an `XoscLateralError` or an `OSError` means that the input is at
fault (exit 1, one line); anything else is our bug and keeps its traceback.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

MEMORY_FOLDER = re.compile(r"/in-memory-[0-9a-f]{16}/(?:up/)*")
"""Of files that a caller holds (`files.held`): he knows them by the names that come after it."""
COPIES = re.compile(r"(?<!\S)\S*[/\\]xosc-lateral-\w{8}[/\\]elsewhere[/\\]([a-zA-Z][a-zA-Z0-9+.-]+)[/\\]")
"""Before the place of what lies elsewhere in its storage, of which this is a copy (`files.remote`)."""


class XoscLateralError(Exception):
    """Base of all errors that a user can cause. `str()` of it is one line, fit for stderr: no file moves a cursor."""

    typed: str | None = None  # the line as the command line says it, where a call of Python says it in its own words
    messages: tuple[object, ...] = ()  # what was remarked before it, as `messages` of results are: often, why

    def __str__(self) -> str:
        return printable(by_owner(cut(super().__str__())))


LONGEST_LINE = 2000  # of a message [characters]


def cut(text: str) -> str:
    """Text without the middle of what is too long for a message: a file may hold a million letters for a number."""
    return text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE // 2]} ... {text[-LONGEST_LINE // 2 :]}"


def by_owner(text: str) -> str:
    """Text in which files in memory, and copies of what lies elsewhere, have the names that their owner gave."""
    return COPIES.sub(r"\1://", MEMORY_FOLDER.sub("", text))


NO_BREAK_SPACES = "\u00a0\u202f"
"""Between a number and its unit; Python counts no blank but U+0020 as printable."""


def printable(text: str) -> str:
    """Text without signs that steer a terminal or turn the direction of reading; they appear as escapes."""
    return "".join(sign if sign.isprintable() or sign in NO_BREAK_SPACES else ascii(sign)[1:-1] for sign in text)


class FormatError(XoscLateralError, ValueError):
    """What is wrong with a file, with value and what to do; `element`: XML element or column (``Event 'brake'``)."""

    def __init__(self, what: str, *, path: object = None, line: int | None = None, element: str | None = None) -> None:
        self.what, self.path, self.line, self.element = cut(what), path, line, element
        super().__init__(" ".join(locate(self.what, path=path, line=line, element=element).split()))


class MissingFileError(FormatError):
    """A file that another one names is not there."""


class UnsupportedElementError(FormatError):
    """An element that is understood but can't be played: named, never skipped."""


class PlaybackError(FormatError):
    """The scenario is valid XML, yet it can't be played (an entity without a place, a lane that is not there)."""


class SimulationError(XoscLateralError, ValueError):
    """A running simulation, its library or what it says can't be used; whatever ran before goes on."""


class DriverProfileError(XoscLateralError, ValueError):
    """A driver profile contradicts itself, or a profile of the name `unknown` is nowhere."""

    unknown: str | None = None


class NotEnoughDataError(XoscLateralError, ValueError):
    """Too little measured data: the message carries what was found and what was needed."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`` (did you mean 'motorway'?)``, or nothing where no known name is like that one."""
    from difflib import get_close_matches

    near = get_close_matches(name, list(known), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


KINDS = {
    (".xosc",): "a scenario, for convert, view, states, segments, vary and detect",
    (".xodr",): "a road: name the scenario that drives on it",
    (".json",): "JSON, as driver profiles are: -p FILE names one",
    (".csv", ".gz", ".zst", ".parquet", ".feather", ".arrow"): "a table: fit TABLE -o PROFILE.json makes a profile",
    (".xlsx", ".xls", ".ods"): "a workbook: save its sheet as CSV",
    (".txt", ".tsv", ".dat"): "a table if it is text with a header: call it NAME.csv",
    (".mf4", ".mdf", ".mcap", ".osi", ".bag", ".mat"): "a recording: import FORMAT makes a table of it",
    (".html", ".htm"): "a page: open it in a browser",
}
"""Endings of files -> what they are, and where they are wanted."""


def meant_for(path: object) -> str:
    """`` (mine.json is JSON, as ...)`` for a file that came where another kind is wanted; nothing if it is unknown."""
    name = str(path).replace("\\", "/").rpartition("/")[2]
    kinds = [words for endings, words in KINDS.items() if name.lower().endswith(endings)]
    return f" ({name} is {kinds[0]})" if kinds else ""


def names_beside(path: object) -> list[str]:
    """What lies in a path's folder; nothing where there is no such folder."""
    from pathlib import Path

    try:
        return [other.name for other in Path(str(path)).parent.iterdir()]
    except (OSError, ValueError):  # a zero byte in the name
        return []


def absent(path: object) -> str:
    """What is said of a file or folder that is not there, with the one beside it that may be meant."""
    return f"no such file or folder{did_you_mean(str(path).rpartition('/')[2], names_beside(path))}"


def locate(what: str, *, path: object = None, line: int | None = None, element: str | None = None) -> str:
    """``path:line: element: what``, leaving out what is unknown."""
    place = "" if path is None else f"{by_owner(str(path))}:" if line is None else f"{by_owner(str(path))}:{line}:"
    return " ".join(part for part in (place, "" if element is None else f"{element}:", what) if part)
