"""XML documents with the same bytes each time."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from datetime import datetime

FIXED_DATE = datetime(2024, 1, 1)
"""Written where the formats ask for a date: the same settings give the same bytes."""


def document(root: ET.Element) -> str:
    """An element tree as an indented document."""
    ET.indent(root, "  ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
