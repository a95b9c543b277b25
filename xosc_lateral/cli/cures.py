"""Mistakes of a command line, and what to write instead, as far as that can be told from its words."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import Any

from xosc_lateral.base.errors import meant_for

SIBLINGS = {
    "-h": ("help", "usage"), "--version": ("version",),
    "convert": ("enrich", "batch", "replay", "run", "generate", "randomize"),
    "fit": ("train", "learn", "fit-profile"), "evaluate": ("score", "compare", "validate"), "check": ("health", "lint"),
    "sample": ("simulate", "offsets"), "view": ("show", "open", "plot"),
    "verify": ("diff", "status"),
    "profiles list": ("list", "library", "list-profiles"), "template write": ("new", "write-template"),
    "template list": ("templates", "list-templates"), "convert SCENARIO... or FOLDER": ("convert-many",),
    "import": ("import-drives", "read-drives"), "close-loop": ("loop", "identify", "refine", "plan-loop"),
}  # fmt: skip
"""Verb -> what others call it, Python's calls among them."""

FORMER_VERBS = {"play": "states"}
"""What a verb was called in 0.2 -> its name."""

FORMER_OPTIONS = {
    "--osi": ("--report", "{}"), "--summary": ("--report", "{}"), "--entity": ("--profile", "{}"),
    "--jam-corridor": ("--with", "jam-corridor"), "--road-path": ("--road", "{}"), "--cluster": ("--jobs", "{}"),
    "--player-library": ("--player", "{}"), "--job-timeout": ("--job-limit", "{}s"),
    "--job-memory": ("--job-limit", "{}MB"), "--log-json": ("--json", "--verbose"), "--train": ("--home", "{}"),
    "--for": ("--player", "{}"), "--resample": ("--attempts", "{}"), "--only": ("--enrich", "{}"),
    "--vehicle": ("--profile", "{}"),
}  # fmt: skip
"""What was an option of a verb that has it no more -> what is said today, and its value."""

GONE_OPTIONS = {
    "--propose": "check TABLE... --write-mapping MAPPING.toml",
    "--threshold": "a program's score above 0.5 is an alarm; --tune finds the threshold of any score",
    "--answer-time": "a program has 10 s for each answer, and 60 s for the first",
}
"""What was an option of a verb and has no name of today -> what takes its place."""


def todays_verb(word: str) -> str:
    """A verb by its name of today; a former one is named on standard error."""
    if word in FORMER_VERBS:
        print(f"xosc-lateral: warning: {word} is called {FORMER_VERBS[word]} now", file=sys.stderr)
    return FORMER_VERBS.get(word, word)


def todays(words: Sequence[str], options: Collection[str]) -> list[str]:
    """A verb's words by today's names, of a verb with these options; former ones are named on standard error."""
    made, rest = list[str](), list(words)
    while rest:
        word = rest.pop(0)
        if word == "--":
            return [*made, word, *rest]
        option, equals, value = word.partition("=")
        name, form = FORMER_OPTIONS.get(option, ("", ""))
        if option in options or name not in options:
            made.append(word)
            continue
        if "{}" in form and not equals:
            value = rest.pop(0) if rest else ""
        made += [name, form.format(value)]
        line = f"xosc-lateral: warning: {option} is {name} {form.format('...')} now, and will be unknown next"
        print(line, file=sys.stderr)
    return made


PYTHON_WORDS = ("None", "True", "False")


def cures(words: Sequence[str], usage: Any = None) -> Iterator[str]:
    """What to write in place of words; `usage`: typer's error, where they are wrong usage."""
    for before, word in pairwise(words):
        name, equals, value = word.partition("=")
        if equals and name.isidentifier() and not before.startswith("-"):
            yield f"{word!r} stands alone: options are written --{name.replace('_', '-')} {value}, before each value"
        if word in PYTHON_WORDS or value in PYTHON_WORDS:
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
    yield from (f"{old} is gone: {today}" for old, today in GONE_OPTIONS.items() if f"No such option: {old}" in wrong)
    if help_text := getattr(getattr(usage, "param", None), "help", None):
        yield f"{' '.join(usage.param.opts)}: {help_text}"
    if context is not None and not verbs:
        yield f"as in {(context.command.epilog or '').partition('Examples:')[2].strip().partition(chr(10))[0]}"
