"""Names from strangers in the cells of a CSV."""

from __future__ import annotations

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def harmless(text: str) -> str:
    """Text that no spreadsheet takes for a formula: what begins like one gets an apostrophe before it.

    Reference: OWASP, "CSV Injection".
    """
    return f"'{text}" if text.startswith(_FORMULA) else text
