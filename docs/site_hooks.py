"""What the site adds to the pages in this folder: references generated from the code, and links out of the folder.

`mkdocs build` calls these functions (see ``mkdocs.yml``). The pages themselves are Markdown that a code host shows too.
"""

from __future__ import annotations

import csv
import importlib
import os
import posixpath
import re
from html import escape
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"\[([^\]]*)\]\((?!https?:|mailto:)([^)#\s]+)(#[^)]*)?\)")


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages, and the project's own files that belong to the site."""
    from mkdocs.structure.files import File

    generated = {
        "reference/cli.md": command_line(),
        "reference/api.md": python(),
        "reference/limits.md": limits(),
        "reference/elements.md": elements(),
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
    }
    for name, text in generated.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Name folders, and files outside this one, in place of a link to them: the site has no pages of those."""
    here = posixpath.dirname(page.file.src_uri)

    def outside(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join("docs", here, match[2]))
        is_page = target.startswith("docs/") and not (ROOT / target).is_dir()
        return match[0] if is_page else f"{match[1]} (`{target}`)"

    return LINK.sub(outside, markdown)


def limits() -> str:
    """Every limit of input files, as the code has it."""
    from xosc_lateral.base.limits import limits_table

    intro = "Beyond one of these, one line says so. Only those of `--job-limit` can be changed."
    return f"# Limits of input files\n\n{intro}\n\n{limits_table()}\n"


def elements() -> str:
    """Every element of OpenSCENARIO 1.3, and what playing does with it."""
    with (ROOT / "docs" / "elements.csv").open(encoding="utf-8", newline="") as lines:
        head, *rows = csv.reader(lines)
    table = [head, ["---"] * len(head), *([f"`{name}`", *rest] for name, *rest in rows)]
    text = "\n".join(f"| {' | '.join(row)} |" for row in table)
    return f"# Every element of OpenSCENARIO 1.3\n\n*Differs*: from the reference player.\n\n{text}\n"


def command_line() -> str:
    """Every verb with its options, as the parser knows them."""
    os.environ.setdefault("COLUMNS", "100")
    from xosc_lateral.cli import VERBS, verb

    parts = [
        "# Command line",
        "Generated from the code; `xosc-lateral VERB --help` prints the same.",
        "Exit code 0: done. 1: the input is at fault, in one line with file, line, element and value. 2: wrong usage.",
    ]
    parts += [part for name in VERBS for part in _verb([name], verb(name))]
    return "\n\n".join(parts) + "\n"


def _verb(names: list[str], command: Any) -> list[str]:
    if hasattr(command, "commands"):
        head = [f"## `{' '.join(names)}`", _text(command.help)]
        return head + [part for name, inner in command.commands.items() for part in _verb([*names, name], inner)]
    context = command.context_class(command, info_name=" ".join(["xosc-lateral", *names]))
    usage = " ".join(command.get_usage(context).split()).removeprefix("Usage: ")
    parts = [f"{'#' * (1 + len(names))} `{' '.join(names)}`", _text(command.help), f"```text\n{usage}\n```"]
    records = [one.get_help_record(context) for one in command.params if one.name != "help"]
    rows = [
        f"| {_code(_plain(name))} | {_text(meaning).replace('[', chr(92) + '[')} |"
        for name, meaning in filter(None, records)
    ]
    parts.append("\n".join(["| option | meaning |", "|---|---|", *rows]))
    examples = re.search(r"Examples:\n(.*)", command.epilog or "", flags=re.DOTALL)
    if examples:
        lines = "\n".join(line.strip() for line in examples[1].splitlines() if line.strip())
        parts.append(f"```text\n{lines}\n```")
    return parts


def _plain(option: str) -> str:
    """Types as a user would say them: Typer writes ``<list[Path]>``."""
    words = {"str": "text", "int": "whole number", "float": "number"}
    kind = r"<(?:list\[)?(\w+)\]?(?: range)?>"
    return re.sub(kind, lambda match: f"<{words.get(match[1].lower(), match[1].lower())}>", option)


def _code(text: str) -> str:
    """Code in a table's cell, where a bar in backticks would keep its backslash."""
    return f"<code>{escape(' '.join(text.split())).replace('|', '&#124;')}</code>"


def _text(text: str | None) -> str:
    return " ".join((text or "").split()).replace("|", "\\|")


def python() -> str:
    """The promised names, each by its docstring."""
    package = importlib.import_module("xosc_lateral")
    names = [name for name in package.__all__ if name in package._HOME]
    functions = [name for name in names if name[0].islower()]
    errors = [name for name in names if name.endswith("Error")]
    classes = [name for name in names if name not in functions and name not in errors]
    parts = ["# Python", "The names that `import xosc_lateral` promises, generated from their docstrings."]
    for title, group in (("Functions", functions), ("Classes", classes), ("Errors", errors)):
        parts.append(f"## {title}")
        parts += [
            f"::: xosc_lateral.{package._HOME[name]}.{name}\n    options:\n      heading_level: 3" for name in group
        ]
    return "\n\n".join(parts) + "\n"
