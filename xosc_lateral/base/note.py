"""What a user has to know of what was read, played, fitted or run: one kind of line, whoever says it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from xosc_lateral.base.errors import XoscLateralError, by_owner, locate, printable


@dataclass(frozen=True, slots=True)
class Note:
    """One thing to know, and what it is about."""

    what: str
    path: str | None = None  # file
    line: int | None = None  # in it, from 1
    element: str | None = None  # XML element or column, as errors name it
    is_warning: bool = False  # it can hardly be meant, or changes what the output is worth: `--strict` refuses it
    entity: str | None = None
    run: str | None = None  # of several runs, the one that it speaks of: how vehicles under test drive in it

    def __str__(self) -> str:
        """One line: file, line, element, what, run."""
        run = f" (run: {self.run})" if self.run else ""
        line = locate(self.what + run, path=self.path, line=self.line, element=self.element)
        return printable(by_owner(" ".join(line.split())))

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        path = None if self.path is None else by_owner(self.path)
        place = {"path": path, "line": self.line, "element": self.element}
        about = {"entity": self.entity, "run": self.run}
        return {"severity": "warning" if self.is_warning else "note", "what": self.what, **place, **about}


class Telling:
    """Something with `messages`: all that there is to say of it."""

    __slots__ = ()

    @property
    def messages(self) -> tuple[Note, ...]:
        """In the order in which things happened: read, played, written."""
        return ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What `--strict` refuses, a line each."""
        return tuple(str(one) for one in self.messages if one.is_warning)

    @property
    def notes(self) -> tuple[str, ...]:
        """What else there is to know, a line each."""
        return tuple(str(one) for one in self.messages if not one.is_warning)

    def message_records(self) -> list[dict[str, Any]]:
        """All of it, for JSON."""
        return [one.to_dict() for one in self.messages]

    def message_lines(self) -> list[str]:
        """All of it, for a terminal: notes first."""
        lines = [f"  note: {line}" for line in self.notes]
        return lines + [f"  warning: {line}" for line in self.warnings]


def notes(lines: Iterable[str]) -> tuple[Note, ...]:
    """Lines that only say something."""
    return tuple(map(Note, lines))


def warnings(lines: Iterable[str], *, entity: str | None = None) -> tuple[Note, ...]:
    """Lines that warn."""
    return tuple(Note(line, is_warning=True, entity=entity) for line in lines)


def rows_left_out(rows: Mapping[str, int]) -> tuple[Note, ...]:
    """Rows of a table that are in no result, by reason."""
    return notes((f"rows left out: {count} {why}" for why, count in rows.items() if count))


@contextmanager
def remarked_before(notes: Callable[[], Iterable[Note]]) -> Iterator[None]:
    """What is refused within carries what was remarked until then (`XoscLateralError.messages`), each once."""
    try:
        yield
    except XoscLateralError as error:
        error.messages = tuple(dict.fromkeys((*notes(), *error.messages)))
        raise
