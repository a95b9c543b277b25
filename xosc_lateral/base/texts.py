"""Texts that people write in more than one way, and texts set in columns."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from typing import Any


def composed(value: Any) -> Any:
    """A text with its accents in one piece (Unicode's NFC), as most keyboards have them and macOS' file names don't.

    Also all texts in mappings and lists; anything else stays as it is.
    """
    if isinstance(value, str):
        return value if value.isascii() else unicodedata.normalize("NFC", value)
    if isinstance(value, dict):
        return {composed(key): composed(one) for key, one in value.items()}
    return [composed(one) for one in value] if isinstance(value, list) else value


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of a table as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
