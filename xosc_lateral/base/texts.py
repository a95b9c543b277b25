"""Texts that people write in more than one way."""

from __future__ import annotations

import unicodedata
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
