"""What foreign tables hold, in standard names: a mapping given word by word (``--map``) or saved in a file.

A file is TOML: how tables are written (``encoding``, ``separator``, ``decimal``; ``header`` and ``units``, the lines
that hold them, counted from 1; ``comment``, which begins lines that are no data), what the recording shows
(``valid_below`` in Hz, ``resolution`` in m), ``[columns]`` with a line per standard name, as in ``--map``,
``[values.NAME]`` with the number that each text of a column stands for (of `vehicle_class`: the class that a number
stands for), ``[roles]``; besides, ``rows = ["quality >= 2"]``: which rows
count, ``missing = [-9999]``: what stands for no value, ``time_zone = "Europe/Berlin"``: of local stamps,
``reference = "front"``, "centre", "rear" or "rear axle": the point of tracks that x and y are of,
``wheel_track = 1.6``: how far apart the points are that distances to the markings count from.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import ANY_CONTEXT
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.base.texts import composed
from xosc_lateral.base.vehicle_classes import CLASSES, class_of
from xosc_lateral.files.columns import PLAIN, Stated, as_word, parse_condition
from xosc_lateral.files.source import read_toml

COMPASS = "compass"
"""Unit of headings: degrees clockwise from north, which is along y."""

# Factors to SI. Degrees stay apart from radians only by their factor.
_BY_QUANTITY = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048, "in": 0.0254},
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704, "kn": 1852 / 3600, "ft/s": 0.3048},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "angle": {"rad": 1.0, "deg": pi / 180, COMPASS: -pi / 180},
    "angular speed": {"rad/s": 1.0, "deg/s": pi / 180},
    "acceleration": {"m/s2": 1.0, "g": 9.80665},
    "curvature": {"1/m": 1.0, "1/km": 1e-3},
    "number": {"-": 1.0, "%": 1e-2},
    "rain": {"mm/h": 1.0},
    "illuminance": {"lx": 1.0, "klx": 1e3},
}

UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {unit: (quantity, by) for quantity, units in _BY_QUANTITY.items() for unit, by in units.items()}
)
"""Unit -> what it measures, and the factor to SI."""

# Other spellings, as bus logs have them; in lower case and without spaces.
_SPELLINGS = MappingProxyType(
    {
        **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
        **dict.fromkeys(("kmh", "kmph", "km/hr", "kph"), "km/h"),
        **dict.fromkeys(("mps", "m/sec", "ms-1", "m.s-1"), "m/s"),
        **dict.fromkeys(("sec", "second", "seconds"), "s"),
        **dict.fromkeys(("msec",), "ms"),
        **dict.fromkeys(("µs", "μs"), "us"),
        **dict.fromkeys(("°", "grad", "degree", "degrees"), "deg"),
        **dict.fromkeys(("radian", "radians"), "rad"),
        **dict.fromkeys(("°/s", "deg/sec", "grad/s", "degree/s", "degrees/s"), "deg/s"),
        **dict.fromkeys(("rad/sec",), "rad/s"),
        **dict.fromkeys(("m/s^2", "m/s²", "m/s**2", "m/s/s", "mps2", "m/sec2", "m/sec^2"), "m/s2"),
        **dict.fromkeys(("m^-1", "m-1", "m⁻¹", "rad/m"), "1/m"),
        **dict.fromkeys(("percent", "prozent"), "%"),
        **dict.fromkeys(("lux",), "lx"),
        **dict.fromkeys(("1", "none", "unitless", "no_unit", "count", "counts", "bool", "enum"), "-"),
    }
)

_TABLE_UNITS = MappingProxyType({"time": "s", "offset": "m", "distance_left": "m", "distance_right": "m"})


def spelled(unit: str) -> str | None:
    """The unit in the spelling of `UNITS`; empty where none is given, None where it is not known."""
    plain = "".join(unit.split()).strip("[]()").lower()
    known = _SPELLINGS.get(plain, plain)
    return known if not known or known in UNITS else None


def plain_header(text: str) -> str:
    """In lower case, its words parted by underscores."""
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text)
    return re.sub(r"[\s.:\-_/]+", "_", spaced).strip("_").lower()


def parts_of(header: str) -> tuple[str, str]:
    """A header without its unit, see `plain_header`, and the unit (``speed [km/h]``, ``time_ms``); empty: none."""
    match = re.fullmatch(r"(.+?)[ _]*[\[(]([^\])]+)[\])]", header)
    if match and spelled(match[2]):
        return plain_header(match[1]), str(spelled(match[2]))
    stem, _, last = header.rpartition("_")
    unit = spelled(last) if stem else None
    return (plain_header(stem), unit) if unit and unit != "-" else (plain_header(header), "")


def is_measured(unit: str) -> bool:
    """Whether a unit of `UNITS` is that of a quantity, and not of a count, a flag or a share."""
    return unit in UNITS and UNITS[unit][0] != "number"


def factor(column: str, unit: str) -> float:
    """Factor from `unit` (``-m`` turns the sign) to that of the standard table's `column`, SI where it names none.

    Raises `ValueError` for an unknown unit, or one that measures something else.
    """
    sign, name = (-1.0, unit[1:]) if unit.startswith("-") and unit != "-" else (1.0, unit)
    if count := re.fullmatch(r"(\d+\.?\d*)(?:/(\d+\.?\d*))? +(.+)", name):  # frames: 1/25 s
        return sign * float(count[1]) / float(count[2] or 1.0) * factor(column, count[3])
    if name not in UNITS:
        raise ValueError(f"unknown unit {unit!r}; known: {', '.join(UNITS)}")
    quantity, to_si = UNITS[name]
    target = _TABLE_UNITS.get(column) or CONTEXT_UNITS.get(column)
    if target is None:
        return sign * to_si
    wanted, target_to_si = UNITS[target]
    if wanted != quantity:
        raise ValueError(f"{column} is held in {target}, {unit} measures {quantity}")
    return sign * to_si / target_to_si


RECORDED = ("valid_below", "resolution")  # what recordings show: driving below a frequency [Hz], offsets to a step [m]

KEYS = (
    "encoding", "separator", "decimal", "header", "units", "comment", *RECORDED,
    "columns", "values", "roles", "rows", "missing", "time_zone",
    "reference", "wheel_track",
)  # fmt: skip

REFERENCES = ("centre", "front", "rear", "rear axle")


@dataclass(frozen=True, slots=True)
class ColumnSource:
    """Where a column comes from in a foreign table: its header, and the factor to the standard unit."""

    column: str
    factor: float = 1.0
    unit: str = ""
    """As named by the user; empty: none was."""


@dataclass(frozen=True, slots=True)
class TableMapping:
    """How to read foreign tables."""

    columns: Mapping[str, ColumnSource] = field(default_factory=dict)  # by standard name
    # values: by standard name, the number that a text stands for, in the standard unit
    values: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    # roles: by standard name, where a column comes from ("road", say), for who asks what may be a cause
    roles: Mapping[str, str] = field(default_factory=dict)
    encoding: str | None = None  # of text files; None: found out
    layout: Stated = PLAIN
    decimal: str = "."
    classes: Mapping[str, str] = field(default_factory=dict)  # vehicle classes by what the table has for them
    rows: tuple[str, ...] = ()  # conditions that rows have to fulfil
    missing: tuple[float | str, ...] | None = None  # what stands for no value; None: not said
    time_zone: str = ""  # of local stamps
    wheel_track: float | None = None  # between the points that distances to the markings count from [m]
    reference: str = "centre"  # of `REFERENCES`: the point of a vehicle that x and y of tracks are of
    recorded: Mapping[str, float] = field(default_factory=dict)  # by the names in `RECORDED`

    def class_names(self, column: pd.Series, path: Path) -> pd.Series:
        """Vehicle classes in words; numbers need the mapping's [values.vehicle_class]."""
        words = column.map(as_word)
        if self.classes:
            words = words.map(lambda word: self.classes.get(word, word))
        elif pd.api.types.is_numeric_dtype(column) and column.notna().any():
            what = f"numbers such as {words.iloc[0]}: [values.vehicle_class] of the mapping says what they stand for"
            raise FormatError(what, path=path, element=f"column {str(column.name)!r}")
        return classes_of(words.mask(column.isna(), ""), path, str(column.name))

    def with_words(self, words: Mapping[str, str]) -> TableMapping:
        """With further columns, as ``--map`` has them, in place of those of the same name."""
        more = parse_map(f"{name}={column}" for name, column in words.items())
        return replace(self, columns={**self.columns, **more}) if more else self

    def numbers(self, name: str, column: pd.Series, path: Path) -> pd.Series:
        """The column `name`, its texts as the numbers that they stand for. Raises `FormatError`."""
        if name not in self.values:
            return column
        known = {text.strip().lower(): number for text, number in self.values[name].items()}
        texts = column.map(lambda cell: "" if pd.isna(cell) else as_word(cell))
        strange = texts[(texts != "") & ~texts.isin(list(known))]
        if len(strange):
            what = f"{strange.iloc[0]!r} is not in [values.{name}] of the mapping: {', '.join(self.values[name])}"
            raise FormatError(what, path=path, line=int(strange.index[0]) + 2, element=f"column {name!r}")
        return texts.map({**known, "": np.nan}).astype(np.float64)


def classes_of(words: pd.Series, path: Path, column: str) -> pd.Series:
    """The classes that words stand for, see `base.vehicle_classes`. Raises `FormatError`: an unknown word."""
    known = {word: class_of(word) for word in words.unique()}
    if strange := [word for word, name in known.items() if name is None]:
        what = f"{strange[0]!r} is no known class: [values.vehicle_class] of the mapping says what it is"
        raise FormatError(f"{what} ({', '.join(CLASSES)})", path=path, element=f"column {column!r}")
    return words.map(known)


MappingLike: TypeAlias = "TableMapping | Mapping[str, str] | Mapping[str, ColumnSource] | Sequence[str] | Path"
"""A mapping, words or sources by name, words as of ``--map``, or the file of one."""


def as_mapping(mapping: MappingLike | None) -> TableMapping:
    """Whatever stands for a mapping."""
    if mapping is None:
        return TableMapping()
    if isinstance(mapping, TableMapping):
        return mapping
    if isinstance(mapping, str | Path):
        return read_mapping(Path(mapping))
    if not isinstance(mapping, Mapping):
        return TableMapping(parse_map(mapping))
    words = {name: entry for name, entry in mapping.items() if isinstance(entry, str)}
    sources = {name: entry for name, entry in mapping.items() if isinstance(entry, ColumnSource)}
    return TableMapping(sources).with_words(words)


def parse_map(words: Iterable[str]) -> dict[str, ColumnSource]:
    """Read ``NAME=COLUMN`` or ``NAME=COLUMN:UNIT`` (``speed=v_kmh:km/h``, ``offset=lat:-cm``). Raises `FormatError`."""
    mapping: dict[str, ColumnSource] = {}
    for word in map(composed, words):
        name, equals, rest = word.partition("=")
        if not equals or not name or not rest:
            raise FormatError(f"--map {word!r}: expected NAME=COLUMN or NAME=COLUMN:UNIT")
        try:
            mapping[name] = _source(name, rest)
        except ValueError as error:
            raise FormatError(f"--map {word!r}: {error}") from error
    return mapping


def _source(name: str, words: str) -> ColumnSource:
    column, colon, unit = words.rpartition(":")
    return ColumnSource(column, factor(name, unit), unit) if colon and "]" not in unit else from_header(name, words)


def from_header(name: str, header: str, unit: str | None = None) -> ColumnSource:
    """A column in the unit that its header names. Raises `ValueError`: one in brackets measures something else."""
    unit = parts_of(header)[1] if unit is None else unit
    try:
        return ColumnSource(header, factor(name, unit) if unit else 1.0, unit)
    except ValueError:
        if "[" in header or "(" in header:
            raise
        return ColumnSource(header)


def standard_sources(
    headers: Iterable[object], names: Mapping[str, tuple[str, ...]], path: Path
) -> dict[str, ColumnSource]:
    """Where standard columns come from, by headers in any spelling and with units; `names`: headers of each.

    Raises `FormatError`: a unit in brackets that is not known, or measures something else.
    """
    whole = {str(header).strip().lower(): str(header) for header in reversed(list(map(str, headers)))}
    bare: dict[str, tuple[str, str]] = {}
    for header in whole.values():
        bare.setdefault(plain_header(header), (header, ""))
    for header in whole.values():
        stem, unit = parts_of(header.strip())
        bare.setdefault(stem, (header, unit))
    sources = {}
    for name, usual in names.items():
        for header in usual:
            if header in whole:
                sources[name] = ColumnSource(whole[header])
            elif header in bare:
                column, unit = bare[header]
                try:
                    sources[name] = from_header(name, column, unit)
                except ValueError as error:
                    raise FormatError(str(error), path=path, element=f"column {column!r}") from error
            elif strange := next((text for text in whole.values() if re.match(rf"{header}\s*\[", text, re.I)), None):
                what = f"unknown unit; known: {', '.join(UNITS)}: --map {name}=COLUMN:UNIT names it"
                raise FormatError(what, path=path, element=f"column {strange!r}")
            if name in sources:
                break
    return sources


def read_mapping(path: Path) -> TableMapping:
    """Read a mapping's file. Raises `FormatError`: it is no TOML, or holds what no mapping has; names the entry."""
    return mapping_of(read_toml(path, "no mapping in TOML and UTF-8"), path)


def mapping_of(entries: Mapping[str, Any], path: Path) -> TableMapping:
    """A mapping of a file's entries; raises as `read_mapping` does."""
    values = composed(dict(entries))
    if unknown := values.keys() - set(KEYS):
        raise FormatError(f"unknown entry {min(unknown)!r}; there are {', '.join(KEYS)}", path=path)
    for key in ("columns", "values", "roles"):
        if not isinstance(values.setdefault(key, {}), dict):
            raise FormatError("expected a table of names", path=path, element=f"[{key}]")
    for key, (expected, is_one) in ENTRIES.items():
        if key in values and not is_one(values[key]):
            raise FormatError(f"{key} {values[key]!r}, expected {expected}", path=path)
    decimal = values.get("decimal", ".")
    if decimal == values.get("separator"):
        raise FormatError(f"separator and decimal are both {decimal!r}", path=path)
    for condition in values.get("rows", []):
        parse_condition(_text(condition, path, "rows"), path)
    for entry in values.get("missing", []):
        if isinstance(entry, bool) or not isinstance(entry, int | float | str):
            raise FormatError(f"{entry!r}, expected a number or a text", path=path, element="missing")
    markers = [entry if isinstance(entry, str) else float(entry) for entry in values.get("missing", [])]
    classes = values["values"].pop("vehicle_class", {})
    track = values.get("wheel_track")
    return TableMapping(
        columns={name: _column(name, entry, path) for name, entry in values["columns"].items()},
        values={name: _numbers(name, entry, path) for name, entry in values["values"].items()},
        roles={name: _role(entry, path, f"[roles] {name}") for name, entry in values["roles"].items()},
        encoding=values.get("encoding"),
        layout=PLAIN._replace(**{name: values[name] for name in PLAIN._fields if name in values}),
        decimal=decimal,
        classes={
            str(number).strip().lower(): _text(entry, path, f"[values.vehicle_class] {number}")
            for number, entry in classes.items()
        },
        rows=tuple(values.get("rows", [])),
        missing=tuple(markers) if "missing" in values else None,
        time_zone=_text(values["time_zone"], path, "time_zone") if "time_zone" in values else "",
        wheel_track=None if track is None else float(track),
        reference=values.get("reference", "centre"),
        recorded={key: float(values[key]) for key in RECORDED if key in values},
    )


def _is_number(entry: Any) -> bool:
    return isinstance(entry, int | float) and not isinstance(entry, bool)


ENTRIES: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    **dict.fromkeys(
        ("encoding", "separator", "comment"), ("a text", lambda entry: isinstance(entry, str) and entry != "")
    ),
    **dict.fromkeys(("header", "units"), ("a line, from 1 on", lambda entry: type(entry) is int and entry > 0)),
    "decimal": (". or ,", lambda entry: entry in (".", ",")),
    **dict.fromkeys(("rows", "missing"), ("a list", lambda entry: isinstance(entry, list))),
    "wheel_track": ("0 to 3 m", lambda entry: _is_number(entry) and 0.0 <= entry <= 3.0),
    "reference": (", ".join(REFERENCES), lambda entry: entry in REFERENCES),
    **dict.fromkeys(RECORDED, ("a number above 0", lambda entry: _is_number(entry) and 0.0 < entry < np.inf)),
}
"""Entries that are no tables -> what is expected of them, in words and as a check."""


def _role(entry: Any, path: Path, where: str) -> str:
    from xosc_lateral.drivers.drives.roles import Role

    if _text(entry, path, where) not in list(Role):
        raise FormatError(f"{entry!r} is none of {', '.join(Role)}", path=path, element=where)
    return str(entry)


def _text(entry: Any, path: Path, where: str) -> str:
    if not isinstance(entry, str) or not entry:
        raise FormatError(f"{entry!r}, expected a text", path=path, element=where)
    return entry


def _column(name: str, entry: Any, path: Path) -> ColumnSource:
    where = f"[columns] {name}"
    try:
        if not isinstance(entry, dict):
            return _source(name, _text(entry, path, where))
        # a header with a colon, or a sign by itself
        if unknown := entry.keys() - {"column", "unit", "sign"}:
            raise FormatError(f"unknown {min(unknown)!r}; there are column, unit, sign", path=path, element=where)
        if entry.get("sign", 1) not in (1, -1):
            raise FormatError(f"sign {entry['sign']!r}, expected 1 or -1", path=path, element=where)
        column, unit = _text(entry.get("column"), path, where), entry.get("unit", "")
        return ColumnSource(column, float(entry.get("sign", 1)) * (factor(name, unit) if unit else 1.0), unit)
    except FormatError:
        raise
    except (ValueError, AttributeError) as error:
        raise FormatError(str(error), path=path, element=where) from error


def _numbers(name: str, entry: Any, path: Path) -> dict[str, float]:
    where = f"[values.{name}]"
    if not isinstance(entry, dict) or not entry:
        raise FormatError("expected texts and the numbers that they stand for", path=path, element=where)
    for text, number in entry.items():
        if not isinstance(number, int | float) or not abs(number) <= ANY_CONTEXT.high:
            raise FormatError(f"{text} = {number!r}, expected a number", path=path, element=where)
    return {text: float(number) for text, number in entry.items()}
