"""Names that others gave (columns, profiles, entities): what they may hold, and how each language writes them.

`unwritable` is asked where names are read. Texts of others leave the process through the one function of a language: C,
cells of CSV, JSON and lines on a terminal here; XML through lxml and `xml.etree`, HTML and SVG through `html.escape`,
which write whatever `unwritable` lets pass.
"""

from __future__ import annotations

import json
import re
from typing import Any

from xosc_lateral.base.errors import printable

_UNWRITABLE = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]")

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", *"\uff1d\uff0b\uff0d\uff20")  # the latter four as wide as in Asia


def unwritable(name: str) -> str | None:
    """Why a text is no name, or None: control characters, ends of lines and halves of characters are in none."""
    wrong = _UNWRITABLE.search(name)
    return None if wrong is None else f"{name[:60]!a} is no name: it has the control character {ascii(wrong[0])[1:-1]}"


def in_terminal(text: str) -> str:
    """Lines for a terminal: nothing in them steers it, or turns the direction of reading."""
    return "\n".join(map(printable, text.split("\n")))


def in_json(values: Any) -> str:
    """A line of JSON that a terminal may show: what would steer it is one of JSON's own escapes."""
    text = json.dumps(values, ensure_ascii=False, allow_nan=False)
    return "".join(sign if sign.isprintable() else json.dumps(sign)[1:-1] for sign in text)


def in_csv(text: str) -> str:
    """A cell that no spreadsheet takes for a formula, by an apostrophe before it (OWASP, "CSV Injection")."""
    return f"'{text}" if text.startswith(_FORMULA) else text


def in_c(text: str) -> str:
    """A string literal of C in ASCII; no trigraph, and no escape that goes on into the next character."""
    signs = (chr(byte) for byte in text.encode("utf-8", "replace"))
    return '"' + "".join(one if " " <= one <= "~" and one not in '\\"?' else f"\\{ord(one):03o}" for one in signs) + '"'


def in_c_comment(text: str) -> str:
    """Lines within a comment of C, in ASCII: they neither end it, nor begin another, nor join lines."""
    return re.sub(r"(?<=\*)(?=/)|(?<=/)(?=\*)|(?<=\?)(?=\?)", " ", re.sub(r"[^ -~\n]|\\", "_", text))


def in_c_identifier(text: str) -> str:
    """Letters, digits and underscores; something else has to stand before it."""
    return re.sub(r"[^0-9A-Za-z]", "_", text)
