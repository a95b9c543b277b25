"""What a page shows after a command, in a block ``output``, beside what the command prints."""

from __future__ import annotations

import re
from decimal import Decimal

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")


def difference(shown: str, printed: str, *, last_digit: float = 0.5) -> str | None:
    """The first line that is not printed as shown, or none. A line ``...`` stands for any lines.

    A printed number has to round to the one that is shown; `last_digit` is how far it may be away, in units of the last
    digit that is shown.
    """
    lines = printed.splitlines()
    skip = False
    for line in shown.splitlines():
        if line == "...":
            skip = True
            continue
        while skip and lines and not _alike(line, lines[0], last_digit):
            lines.pop(0)
        skip = False
        if not lines or not _alike(line, lines.pop(0), last_digit):
            return line
    return None if skip or not lines else f"more is printed: {lines[0]}"


def _alike(shown: str, printed: str, last_digit: float) -> bool:
    page, command = (" ".join(text.split()) for text in (shown, printed))
    if NUMBER.sub("#", page) != NUMBER.sub("#", command):
        return False
    pairs = [(Decimal(a), Decimal(b)) for a, b in zip(NUMBER.findall(page), NUMBER.findall(command), strict=True)]
    return all(abs(a - b) <= Decimal(last_digit).scaleb(int(a.as_tuple().exponent)) for a, b in pairs)
