"""Values as readers see them: numbers to three digits, a dash for what is missing."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence

NOTHING = "–"
"""Shown for a value that is not there (None or NaN)."""


def format_number(value: float, digits: int = 3) -> str:
    """Format to so many significant digits: ``0.2134 -> 0.213``, ``1234.5 -> 1234``, ``1.2e-09``, NaN as a dash."""
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value == 0 or float(value).is_integer():
        return f"{value + 0.0:.0f}" if abs(value) < 1e7 else f"{value:.{digits - 1}e}"
    rounded = f"{value:.{digits - 1}e}"
    magnitude = int(rounded.partition("e")[2])  # of what is shown: 9.996 is 10.0
    if not -4 <= magnitude < 6:
        return rounded
    return f"{value:.{max(0, digits - 1 - magnitude)}f}"


def format_value(value: object, spec: str = "") -> str:
    """Format anything: numbers by the format specification or to three digits, lists and mappings written out."""
    if value is None or value == "":
        return NOTHING
    if isinstance(value, bool) or type(value).__name__ == "bool":  # numpy's bool is no subclass of bool
        return "yes" if value else "no"
    if isinstance(value, numbers.Real):
        return NOTHING if math.isnan(value) else format(value, spec) if spec else format_number(float(value))
    if isinstance(value, Mapping):
        value = [f"{name}: {format_value(part)}" for name, part in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(format_value, value)) or NOTHING
    return str(value)


def is_number(value: object) -> bool:
    """Whether a cell is set like a number; what is missing goes with either."""
    return value is None or (isinstance(value, numbers.Real) and not isinstance(value, bool))
