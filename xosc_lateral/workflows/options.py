"""How users say a setting: in Python, as a word of the command line, in a cell of a table, in the configuration.

It is declared where it is used: as a field of settings (`option`), or in the annotation of a call's keyword (`flag`).
"""

from __future__ import annotations

import ast
import inspect
import json
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile


PathLike: TypeAlias = str | Path
ProfileLike: TypeAlias = "PathLike | DriverProfile"
"""A profile, its path, or its name in the library."""
Paths: TypeAlias = PathLike | Sequence[PathLike]

STEP = 0.02
"""Of playback, as in the reference logs. [s]"""

NO_EGO = "none"
"""In place of a vehicle under test: there is none."""

Verb = TypeVar("Verb", bound=Callable[..., Any])
Settings = TypeVar("Settings", bound=type)

Cell = Callable[[str, Path], Any]
"""Text of a table's cell and the table's folder -> what a user would say in Python."""


@dataclass(frozen=True, slots=True)
class Option:
    """How users say a setting."""

    read: Callable[[Any], Any]  # what they say in Python, a word or a cell -> the field's value; or `ValueError`
    flags: tuple[str, ...] = ()  # on the command line; empty: its name
    kind: Any = None  # of the command line's value; None: that of a call's keyword, or verbs share it (`SHARED`)
    words: Mapping[str, Any] = field(default_factory=dict)  # what else the command line says of it (help, limits)
    cell: Cell | None = None  # reads the column of its name; None: a table has no such column
    prefix: str = ""  # prefix, entry: of columns that hold one entry each of a mapping
    entry: Cell | None = None
    decides: bool = True  # on an output's bytes
    # gives: what the command line's words say, where they may stand for several keywords; or `ValueError`
    gives: Callable[[Any], Mapping[str, Any]] | None = None
    said_by: str = ""  # the command line's option that gives it, too; it has none of its own

    def value(self, name: str, stated: Any) -> Any:
        """The field's value; `ValueError` with the option's name before it."""
        try:
            return self.read(stated)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{name} {error}") from error

    def of_row(self, name: str, before: Any, cells: Mapping[str, str], folder: Path) -> Any:
        """What a row of a table says, else what was said before."""
        try:
            stated = self.cell(cells[name], folder) if self.cell is not None and name in cells else None
        except ValueError as error:
            raise ValueError(f"{name} {error}") from error
        if self.entry is not None:
            keys = [key for key in cells if key.startswith(self.prefix)]
            entries = {key.removeprefix(self.prefix): self.entry(cells[key], folder) for key in keys}
            stated = {**before, **(stated or {}), **entries}
        return before if stated is None else self.value(name, stated)


def option(
    default: Any,
    read: Callable[[Any], Any],
    *flags: str,
    kind: Any = None,
    cell: Cell | None = None,
    prefix: str = "",
    entry: Cell | None = None,
    decides: bool = True,
    gives: Callable[[Any], Mapping[str, Any]] | None = None,
    said_by: str = "",
    **words: Any,
) -> Any:
    """Declare a field that users can set; see `Option`."""
    metadata = {"option": Option(read, flags, kind, words, cell, prefix, entry, decides, gives, said_by)}
    if isinstance(default, dict):
        return field(default_factory=dict, metadata=metadata)
    return field(default=default, metadata=metadata)


def flag(
    *flags: str,
    kind: Any = None,
    read: Callable[[Any], Any] = lambda stated: stated,
    gives: Callable[[Any], Mapping[str, Any]] | None = None,
    said_by: str = "",
    **words: Any,
) -> Option:
    """What the command line says of a call's keyword, in its annotation: ``Annotated[float, flag(help=...)]``."""
    return Option(read, flags, kind, words, gives=gives, said_by=said_by)


def declare_options(call: Verb) -> Verb:
    """Take what annotations say of keywords for the command line; what the docstring lacks is said by their help.

    Keywords of a name in `SHARED` need no annotation where they have a default.
    """
    options, kinds = dict[str, Option](), dict[str, str]()
    globals_ = call.__globals__
    for name, parameter in inspect.signature(call).parameters.items():
        kind = parameter.annotation
        option = SHARED.get(name) if parameter.default is not parameter.empty else None
        if kind.startswith("Annotated["):
            kind, metadata = map(ast.unparse, ast.parse(kind, mode="eval").body.slice.elts)
            call.__annotations__[name], option = kind, eval(metadata, globals_)
        if option is not None:
            options[name] = option if option.kind is not None else replace(option, kind=eval(kind, globals_))
            kinds[name] = kind
    call.__doc__ = _documented(call.__doc__ or "", options, kinds)
    call.__options__ = options  # type: ignore[attr-defined]
    return call


def documented(settings: Settings) -> Settings:
    """Settings whose docstring has an entry for each."""
    kinds = {item.name: item.type for item in settable(settings)}
    settings.__doc__ = _documented(settings.__doc__ or "", options_of(settings), kinds)
    return settings


def _documented(text: str, options: Mapping[str, Option], kinds: Mapping[str, Any]) -> str:
    """A docstring with an entry for each option; what it does not say itself, the option's help says."""
    documented, entries = inspect.cleandoc(text), list[str]()
    for name, option in options.items():
        if not re.search(rf"^(\w+, )*{name}(, \w+)*( :|$)", documented, flags=re.MULTILINE):
            words = option.words["help"].replace("; may be repeated", "")
            entries.append(f"{name} : {kinds[name]}\n    {words}")
    if not entries:
        return documented
    sections = re.split(r"\n\n(?=\w+\n---)", documented)
    if len(sections) == 1 or not sections[1].startswith("Parameters"):
        sections.insert(1, "Parameters\n----------")
    sections[1] = "\n".join([sections[1], as_keywords("\n".join(entries), options)])
    return "\n\n".join(sections)


OPTION_IN_TEXT = re.compile(r"xosc-lateral [^;)\n]*|(?<![\w.-])--([a-z]+(?:-[a-z]+)*)(?![\w-]|\.\w)")
"""As a sentence names it, but for what is to be typed; those of other programs have signs that ours lack."""


def as_keywords(text: str, options: Mapping[str, Option]) -> str:
    """A text with keywords of Python, in backticks, where it names options of a call; what is to be typed stays."""
    known = ((name, option) for name, option in {**SHARED, **options}.items() if not option.said_by)
    keywords = {flag: name for name, option in known for flag in option.flags} | {
        "--map": "columns",
        "--mapping": "columns",
    }
    return OPTION_IN_TEXT.sub(
        lambda word: f"`{keywords.get(word[0], word[1].replace('-', '_'))}`" if word[1] else word[0], text
    )


def settable(settings: type) -> list[Field[Any]]:
    """The fields of some settings that users can set."""
    return [item for item in fields(settings) if "option" in item.metadata]


def options_of(source: Callable[..., Any]) -> dict[str, Option]:
    """What users can set of some settings, or of a call, by name."""
    if not isinstance(source, type):
        return dict(source.__options__)  # type: ignore[attr-defined]
    options = {item.name: item.metadata["option"] for item in settable(source)}
    for name, option in options.items():
        if option.kind is None and (shared := SHARED.get(name)) is not None:
            options[name] = replace(
                option, flags=shared.flags, kind=shared.kind, words=shared.words, gives=shared.gives,
                said_by=shared.said_by,
            )  # fmt: skip
    return options


def values_of(settings: type, stated: Mapping[str, Any]) -> dict[str, Any]:
    """Values of fields from what a user says; None: nothing is said.

    Raises `TypeError`: there is no such option; `ValueError`: it can't have that value.
    """
    options = options_of(settings)
    unknown = stated.keys() - options.keys()
    if unknown:
        raise TypeError(f"no option {min(unknown)!r}; there are {', '.join(options)}")
    return {name: options[name].value(name, value) for name, value in stated.items() if value is not None}


def spelled_out(settings: type) -> Callable[[Verb], Verb]:
    """Name the options that a call takes as keywords in its signature, for help and completion."""

    def with_options(verb: Verb) -> Verb:
        signature = inspect.signature(verb)
        positional = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        named = [
            inspect.Parameter(
                item.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=None if item.default is MISSING else item.default,
                annotation=item.type,
            )
            for item in settable(settings)
        ]
        verb.__signature__ = signature.replace(parameters=[*positional, *named])  # type: ignore[attr-defined]
        # The settings' own parameters in place of the one line that refers to them.
        _, _, described = inspect.cleandoc(settings.__doc__ or "").partition("Parameters\n----------\n")
        parameters, _, _ = described.partition("\n\nRaises")
        text = inspect.cleandoc(verb.__doc__ or "")
        verb.__doc__ = text.replace(f"options\n    `{settings.__name__}`.", parameters)
        verb.__settings__ = options_of(settings)  # type: ignore[attr-defined]
        return verb

    return with_options


def names(stated: str | Collection[str]) -> frozenset[str]:
    """Of entities; in a text they are separated by semicolons."""
    listed = [name.strip() for name in stated.split(";")] if isinstance(stated, str) else stated
    return frozenset(name for name in listed if name)


def egos(stated: str | Collection[str]) -> frozenset[str]:
    """Vehicles under test; empty for "none"."""
    wanted = names(stated)
    if NO_EGO in wanted and len(wanted) > 1:
        raise ValueError(f"{', '.join(sorted(wanted))}: {NO_EGO!r} stands alone")
    return wanted - {NO_EGO}


def one_of(words: type[StrEnum]) -> Callable[[Any], StrEnum]:
    """One of some words; a list of one from the configuration, too."""

    def read(stated: Any) -> StrEnum:
        try:
            return words(stated[0] if isinstance(stated, list) and len(stated) == 1 else stated)
        except ValueError as error:
            raise ValueError(f"{stated!r}, expected one of {', '.join(words)}") from error

    return read


def whole_number(smallest: int) -> Callable[[str | int], int]:
    """A whole number."""

    def read(stated: str | int) -> int:
        try:
            number = int(str(stated).removesuffix(".0"))  # whole numbers with a missing one are often written as floats
        except ValueError as error:
            raise ValueError(f"{stated!r} is not a whole number") from error
        if number < smallest:
            raise ValueError(f"{number}, at least {smallest}")
        return number

    return read


def process_count(stated: int) -> int:
    """How many processes work."""
    if stated == 0 or stated < -1:
        raise ValueError("at least 1, or -1 for one per core")
    return stated


def seconds(stated: str | float) -> float:
    """A length of time. [s]"""
    number = float(stated)
    if not 0.0 < number < math.inf:
        raise ValueError(f"{stated!r} s, expected more than 0")
    return number


def paths(stated: Paths) -> tuple[Path, ...]:
    """One path or several."""
    return (Path(stated),) if isinstance(stated, str | Path) else tuple(Path(path) for path in stated)


def profile(stated: ProfileLike) -> str | DriverProfile:
    """A profile, or its name or path."""
    return str(stated) if isinstance(stated, Path) else stated


def profiles(stated: Mapping[str, ProfileLike] | Collection[str]) -> dict[str, str | DriverProfile]:
    """Entity -> profile."""
    return {name: profile(value) for name, value in _pairs(stated).items()}


def texts(stated: Mapping[str, object] | Collection[str]) -> dict[str, str]:
    """Name -> value."""
    return {name: str(value) for name, value in _pairs(stated).items()}


def _pairs(stated: Mapping[str, Any] | Collection[str]) -> Mapping[str, Any]:
    """A mapping, or words ``NAME=VALUE``."""
    if isinstance(stated, Mapping):
        return stated
    entries: dict[str, str] = {}
    for word in stated:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise ValueError(f"{word!r}: expected NAME=VALUE")
        if name in entries:
            raise ValueError(f"{name!r} is given twice")
        entries[name] = value
    return entries


def as_it_is(text: str, _folder: Path) -> str:
    """A cell's text."""
    return text


def beside(text: str, folder: Path) -> Path:
    """A path as seen from the table's folder."""
    return folder / text


def profile_cell(text: str, folder: Path) -> str:
    """A profile's name as it is; a path as seen from the table's folder."""
    return str(folder / text) if text.endswith(".json") or "/" in text or "\\" in text else text


def json_object(text: str, _folder: Path) -> dict[str, str]:
    """Values of any kind as texts."""
    try:
        values: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{text[:80]!r} is not a JSON object: {error}") from error
    if not isinstance(values, dict):
        raise ValueError(f"{text!r} is not a JSON object")
    return {str(name): value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}


def roads(stated: Sequence[Path]) -> dict[str, Any]:
    """A road's file, and folders with roads known by name."""
    folders, files = ([path for path in stated if path.is_dir() is is_folder] for is_folder in (True, False))
    if len(files) > 1:
        raise ValueError(f"{files[0]} and {files[1]}: a scenario has one road")
    return {**({"road": files[0]} if files else {}), **({"road_path": folders} if folders else {})}


def profile_and_entities(stated: Sequence[str], keyword: str = "entity") -> dict[str, Any]:
    """A profile for everybody, and those of single entities, for `keyword`: ``PROFILE`` and ``NAME=PROFILE``."""
    named = [word for word in stated if "=" in word and not Path(word).exists()]
    plain = [word for word in stated if word not in named]
    if len(plain) > 1:
        raise ValueError(f"{plain[0]} and {plain[1]}: one profile for everybody, others as NAME=PROFILE")
    return {**({"profile": plain[0]} if plain else {}), **({keyword: named} if named else {})}


class Part(StrEnum):
    """Parts of a profile that are left out unless asked for."""

    SENSOR = "sensor"


PROFILE = flag("--profile", "-p", kind=str, metavar="NAME|PATH", help="Driver profile.")
MAPPING = flag("--mapping", kind=Path | None, metavar="FILE.toml",
    help="Saved mapping of columns (check TABLE... --write-mapping writes a first one).")  # fmt: skip

# fmt: off
SHARED: Mapping[str, Option] = {
    "profile": PROFILE,
    "seed": flag(kind=int, min=0, help="Random seed; the same inputs and seed give the same bytes."),
    "columns": flag(kind=object, help="Standard name -> foreign header with its unit, or a saved mapping."),
    "library": flag(kind=list[Path] | None, metavar="FOLDER", help="Folder with more profiles; may be repeated."),
    "parameters": flag("--set", kind=list[str] | None, read=texts, metavar="NAME=VALUE",
        help="Set a scenario parameter; may be repeated."),
    "allow": flag(kind=list[Path] | None,
        help="Folder that roads and catalogs may be read from; may be repeated."),
    "road": flag("--road", kind=list[Path] | None, metavar="FILE|FOLDER", show_default=False, gives=roads,
        help='OpenDRIVE file, whatever the scenario says; folder of roads known by name ("Town04"), may be repeated.'),
    "road_path": flag(said_by="--road", help='Folders with roads known by name ("Town04").'),
    "time_limit": flag(kind=float | None, read=seconds, min=0.1, max=86_400, show_default=False,
        help="Cut runs off here [s]; default: 60 without a stop trigger, 3600 with one."),
    "jobs": flag(kind=int, read=process_count, help="Number of processes; -1: one per core."),
    "with_sensor": flag("--with", kind=list[Part] | None, read=bool,
        help="sensor: add the error of the sensor that measured the drives."),
}
# fmt: on
"""What several verbs can be told, by the name that it has in all of them."""
