"""Words of the command line that several verbs share: options, and how results are said."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from functools import partial, wraps
from inspect import Parameter, Signature, signature
from logging import Formatter, LogRecord
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args, get_type_hints

import typer

from xosc_lateral.base.errors import XoscLateralError, by_owner
from xosc_lateral.base.names import in_json, in_terminal
from xosc_lateral.base.plugins import offered
from xosc_lateral.workflows.options import MAPPING, SHARED, Option, options_of, texts

if TYPE_CHECKING:
    from xosc_lateral.files.mapping import TableMapping
    from xosc_lateral.workflows.result import Result

Verb = TypeVar("Verb", bound=Callable[..., Any])

DOCS_PAGES = {
    "convert": "docs/scenarios.md, docs/pipeline.md",
    "fit": "docs/model.md, docs/formats.md",
    "play": "docs/playing.md",
    "profiles": "docs/library.md",
}
"""Module of verbs -> pages that say more."""


class _LogFormat(Formatter):
    """Lines of the log: for eyes, or with `--json` as JSON."""

    def __init__(self, context: typer.Context) -> None:
        super().__init__("%(asctime)s.%(msecs)03d %(message)s", "%H:%M:%S")
        self._said = context.params

    def format(self, record: LogRecord) -> str:
        """A line; what the options are is known when it comes."""
        if self._said.get("as_json"):
            return in_json({"event": "log", "time": round(record.created, 3), "message": record.getMessage()})
        return super().format(record)


def _begin_log(context: typer.Context, wanted: bool) -> bool:
    """Send the package's log (`logging`, "xosc_lateral") to standard error, until the command ends."""
    if wanted:
        import logging

        log, handler = logging.getLogger("xosc_lateral"), logging.StreamHandler()
        handler.setFormatter(_LogFormat(context))
        log.addHandler(handler)
        context.call_on_close(partial(log.setLevel, log.level))
        context.call_on_close(partial(log.removeHandler, handler))
        log.setLevel(logging.INFO)
    return wanted


# What is said of one option stays together.
# fmt: off
Verbose = Annotated[bool, typer.Option("--verbose", "-v", callback=_begin_log,
    help="Log files and steps, with times, on standard error; with --json as lines of JSON.")]
AsJson = Annotated[bool, typer.Option("--json", help="Machine-readable: JSON on standard output, errors included.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Osi = Annotated[str | None, typer.Option("--osi", metavar="TRACE",
    help="ASAM OSI trace too (.mcap, .osi): lanes, boxes, motion; extra osi.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with 1 on warnings.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that xosc-lateral did not write itself.")]
Tables = Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Drive tables: .csv, .csv.gz, .parquet.")]
Columns = Annotated[list[str] | None, typer.Option("--map", metavar="NAME=COLUMN[:UNIT]",
    help="Column under another name or unit, e.g. speed=v_kmh:km/h; may be repeated.")]
MappingFile = Annotated[Path | None, typer.Option(*MAPPING.flags, **MAPPING.words)]
# fmt: on

Options = dict[str, Any]
"""What was said of a call's options, by its keywords."""


def pairs(words: Iterable[str] | None, option: str) -> dict[str, str]:
    """Read ``NAME=VALUE`` words; wrong usage when there is no ``=`` or a name comes twice."""
    with naming_option(option):
        return texts(list(words or ()))


@contextmanager
def naming_option(option: str) -> Iterator[None]:
    """A value that can't be read is wrong usage of that option."""
    try:
        yield
    except ValueError as error:
        if isinstance(error, XoscLateralError):
            raise
        raise typer.BadParameter(str(error), param_hint=option) from error


def say(text: object, *, err: bool = False) -> None:
    """Lines on standard output or standard error: names that others gave do not steer the terminal."""
    typer.echo(in_terminal(by_owner(str(text))), err=err)


def say_json(values: Any) -> None:
    """One line of JSON on standard output."""
    typer.echo(in_json(values))


def write_stdout(data: str | bytes) -> None:
    """The output itself, byte by byte, for ``-o -``."""
    sys.stdout.flush()
    sys.stdout.buffer.write(data.encode() if isinstance(data, str) else data)
    sys.stdout.buffer.flush()


@dataclass(frozen=True, slots=True)
class Mapped:
    """Options of verbs that read tables: what columns are called."""

    columns: Columns = None
    mapping_file: MappingFile = None

    def mapping(self) -> TableMapping:
        """What `--mapping` and `--map` say; a column of the latter stands in for one of the former."""
        from xosc_lateral.files.mapping import as_mapping

        return as_mapping(self.mapping_file).with_words(pairs(self.columns, "--map"))


def refuse_warnings(lines: Collection[str], strict: bool) -> None:
    """End with exit code 1 where something was warned of, and nothing may be."""
    if strict and lines:
        raise typer.Exit(1)


@dataclass(frozen=True, slots=True)
class Printing:
    """Options of verbs that say what came out, and how it is said."""

    quiet: Quiet = False
    verbose: Verbose = False
    as_json: AsJson = False

    @property
    def logs_json(self) -> bool:
        """Whether progress is wanted as lines of JSON."""
        return self.as_json and self.verbose

    def say(self, result: Result, *, even: bool = False, err: bool = False) -> None:
        """JSON on standard output, else text there, or on standard error; `even`: whatever was to be kept quiet."""
        if self.as_json:
            say_json(result.to_dict())
        elif even or not self.quiet:
            say(result, err=err)

    def warn(self, lines: Iterable[str], *, strict: bool = False) -> None:
        """Say warnings on standard error; `strict`: they are errors, and are said to whom wants it quiet as well."""
        for line in lines if strict or not self.quiet else ():
            say(f"xosc-lateral: warning: {line}", err=True)

    def say_words(self, words: str, values: Any, *, err: bool = True) -> None:
        """Words, on standard error for what is no output; or, where there are any, values as JSON."""
        if self.as_json and values is not None:
            say_json(values)
        elif not self.quiet:
            say(words, err=err)

    def say_written(self, paths: Path | Sequence[Path], **values: Any) -> None:
        """Paths of files, a line each."""
        if self.as_json:
            written = {"output": str(paths)} if isinstance(paths, Path) else {"outputs": [str(path) for path in paths]}
            say_json({**values, **written})
        elif not self.quiet:
            for path in [paths] if isinstance(paths, Path) else paths:
                say(path)


@dataclass(frozen=True, slots=True)
class Writing(Printing):
    """The same of verbs that write files."""

    force: Force = False

    def claim(self, inputs: Iterable[Path], **wanted: tuple[str | None, str]) -> list[Path | None]:
        """Files that may be written, before any work: by kind what was said of one, and its usual name in a folder.

        None: it is not wanted, or goes to standard output.
        """
        from xosc_lateral.files.osi import SUFFIXES, osi_wanted
        from xosc_lateral.files.output_paths import STDOUT, claim, output_file
        from xosc_lateral.files.output_tables import output_suffixes
        from xosc_lateral.workflows.result import PAGE_SUFFIXES, PROFILE_SUFFIXES

        suffixes = {"page": PAGE_SUFFIXES, "trace": SUFFIXES, "profile": PROFILE_SUFFIXES, "mapping": (".toml",)}
        paths = {
            kind: None if text in (None, STDOUT) else output_file(text, usual, suffixes.get(kind) or output_suffixes())
            for kind, (text, usual) in wanted.items()
        }
        claim(paths.values(), [path for path in inputs if path.is_file()], force=self.force)
        osi_wanted(paths.get("trace"))
        return list(paths.values())


def flags_of(name: str, option: Option) -> tuple[str, ...]:
    """How a setting is called on the command line."""
    return option.flags or (f"--{name.replace('_', '-')}",)


def _fields(group: type) -> list[Parameter]:
    """Options of a group such as `Printing`, `force` first."""
    kinds = get_type_hints(group, include_extras=True)  # of each base in its own module
    parameters = [each.replace(annotation=kinds[name]) for name, each in signature(group).parameters.items()]
    return sorted(parameters, key=lambda parameter: parameter.name != "force")


def _parameters(source: Any, options: Mapping[str, Option]) -> Iterator[Parameter]:
    """The command line's options for them."""
    defaults = signature(source).parameters
    for name, option in options.items():
        if option.kind is object:  # `columns`
            yield from _fields(Mapped)
            continue
        if option.said_by:
            continue
        default = None if type(None) in get_args(option.kind) else defaults[name].default
        words = typer.Option(*flags_of(name, option), **option.words)
        yield Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[option.kind, words])


def _read(options: Mapping[str, Option], words: dict[str, Any]) -> Options:
    """What was said of them; wrong usage if it can't be."""
    values = Options()
    for name, option in options.items():
        if option.kind is object:  # `columns`
            values[name] = Mapped(words.pop("columns"), words.pop("mapping_file")).mapping()
        elif not option.said_by and (stated := words.pop(name)) not in (None, []):
            with naming_option(flags_of(name, option)[0]):
                values_said = {name: stated} if option.gives is None else option.gives(stated)
                if foreign := sorted(values_said.keys() - options.keys()):
                    raise ValueError(f"{values_said[foreign[0]]}: no {foreign[0]} can be said here")
                values |= {key: options[key].read(value) for key, value in values_said.items()}
    return values


@contextmanager
def _naming_missing(stated: Mapping[str, Any]) -> Iterator[None]:
    """A file, folder or profile that is not there is named with the option that asked for it."""
    try:
        yield
    except (XoscLateralError, OSError) as error:
        path = error.filename if isinstance(error, OSError) else getattr(error, "path", None)
        missing = str(path) if path is not None and not Path(path).exists() else getattr(error, "unknown", None)
        for option, value in stated.items():
            words = [
                str(word) for word in (value if isinstance(value, list) else [value]) if isinstance(word, str | Path)
            ]
            if missing in (*words, *(word.partition("=")[2] for word in words)):
                error.add_note(option)
                break
        raise


def with_options(verb: Callable[..., Any]) -> Callable[..., None]:
    """The verb with options of its own for those that it has together in one parameter.

    Such a parameter is a dataclass as `Printing`, or a mapping that is annotated with a class of settings or a call.
    What all verbs say alike (`SHARED`) needs its name only.
    """
    declared = signature(verb, eval_str=True).parameters
    plain = {name for name, parameter in declared.items() if not hasattr(parameter.annotation, "__metadata__")}
    shared = {name: option for name, option in SHARED.items() if name in plain}
    parameters: list[Parameter] = []
    groups: dict[str, list[str]] = {}
    sources: dict[str, dict[str, Option]] = {}
    for name, parameter in declared.items():
        kinds = [parameter.annotation, *getattr(parameter.annotation, "__metadata__", ())]
        source = next((kind for kind in kinds if is_dataclass(kind) or hasattr(kind, "__options__")), None)
        if name in shared:
            added = list(_parameters(verb, {name: shared[name]}))
        elif source is None:
            added = [parameter]
        elif source is parameter.annotation:
            added = _fields(source)
            groups[name] = [option.name for option in added]
        else:
            sources[name] = {key: option for key, option in options_of(source).items() if key not in declared}
            added = list(_parameters(source, sources[name]))
        parameters += [option.replace(kind=Parameter.KEYWORD_ONLY) for option in added]

    @wraps(verb)
    def run(**values: Any) -> None:
        known = {name: option for options in (shared, *sources.values()) for name, option in options.items()}
        stated = {flags_of(name, one)[0]: values.get(name) for name, one in known.items() if not one.said_by}
        for name, names in groups.items():
            values[name] = declared[name].annotation(**{option: values.pop(option) for option in names})
        for name, options in sources.items():
            values[name] = _read(options, values)
        values |= _read(shared, values)
        with _naming_missing(stated):
            verb(**values)

    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return run


def command(group: typer.Typer, name: str, short: str, *examples: str, cls: Any = None) -> Callable[[Verb], Verb]:
    """Add a verb to a group, with examples and its page at the end of its help; `cli.verb` gives it its options."""

    def add(verb: Verb) -> Verb:
        pages = DOCS_PAGES | {home: pages for home, _, _, pages in offered("VERBS").values()}
        page = pages[verb.__module__.removeprefix("xosc_lateral.cli.")]
        lines = "".join(f"\n  xosc-lateral {line}" for line in examples)
        epilog = f"\b\nExamples:{lines}\n\n\b\nMore: {page}"
        group.command(name, cls=cls, short_help=short, epilog=epilog)(verb)
        return verb

    return add
