"""JSON text: read strictly, and written the same for the same values."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import JSON_DEPTH

_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"')

_HALF = re.compile(r"\\u[dD][89a-fA-F]")  # of a character that JSON writes in two escapes

_BRACKETS = re.compile(r"[\[\]{}]")


def parse_json(data: bytes, path: Path) -> Any:
    """JSON of an input file. Raises `FormatError`."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"not JSON in UTF-8 ({error}): save it as UTF-8", path=path) from error
    try:
        refuse_depth(text)
    except ValueError as error:
        raise FormatError(str(error), path=path) from error
    try:
        values = json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)
        if _HALF.search(text):
            json.dumps(values, ensure_ascii=False).encode()
        return values
    except UnicodeEncodeError as error:
        raise FormatError("not JSON: half a character (a \\u escape without its other half)", path=path) from error
    except json.JSONDecodeError as error:
        raise FormatError(f"not JSON: {error.msg}", path=path, line=error.lineno) from error
    except ValueError as error:
        raise FormatError(f"not JSON: {error}", path=path) from error


def refuse_depth(text: str) -> None:
    """Refuse what is nested deeper than `limits.JSON_DEPTH`, JSON or TOML, with a `ValueError`."""
    depth = deepest = 0
    for bracket in _BRACKETS.finditer(_STRINGS.sub("", text)):
        depth += 1 if bracket[0] in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > JSON_DEPTH.value:
        raise ValueError(JSON_DEPTH.refusal(deepest))


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:40]} is no number that a computer holds")
    return number


def canonical_json(value: Any, indent: int = 0) -> str:
    """JSON text of plain values: keys as they come, one item a line, lists of numbers on one line."""
    pad = " " * (indent + 1)
    if isinstance(value, Mapping):
        items = [f"{pad}{json.dumps(str(key))}: {canonical_json(item, indent + 1)}" for key, item in value.items()]
        return "{\n" + ",\n".join(items) + "\n" + " " * indent + "}" if items else "{}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        if all(item is None or isinstance(item, str | int | float) for item in value):
            return "[" + ", ".join(canonical_json(item) for item in value) + "]"
        return "[\n" + ",\n".join(pad + canonical_json(item, indent + 1) for item in value) + "\n" + " " * indent + "]"
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} can't be written as JSON")
    return json.dumps(value, ensure_ascii=False)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number in JSON")
