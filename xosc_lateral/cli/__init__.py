"""The command line: this module only names its verbs, and turns errors into exit codes."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from signal import SIGINT
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup

from xosc_lateral.base.errors import FormatError, XoscLateralError
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
    "vary": "A scenario's lane changes as long as real ones.",
}
for _name, (_, _does, _before, _) in offered("VERBS").items():
    _first = [*VERBS].index(_before) if _before else len(VERBS)
    VERBS = dict([*list(VERBS.items())[:_first], (_name, _does), *list(VERBS.items())[_first:]])
"""Name -> what it does; those of extras where they say."""

VERB_MODULES = {
    "check": "fit", "sample": "fit", "evaluate": "fit", "verify": "convert", "reproduce": "convert", "states": "play",
    "view": "play", "segments": "play", "template": "play", "vary": "play",
}  # fmt: skip
"""Verbs whose module, which is loaded when they are used, is not called like them."""

OLD_VERBS = {"play": "states"}
"""What was the name of a verb in 0.2 -> its name."""

OLD_OPTIONS = {"convert": {"--for": "--player", "--resample": "--attempts", "--only": "--enrich"}}
"""Verb -> what was the name of an option of it in 0.2 -> its name."""

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
        word = _today(args[0], OLD_VERBS)
        name, known, rest = super().resolve_command(ctx, [word, *args[1:]])
        return name, known and verb(str(name)), [*_renamed(rest, OLD_OPTIONS.get(word, {}))]


def _renamed(words: Sequence[str], names: Mapping[str, str]) -> Iterator[str]:
    """Options by today's names; whatever comes behind `--` is none."""
    for k, word in enumerate(words):
        if word == "--":
            yield from words[k:]
            return
        option, equals, value = word.partition("=")
        yield _today(option, names) + equals + value


def _today(word: str, names: Mapping[str, str]) -> str:
    """A word by its name of today; a former one is named on standard error."""
    if word in names:
        print(f"xosc-lateral: warning: {word} is called {names[word]} now, and will be unknown next", file=sys.stderr)
    return names.get(word, word)


app = typer.Typer(
    cls=_Verbs, name="xosc-lateral", help="Lifelike lateral movement for OpenSCENARIO traffic.", **TYPER_STYLE
)
app.callback()(_root)


def _in_words(error: XoscLateralError | OSError) -> str:
    """What went wrong, after the option at fault; the system's errors in the form of ours, file first, no number."""
    text = str(error)
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        text = f"{error.filename}: {error.strerror[0].lower()}{error.strerror[1:]}"
    return ": ".join([*getattr(error, "__notes__", ()), text])


def _as_dict(error: XoscLateralError | OSError) -> dict[str, Any]:
    """The error for machines: `kind`, `message`, and where it is, as far as that is known."""
    place: dict[str, Any] = {"path": None, "line": None, "element": None}
    if isinstance(error, FormatError):
        path = None if error.path is None else str(error.path)
        place = {"path": path, "line": error.line, "element": error.element}
    elif isinstance(error, OSError) and error.filename is not None:
        place["path"] = str(error.filename)
    return {"error": {"kind": type(error).__name__, "message": " ".join(_in_words(error).split()), **place}}


SIBLINGS = {
    "convert": ("enrich", "batch", "replay", "run", "generate", "randomize"),
    "fit": ("train", "learn", "fit-profile"), "evaluate": ("score", "compare", "validate"), "check": ("health", "lint"),
    "sample": ("simulate", "offsets"), "view": ("show", "open", "plot"), "verify": ("diff", "status"),
    "profiles list": ("list", "profile", "library", "list-profiles"), "template write": ("new", "write-template"),
    "template list": ("templates", "list-templates"), "convert SCENARIO... or FOLDER": ("convert-many",),
    "import": ("import-drives", "read-drives"), "close-loop": ("loop", "identify", "refine", "plan-loop"),
}  # fmt: skip
"""Verb -> what others call it, Python's calls among them."""


GONE = {"--propose": "check TABLE... --write-mapping MAPPING.toml does that"}
"""Option that there was -> what takes its place."""


def _cures(words: Sequence[str], wrong: str) -> Iterator[str]:
    """What to write in place of words that are wrong usage, where that can be told from them."""
    first = next(iter(words), "")
    later = next((word for word in words if word in VERBS), None)
    if first.startswith("-") and later is not None:
        yield f"options come after the verb: {later} ... {first}"
    elif first not in VERBS and not first.startswith("-"):
        name = first.replace("_", "-").lower()
        yield from (f"{verb!r} does that" for verb, others in SIBLINGS.items() if name in others)
    yield from (f"{option} is gone: {instead}" for option, instead in GONE.items() if option in words)
    if "'--profile'" in wrong and "Missing" in wrong:
        yield f"the profile is named by -p, as in {first} -p motorway or -p PROFILE.json"
    if "not a valid float" in wrong:
        yield "a number without its unit is expected, in the one that the option's help names: s, m, m/s, Hz"


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
            line = in_terminal(f"xosc-lateral: {' '.join(_in_words(error).split())}")
            if "--log-json" in words:
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
        for cure in _cures(words, str(usage.format_message())):
            print(in_terminal(f"xosc-lateral: {cure}"), file=sys.stderr)
        code = usage.exit_code
    if argv is None:
        sys.exit(code)
    return int(code or 0)
