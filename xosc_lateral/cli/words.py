"""Words of the command line that several verbs share: options, and how results are said."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, is_dataclass
from enum import StrEnum
from functools import partial, wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args

import typer

if TYPE_CHECKING:
    from xosc_lateral.files.mapping import TableMapping
    from xosc_lateral.workflows.conversion.options import Option
    from xosc_lateral.workflows.result import Result

Verb = TypeVar("Verb", bound=Callable[..., Any])

AsJson = Annotated[bool, typer.Option("--json", help="Machine-readable: JSON on standard output, errors included.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Osi = Annotated[
    str | None,
    typer.Option("--osi", metavar="TRACE", help="ASAM OSI trace too (.mcap, .osi): lanes, boxes, motion; extra osi."),
]
Force = Annotated[bool, typer.Option("--force", help="Replace files that xosc-lateral did not write itself.")]
Seed = Annotated[int, typer.Option(help="Random seed; the same inputs and seed give the same bytes.", min=0)]
Library = Annotated[
    list[Path] | None, typer.Option(metavar="FOLDER", help="Folder with more profiles; may be repeated.")
]
Profile = Annotated[str, typer.Option("--profile", "-p", metavar="NAME|PATH", help="Driver profile.")]
Tables = Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Drive tables: .csv, .csv.gz, .parquet.")]
Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="NAME=COLUMN[:UNIT]",
        help="Column under another name or unit, e.g. speed=v_kmh:km/h; may be repeated.",
    ),
]
MappingFile = Annotated[
    Path | None,
    typer.Option("--mapping", metavar="FILE.toml", help="Saved mapping of columns (import table --propose FILE...)."),
]
Parameters = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set a scenario parameter; may be repeated.")
]
Allow = Annotated[
    list[Path] | None, typer.Option(help="Folder that roads and catalogs may be read from; may be repeated.")
]
Road = Annotated[
    Path | None, typer.Option("--road", help="OpenDRIVE file, whatever the scenario says.", show_default=False)
]
RoadPath = Annotated[
    list[Path] | None,
    typer.Option("--road-path", metavar="DIR", help='Folder with roads known by name ("Town04"); may be repeated.'),
]


def _number(value: float | None) -> float | None:
    """NaN is within every range that is tested by comparing."""
    if value is not None and math.isnan(value):
        raise typer.BadParameter(f"{value} is not a number")
    return value


TimeLimit = Annotated[
    float | None,
    typer.Option(
        help="Cut runs off here [s]; default: 60 without a stop trigger, 3600 with one.",
        callback=_number,
        min=0.1,
        max=86_400,
        show_default=False,
    ),
]


class Part(StrEnum):
    """Parts of a profile that are left out unless asked for."""

    SENSOR = "sensor"


With = Annotated[
    list[Part] | None, typer.Option("--with", help="sensor: add the error of the sensor that measured the drives.")
]


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
    found: dict[str, str] = {}
    for word in words or ():
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise typer.BadParameter(f"{word!r}: expected NAME=VALUE", param_hint=option)
        if name in found:
            raise typer.BadParameter(f"{name!r} is given twice", param_hint=option)
        found[name] = value
    return found


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
    """An option for each setting."""
    from xosc_lateral.workflows.conversion.options import settable

    found = []
    for item in settable(settings):
        option: Option = item.metadata["option"]
        words = typer.Option(*flags_of(item.name, option), **option.words)
        kind = SHARED.get(item.name) or Annotated[option.kind, words]
        default = None if type(None) in get_args(get_args(kind)[0]) else item.default
        found.append(Parameter(item.name, Parameter.KEYWORD_ONLY, default=default, annotation=kind))
    return found


def _read(settings: type, /, **said: Any) -> dict[str, Any]:
    """What was said of the settings; wrong usage, with the option's name, if it can't be."""
    from xosc_lateral.workflows.conversion.options import options_of

    options = options_of(settings)
    given = {name: value for name, value in said.items() if value not in (None, [])}
    for name, value in given.items():
        try:
            options[name].read(value)
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint=flags_of(name, options[name])[0]) from error
    return given


def _is_settings(kind: Any) -> bool:
    return isinstance(kind, type) and is_dataclass(kind)


def spelled_out(verb: Callable[..., Any]) -> Callable[..., None]:
    """The verb with options of its own for those that it has together in one parameter.

    Such a parameter is a dataclass as `Printing`, or a mapping that is annotated with a class of settings.
    """
    own = list[Parameter]()
    groups = dict[str, tuple[Callable[..., Any], list[Parameter]]]()
    for one in signature(verb, eval_str=True).parameters.values():
        settings = next(filter(_is_settings, getattr(one.annotation, "__metadata__", ())), None)
        if settings is not None:
            groups[one.name] = partial(_read, settings), _parameters(settings)
        elif _is_settings(one.annotation):
            options = list(signature(one.annotation, eval_str=True).parameters.values())
            groups[one.name] = one.annotation, sorted(options, key=lambda option: option.name != "force")
        own += groups[one.name][1] if one.name in groups else [one]

    @wraps(verb)
    def run(**given: Any) -> None:
        for name, (made_of, options) in groups.items():
            given[name] = made_of(**{option.name: given.pop(option.name) for option in options})
        verb(**given)

    parameters = [one.replace(kind=one.KEYWORD_ONLY) for one in own]
    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return run


def command(group: typer.Typer, name: str, short: str, *examples: str, cls: Any = None) -> Callable[[Verb], Verb]:
    """Add a verb to a group, with examples at the end of its help."""
    epilog = "\b\nExamples:\n" + "\n".join(f"  xosc-lateral {line}" for line in examples)

    def add(verb: Verb) -> Verb:
        group.command(name, cls=cls, short_help=short, epilog=epilog)(spelled_out(verb))
        return verb

    return add
