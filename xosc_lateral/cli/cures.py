"""Mistakes of a command line, and what to write instead, as far as that can be told from its words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from xosc_lateral.base.errors import meant_for

SIBLINGS = {
    "-h": ("help", "usage"), "--version": ("version",),
    "convert": ("enrich", "batch", "replay", "run", "generate", "randomize"),
    "fit": ("train", "learn", "fit-profile"), "evaluate": ("score", "compare", "validate"), "check": ("health", "lint"),
    "states": ("play",), "sample": ("simulate", "offsets"), "view": ("show", "open", "plot"),
    "verify": ("diff", "status"),
    "profiles list": ("list", "library", "list-profiles"), "template write": ("new", "write-template"),
    "template list": ("templates", "list-templates"), "convert SCENARIO... or FOLDER": ("convert-many",),
    "import": ("import-drives", "read-drives"), "close-loop": ("loop", "identify", "refine", "plan-loop"),
}  # fmt: skip
"""Verb -> what others call it, Python's calls among them."""

GONE = {
    "--osi": "--report FILE.mcap", "--summary": "--report FILE.md", "--jam-corridor": "--with jam-corridor",
    "--entity": "-p NAME=PROFILE", "--road-path": "--road FOLDER", "--cluster": "--jobs ADDRESS",
    "--player-library": "--player LIBRARY", "--job-timeout": "--job-limit 600s", "--job-memory": "--job-limit 4000MB",
    "--log-json": "--json --verbose", "--for": "--player", "--resample": "--attempts", "--only": "--enrich",
    "--train": "--home", "--propose": "check TABLE... --write-mapping MAPPING.toml",
    "--threshold": "a program's score above 0.5 is an alarm; --tune finds the threshold of any score",
    "--answer-time": "a program has 10 s for each answer, and 60 s for the first",
}  # fmt: skip
"""What was an option of a verb -> what takes its place."""

PYTHON = ("None", "True", "False")


def cures(words: Sequence[str], usage: Any = None) -> Iterator[str]:
    """What to write in place of words; `usage`: typer's error, where they are wrong usage."""
    for before, word in pairwise(words):
        name, equals, value = word.partition("=")
        if equals and name.isidentifier() and not before.startswith("-"):
            yield f"{word!r} stands alone: options are written --{name.replace('_', '-')} {value}, before each value"
        if word in PYTHON or value in PYTHON:
            yield f"{value or word} is a word of Python: leave an option out that is not wanted, a switch has no value"
    if usage is None:
        return
    first = next(iter(words), "")
    context: Any = getattr(usage, "ctx", None)
    verbs = getattr(getattr(context, "command", None), "commands", {})
    later = next((word for word in words if word in verbs), None)
    if first.startswith("-") and later is not None:
        yield f"options come after the verb: {later} ... {first}"
    elif verbs:
        name = next((word for word in words if word not in context.command_path.split()), "").lower().replace("_", "-")
        same = [verb for verb, others in SIBLINGS.items() if context.parent is None and name in others]
        yield f"{same[0]!r} does that" if same else f"{context.command_path} has {', '.join(verbs)}{meant_for(name)}"
    wrong = str(usage.format_message())
    yield from (f"{old} is gone: {today}" for old, today in GONE.items() if f"No such option: {old}" in wrong)
    if help_text := getattr(getattr(usage, "param", None), "help", None):
        yield f"{' '.join(usage.param.opts)}: {help_text}"
    if context is not None and not verbs:
        yield f"as in {(context.command.epilog or '').partition('Examples:')[2].strip().partition(chr(10))[0]}"
