"""The mark that a file of ours carries: what made it, and from what.

It is for people and for the check that nothing is converted twice. Anybody can write one: no permission depends on it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from lxml import etree

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.element import line_of

MARK = "xosc-lateral provenance: "
HEADER_MARK = "[xosc-lateral: "


def mark(root: etree._Element, provenance: Mapping[str, Any], summary: str) -> None:
    """Write the provenance as a comment before the file header, and in short into its description."""
    header = root.find("{*}FileHeader")
    text = json.dumps(provenance, sort_keys=True, ensure_ascii=False, default=str)
    comment = etree.Comment(f" {MARK}{_comment_safe(text)} ")
    comment.tail = root.text  # the white space before the first child
    root.insert(0 if header is None else root.index(header), comment)
    if header is not None:
        description = (header.get("description") or "").rstrip()
        header.set("description", f"{description} {HEADER_MARK}{summary}]".strip())


def provenance_of(root: etree._Element) -> Mapping[str, Any] | None:
    """Provenance of a file of ours; empty if only the header's mark is left; None for anybody else's file."""
    for comment in root.iterchildren(etree.Comment):
        text = (comment.text or "").strip()
        if text.startswith(MARK):
            try:
                found = json.loads(text[len(MARK) :])
            except (ValueError, RecursionError):
                return {}
            return found if isinstance(found, dict) else {}
    header = root.find("{*}FileHeader")
    return {} if header is not None and HEADER_MARK in (header.get("description") or "") else None


def refuse_converted(root: etree._Element, path: object) -> None:
    """`FormatError` for a file that was converted before: its offsets would be counted twice."""
    found = provenance_of(root)
    if found is None:
        return
    inputs = found.get("inputs")
    # Seen from the scenario, which has no folder in its name then; a road or a catalog may lie beside it.
    beside = [name for name in inputs if "/" not in name and name.endswith(".xosc")] if isinstance(inputs, dict) else []
    hint = f"; convert {beside[0]} instead" if len(beside) == 1 else "; convert its source instead"
    header = root.find("{*}FileHeader")
    line = None if header is None else line_of(header)
    raise FormatError(f"was converted by xosc-lateral already{hint}", path=path, line=line, element="FileHeader")


def _comment_safe(text: str) -> str:
    """JSON in which no ``--`` stands, which would end the comment, and which does not end in a dash."""
    return text.replace("--", "-\\u002d").replace("--", "-\\u002d")
