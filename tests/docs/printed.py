"""What a page shows after a command, in a block ``output``, beside what the command prints."""

from __future__ import annotations

import re

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
P_VALUE = re.compile(r"\(p = [^)]*\)")
TOLERANCE = 0.25
"""Relative: another processor, another last digit."""


def difference(shown: str, printed: str) -> str | None:
    """The first line that is not printed as shown, or none. A line ``...`` stands for any lines."""
    lines = printed.splitlines()
    skip = False
    for line in shown.splitlines():
        if line == "...":
            skip = True
            continue
        while skip and lines and not _alike(line, lines[0]):
            lines.pop(0)
        skip = False
        if not lines or not _alike(line, lines.pop(0)):
            return line
    return None if skip or not lines else f"more is printed: {lines[0]}"


def _alike(shown: str, printed: str) -> bool:
    ours, theirs = (" ".join(P_VALUE.sub("", text).split()) for text in (shown, printed))
    if NUMBER.sub("#", ours) != NUMBER.sub("#", theirs):
        return False
    pairs = zip(map(float, NUMBER.findall(ours)), map(float, NUMBER.findall(theirs)), strict=True)
    return all(abs(one - two) <= TOLERANCE * max(abs(one), abs(two)) for one, two in pairs)
