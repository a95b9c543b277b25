"""Outcomes of long studies: one line of JSON each, written as each is known, read again for tables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any


def append_outcome(path: Path | None, outcome: Mapping[str, Any]) -> None:
    """Add one line to a file; without a file nothing is kept."""
    if path is not None:
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(outcome) + "\n")


def read_outcomes(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """All of several files, by seed: parts of a study are run side by side."""
    lines = [line for path in paths for line in path.read_text(encoding="utf-8").splitlines()]
    return sorted(map(json.loads, lines), key=lambda outcome: outcome["seed"])
