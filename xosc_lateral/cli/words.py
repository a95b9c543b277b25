"""Words of the command line that several verbs share: options, and how results are said."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from enum import StrEnum
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args, get_type_hints

import typer

from xosc_lateral.base.errors import XoscLateralError

if TYPE_CHECKING:
    from xosc_lateral.files.mapping import TableMapping
    from xosc_lateral.workflows.conversion.options import Option
    from xosc_lateral.workflows.result import Result

Verb = TypeVar("Verb", bound=Callable[..., Any])

PAGES = {
    "close_loop": "docs/closing_the_loop.md",
    "convert": "docs/scenarios.md, docs/pipeline.md",
    "detect": "docs/how_to/detect.md",
    "fit": "docs/model.md, docs/formats.md",
    "import_": "docs/real_data.md, docs/formats.md",
    "live": "docs/live.md",
    "play": "docs/playing.md",
    "profiles": "docs/library.md",
    "reconstruct": "docs/how_to/from_a_recording.md",
}
"""Module of verbs -> pages that say more."""


def _begin_log(context: typer.Context, wanted: bool) -> bool:
    """Send the package's log (`logging`, "xosc_lateral") to standard error, until the command ends."""
    if wanted:
        import logging

        log, handler = logging.getLogger("xosc_lateral"), logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s.%(msecs)03d %(message)s", "%H:%M:%S"))
        log.addHandler(handler)
        log.setLevel(logging.INFO)
        context.call_on_close(lambda: log.removeHandler(handler))
    return wanted


# What is said of one option stays together.
# fmt: off
Verbose = Annotated[bool, typer.Option("--verbose", "-v", callback=_begin_log,
    help="Log files and steps, with times, on standard error.")]
AsJson = Annotated[bool, typer.Option("--json", help="Machine-readable: JSON on standard output, errors included.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Osi = Annotated[str | None, typer.Option("--osi", metavar="TRACE",
    help="ASAM OSI trace too (.mcap, .osi): lanes, boxes, motion; extra osi.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that xosc-lateral did not write itself.")]
Seed = Annotated[int, typer.Option(help="Random seed; the same inputs and seed give the same bytes.", min=0)]
Library = Annotated[list[Path] | None, typer.Option(metavar="FOLDER",
    help="Folder with more profiles; may be repeated.")]
Profile = Annotated[str, typer.Option("--profile", "-p", metavar="NAME|PATH", help="Driver profile.")]
Tables = Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Drive tables: .csv, .csv.gz, .parquet.")]
Columns = Annotated[list[str] | None, typer.Option("--map", metavar="NAME=COLUMN[:UNIT]",
    help="Column under another name or unit, e.g. speed=v_kmh:km/h; may be repeated.")]
MappingFile = Annotated[Path | None, typer.Option("--mapping", metavar="FILE.toml",
    help="Saved mapping of columns (import table --propose FILE...).")]
Parameters = Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE",
    help="Set a scenario parameter; may be repeated.")]
Allow = Annotated[list[Path] | None,
    typer.Option(help="Folder that roads and catalogs may be read from; may be repeated.")]
Road = Annotated[Path | None, typer.Option("--road", help="OpenDRIVE file, whatever the scenario says.",
    show_default=False)]
RoadPath = Annotated[list[Path] | None, typer.Option("--road-path", metavar="DIR",
    help='Folder with roads known by name ("Town04"); may be repeated.')]


def _number(value: float | None) -> float | None:
    """NaN is within every range that is tested by comparing."""
    if value is not None and math.isnan(value):
        raise typer.BadParameter(f"{value} is not a number")
    return value


TimeLimit = Annotated[float | None,
    typer.Option(help="Cut runs off here [s]; default: 60 without a stop trigger, 3600 with one.", callback=_number,
    min=0.1, max=86_400, show_default=False)]


class Part(StrEnum):
    """Parts of a profile that are left out unless asked for."""

    SENSOR = "sensor"


With = Annotated[list[Part] | None, typer.Option("--with",
    help="sensor: add the error of the sensor that measured the drives.")]

# fmt: on


SHARED = {
    "seed": Seed,
    "parameters": Parameters,
    "library": Library,
    "allow": Allow,
    "road": Road,
    "road_path": RoadPath,
    "time_limit": TimeLimit,
    "with_sensor": With,
}
"""Options of `convert` that other verbs have as well."""


def pairs(words: Iterable[str] | None, option: str) -> dict[str, str]:
    """Read ``NAME=VALUE`` words; wrong usage when there is no ``=`` or a name comes twice."""
    from xosc_lateral.workflows.conversion.options import texts

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


def warn(lines: Iterable[str]) -> None:
    """Say on standard error what has to be known whatever was asked to be kept quiet."""
    for line in lines:
        typer.echo(f"xosc-lateral: warning: {line}", err=True)


def say_json(values: Any) -> None:
    """One line of JSON on standard output."""
    typer.echo(json.dumps(values, ensure_ascii=False, allow_nan=False))


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


@dataclass(frozen=True, slots=True)
class Printing:
    """Options of verbs that say what came out, and how it is said."""

    quiet: Quiet = False
    verbose: Verbose = False
    as_json: AsJson = False

    def say(self, result: Result, *, even: bool = False, err: bool = False) -> None:
        """JSON on standard output, else text there, or on standard error; `even`: whatever was to be kept quiet."""
        if self.as_json:
            say_json(result.to_dict())
        elif even or not self.quiet:
            typer.echo(str(result), err=err)

    def say_words(self, words: str, values: Any, *, err: bool = True) -> None:
        """Words, on standard error for what is no output; or, where there are any, values as JSON."""
        if self.as_json and values is not None:
            say_json(values)
        elif not self.quiet:
            typer.echo(words, err=err)

    def say_written(self, paths: Path | Sequence[Path], **values: Any) -> None:
        """Paths of files, a line each."""
        if self.as_json:
            written = {"output": str(paths)} if isinstance(paths, Path) else {"outputs": [str(path) for path in paths]}
            say_json({**values, **written})
        elif not self.quiet:
            for path in [paths] if isinstance(paths, Path) else paths:
                typer.echo(path)


@dataclass(frozen=True, slots=True)
class Written(Printing):
    """The same of verbs that write files."""

    force: Force = False


def flags_of(name: str, option: Option) -> tuple[str, ...]:
    """How a setting is called on the command line."""
    return option.flags or (f"--{name.replace('_', '-')}",)


def _parameters(settings: type) -> list[Parameter]:
    """An option for each setting, or for each field of a group such as `Printing`, `force` first."""
    from xosc_lateral.workflows.conversion.options import settable

    items = settable(settings)
    if not items:
        kinds = get_type_hints(settings, include_extras=True)  # of each base in its own module
        group = [each.replace(annotation=kinds[name]) for name, each in signature(settings).parameters.items()]
        return sorted(group, key=lambda parameter: parameter.name != "force")
    parameters = []
    for item in items:
        option: Option = item.metadata["option"]
        kind = (
            SHARED.get(item.name) or Annotated[option.kind, typer.Option(*flags_of(item.name, option), **option.words)]
        )
        default = None if type(None) in get_args(get_args(kind)[0]) else item.default
        parameters.append(Parameter(item.name, Parameter.KEYWORD_ONLY, default=default, annotation=kind))
    return parameters


def _read(settings: type, /, **words: Any) -> Any:
    """A group; or what was said of settings, wrong usage if it can't be."""
    from xosc_lateral.workflows.conversion.options import options_of

    options = options_of(settings)
    if not options:
        return settings(**words)
    values = {name: value for name, value in words.items() if value not in (None, [])}
    for name, value in values.items():
        with naming_option(flags_of(name, options[name])[0]):
            options[name].read(value)
    return values


def with_options(verb: Callable[..., Any]) -> Callable[..., None]:
    """The verb with options of its own for those that it has together in one parameter.

    Such a parameter is a dataclass as `Printing`, or a mapping that is annotated with a class of settings.
    """
    options, groups = list[Parameter](), dict[str, tuple[type, list[str]]]()
    for parameter in signature(verb, eval_str=True).parameters.values():
        kinds = [parameter.annotation, *getattr(parameter.annotation, "__metadata__", ())]
        settings = next((kind for kind in kinds if isinstance(kind, type) and is_dataclass(kind)), None)
        added = [parameter] if settings is None else _parameters(settings)
        if settings is not None:
            groups[parameter.name] = settings, [option.name for option in added]
        options += [option.replace(kind=Parameter.KEYWORD_ONLY) for option in added]

    @wraps(verb)
    def run(**values: Any) -> None:
        for name, (settings, names) in groups.items():
            values[name] = _read(settings, **{option: values.pop(option) for option in names})
        verb(**values)

    run.__signature__ = Signature(options)  # type: ignore[attr-defined]
    return run


def command(group: typer.Typer, name: str, short: str, *examples: str, cls: Any = None) -> Callable[[Verb], Verb]:
    """Add a verb to a group, with examples and its page at the end of its help."""

    def add(verb: Verb) -> Verb:
        page = PAGES[verb.__module__.rpartition(".")[2]]
        lines = "".join(f"\n  xosc-lateral {line}" for line in examples)
        epilog = f"\b\nExamples:{lines}\n\n\b\nMore: {page}"
        group.command(name, cls=cls, short_help=short, epilog=epilog)(with_options(verb))
        return verb

    return add
