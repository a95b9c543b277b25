"""The command line: this module only names its verbs, and turns errors into exit codes."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from signal import SIGINT
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.names import in_json, in_terminal
from xosc_lateral.base.plugins import offered
from xosc_lateral.base.signals import Interrupted, raising_signals
from xosc_lateral.base.version import __version__
from xosc_lateral.files.source import guarding_inputs

VERBS = {
    "convert": "Make scenarios lifelike: one, several, a folder.",
    "verify": "Whether outputs are what would be made today.",
    "reproduce": "Make an output again from what it carries.",
    "view": "Play a scenario in the browser.",
    "states": "Write the nominal motion as a table.",
    "segments": "Where offsets are sampled, and why not elsewhere.",
    "check": "What tables of drives hold, and what can be fitted.",
    "fit": "Fit a profile to measured drives.",
    "sample": "Sample offsets alone, as a table.",
    "evaluate": "Score a profile on measured drives.",
    "profiles": "The library of driver profiles.",
    "template": "Scenarios to start from.",
}
for _name, (_, _does, _before, _) in offered("VERBS").items():
    _first = [*VERBS].index(_before) if _before else len(VERBS)
    VERBS = dict([*list(VERBS.items())[:_first], (_name, _does), *list(VERBS.items())[_first:]])
"""Name -> what it does; those of extras where they say."""

VERB_MODULES = {
    "check": "fit", "sample": "fit", "evaluate": "fit", "verify": "convert", "reproduce": "convert", "states": "play",
    "view": "play", "segments": "play", "template": "play",
}  # fmt: skip
"""Verbs whose module, which is loaded when they are used, is not called like them."""

TYPER_STYLE: dict[str, Any] = {
    "no_args_is_help": True,
    "pretty_exceptions_enable": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
    "rich_markup_mode": None,  # units in help texts are in brackets, which rich would take for markup
}


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"xosc-lateral {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Lifelike lateral movement for OpenSCENARIO traffic."""


def group_of_verbs() -> typer.Typer:
    """What a module adds its verbs to: a group, though of one."""
    group = typer.Typer(**TYPER_STYLE)
    group.callback()(_root)
    return group


def home(name: str) -> str:
    """Module of a verb."""
    return str(offered("VERBS").get(name, [f"xosc_lateral.cli.{VERB_MODULES.get(name, name)}"])[0])


@cache
def verb(name: str) -> Any:
    """The command of a verb, its module loaded, and with the options of its call."""
    from xosc_lateral.cli.words import with_options

    app = import_module(home(name)).app
    chosen = group_of_verbs()
    chosen.registered_commands = [info for info in app.registered_commands if info.name == name]
    chosen.registered_groups = [info for info in app.registered_groups if info.name == name]
    for group in (chosen, *(cast(typer.Typer, info.typer_instance) for info in chosen.registered_groups)):
        for info in group.registered_commands:
            info.callback = info.callback and with_options(info.callback)
    return cast(TyperGroup, typer.main.get_command(chosen)).commands[name]


class _Verbs(TyperGroup):
    """Help and completion have the names and lines of `VERBS`; the verb that is run is loaded."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = {name: TyperCommand(name, short_help=does) for name, does in VERBS.items()}

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        from xosc_lateral.cli.cures import todays, todays_verb

        name, known, rest = super().resolve_command(ctx, [todays_verb(args[0]), *args[1:]])
        if known is None:
            return name, known, rest
        command = verb(str(name))
        asked: Any = getattr(command, "commands", {}).get(next(iter(rest), ""), command)  # of a group: one of its verbs
        return name, command, todays(rest, {flag for param in asked.params for flag in param.opts})


app = typer.Typer(
    cls=_Verbs, name="xosc-lateral", help="Lifelike lateral movement for OpenSCENARIO traffic.", **TYPER_STYLE
)
app.callback()(_root)


def _in_words(error: XoscLateralError | OSError) -> str:
    """What went wrong, after the option at fault; the system's errors in the form of ours, file first, no number."""
    text = getattr(error, "typed", None) or str(error)
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        text = f"{error.filename}: {error.strerror[0].lower()}{error.strerror[1:]}"
    return ": ".join([*getattr(error, "__notes__", ()), text])


def _as_dict(error: XoscLateralError | OSError) -> dict[str, Any]:
    """The error for machines: `kind`, `message`, and where it is, as far as that is known."""
    path = getattr(error, "path", None) or getattr(error, "filename", None)
    place = {name: getattr(error, name, None) for name in ("line", "element")}
    what = {"kind": type(error).__name__, "message": " ".join(_in_words(error).split())}
    messages = [one.to_dict() for one in getattr(error, "messages", ())]
    return {"error": {**what, "path": None if path is None else str(path), **place, "messages": messages}}


def _remarked_before(error: XoscLateralError | OSError) -> Iterator[str]:
    """What was remarked before it, often its cause: the first, and how many more there are."""
    if remarks := getattr(error, "messages", ()):
        yield f"remarked before: {remarks[0]}{f', and {len(remarks) - 1} more (--json)' if len(remarks) > 1 else ''}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 done, 1 the input is at fault (one line on stderr), 2 wrong usage, 128 + a signal."""
    words = sys.argv[1:] if argv is None else list(argv)
    try:
        with guarding_inputs(), raising_signals():
            code = app(args=words, standalone_mode=False)
    except (XoscLateralError, OSError) as error:
        if isinstance(error, BrokenPipeError):  # `... -o - | head` has seen enough
            sys.stderr.close()
            code = 0
        else:
            from xosc_lateral.cli.cures import cures

            line = "; ".join([_in_words(error), *cures(words), *_remarked_before(error)])
            line = in_terminal(f"xosc-lateral: {' '.join(line.split())}")
            if "--json" in words and {"-v", "--verbose"} & {*words}:
                line = json.dumps({"event": "error", "time": round(time.time(), 3), **_as_dict(error)})
            print(line, file=sys.stderr)
            if "--json" in words:
                print(in_json(_as_dict(error)))
            code = 1
    except (typer.Abort, KeyboardInterrupt, Interrupted) as error:
        print(
            "xosc-lateral: interrupted; files that were written are complete. Run it again for the rest.",
            file=sys.stderr,
        )
        code = 128 + (error.number if isinstance(error, Interrupted) else SIGINT)
    except Exception as error:
        # Typer's usage errors come from a click that is vendored in some of its releases: known by attributes.
        if not hasattr(error, "exit_code") or not hasattr(error, "format_message"):
            raise
        usage = cast(Any, error)
        usage.show()
        from xosc_lateral.cli.cures import cures

        for cure in cures(words, usage):
            print(in_terminal(f"xosc-lateral: {cure}"), file=sys.stderr)
        code = usage.exit_code
    if argv is None:
        sys.exit(code)
    return int(code or 0)
