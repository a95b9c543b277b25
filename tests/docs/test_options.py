"""Every option is taught where a reader learns what to do: README, quickstart, tutorials, how-tos."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from xosc_lateral.cli import VERBS, verb

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.lint


def commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    if not hasattr(command, "commands"):
        yield name, command
    for inner, one in getattr(command, "commands", {}).items():
        yield from commands(f"{name} {inner}", one)


def options() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Verb, and the names of one of its options."""
    for each in VERBS:
        for name, command in commands(each, verb(each)):
            for param in command.params:
                if param.param_type_name == "option" and "--help" not in param.opts:
                    yield name, (*param.opts, *param.secondary_opts)


def taught() -> str:
    """Text of the pages that say what to do: of the menu, those below Quickstart, Tutorials and How to."""
    menu = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    parts = "".join(
        menu.partition(begin)[2].partition(end)[0]
        for begin, end in (("  - Quickstart", "  - Concepts:"), ("  - How to:", "  - Reference:"))
    )
    pages = [ROOT / "README.md", *(ROOT / "docs" / name for name in re.findall(r"[\w/]+\.md", parts))]
    pages += [ROOT / "docs" / "closing_the_loop.md"]
    return "\n".join(page.read_text(encoding="utf-8") for page in pages)


def test_every_option_is_taught() -> None:
    text = taught()
    missing = {
        f"{verb} {names[0]}"
        for verb, names in options()
        if not any(re.search(rf"{re.escape(name)}(?![\w-])", text) for name in names)
    }
    assert not missing


def test_no_verb_has_more_than_thirty() -> None:
    counted = Counter(verb for verb, _ in options())
    assert max(counted.values()) <= 30, counted.most_common(3)
