"""Texts that people write in more than one way, and texts set in columns."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import Any

_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]+")


def composed(value: Any) -> Any:
    """A text with its accents in one piece (Unicode's NFC), as most keyboards have them and macOS' file names don't.

    Line breaks and the like, which headers of spreadsheets have and a name may not (`names.unwritable`), are spaces.
    Also all texts in mappings and lists; anything else stays as it is.
    """
    if isinstance(value, str):
        text = value if value.isascii() else unicodedata.normalize("NFC", value)
        return text if text.isprintable() else _CONTROLS.sub(" ", text)
    if isinstance(value, dict):
        return {composed(key): composed(one) for key, one in value.items()}
    return [composed(one) for one in value] if isinstance(value, list) else value


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of a table as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def counted(number: int, thing: str) -> str:
    """``1 segment``, ``2 segments``."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def hours_in_words(hours: float) -> str:
    """In hours, or in minutes where it is less than one."""
    return f"{hours:.2f} h" if hours >= 1.0 else f"{60.0 * hours:.1f} min"
