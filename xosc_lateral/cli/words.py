"""Words of the command line that several verbs read."""

from __future__ import annotations

from collections.abc import Iterable

import typer


def pairs(words: Iterable[str] | None, option: str) -> dict[str, str]:
    """Read ``NAME=VALUE`` words; wrong usage when there is no ``=`` or a name comes twice."""
    found: dict[str, str] = {}
    for word in words or ():
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise typer.BadParameter(f"{option} {word!r}: expected NAME=VALUE")
        if name in found:
            raise typer.BadParameter(f"{option} {name!r} is given twice")
        found[name] = value
    return found
