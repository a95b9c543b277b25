"""What the headers and values of somebody's tables mean: a first version of a mapping, for a person to correct."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.vehicle_classes import TRUCKS, class_of
from xosc_lateral.files.columns import EPOCHS_BEGIN, comma_numbers, no_time, usual_marker
from xosc_lateral.files.mapping import TableMapping, factor, parts_of
from xosc_lateral.files.tables import text_layout

HEADERS = {
    "time": r"time|timestamp|t|zeit|zeitstempel|sec|seconds",
    "drive": r"drive|trip|run|session|fahrt|drive_?id|trip_?id",
    "offset": r"(lane_?)?offset|lat(eral)?(_?(pos(ition)?|offset|dev(iation)?))?|querablage|lane_?pos(ition)?",
    "lane_width": r"(lane_?)?width|(fahr)?(spur|streifen)_?breite|fahrstreifenbreite",
    "distance_left": r"(dist(ance)?_?)?(to_?)?left(_?(line|marking|lane))?|abstand_?links|(line|marking)_?left",
    "distance_right": r"(dist(ance)?_?)?(to_?)?right(_?(line|marking|lane))?|abstand_?rechts|(line|marking)_?right",
    "speed": r"v(_?(ego|veh(icle)?))?|speed|velocity|geschw(indigkeit)?|tempo|vehicle_?speed",
    "acceleration": r"a(x|cc(eleration)?)?|a_?long|beschl(eunigung)?",
    "is_truck": r"(vehicle_?)?(class|type|typ|klasse)|fahrzeug_?(klasse|typ|art)|is_?truck|truck|lkw",
    "curvature": r"curv(ature)?|kappa|kr(ue|ü)mmung",
    "lead_distance": r"(lead|front|ahead|headway)_?(dist(ance)?|gap)?|vorder_?abstand|abstand_?vorn(e)?",
    "left_distance": r"(neighbou?r|car|veh(icle)?|gap)_?left(_?dist(ance)?)?|left_?distance|nachbar_?links",
    "right_distance": r"(neighbou?r|car|veh(icle)?|gap)_?right(_?dist(ance)?)?|right_?distance|nachbar_?rechts",
    "lane_index": r"lane(_?(index|no|nr|number|id))?|spur|fahrstreifen",
}
"""What the headers of a column look like, without their unit; English and German."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


LATERAL = _words("lat lateral laterale quer lane spur fahrspur fahrstreifen ln")
PLACE = _words("offset pos position dev deviation ablage abweichung versatz abstand dist distance lage delta gap")
MIDDLE = _words("center centre mitte mid middle spurmitte fahrspurmitte fahrstreifenmitte")
MARKING = _words("lane line marking mrk ln lm markierung linie spur fahrstreifen begrenzung edge c0")
SIDES = {
    "distance_left": _words("left le lft lh links linke linker linken"),
    "distance_right": _words("right ri rgt rh rechts rechte rechter rechten"),
}
FILLERS = _words("from to off of im in der zu zur von the vehicle ego car")
SATELLITE = _words("gps gnss wgs lon")
FOREIGN_WORDS = SATELLITE | _words("time zeit heading yaw speed")
"""Words of headers for the place in the lane, in any order: bus logs, simulators and trackers combine them alike."""

COMPOUND = re.compile(
    r"(quer|spur|lateral|lane|lat)_?(ablage|abweichung|versatz|position|lage|dev|pos|offset)|dev_?dist"
)
"""What means the offset, as one word."""

BY_SIZE = {
    "speed": ((60.0, 250.0, "km/h"),),
    "lane_width": ((200.0, 700.0, "cm"), (2000.0, 7000.0, "mm")),
    "offset": ((4.0, 300.0, "cm"), (300.0, 3000.0, "mm")),
    "distance_left": ((20.0, 500.0, "cm"),),
    "distance_right": ((20.0, 500.0, "cm"),),
}
"""Median sizes that no value in the standard unit has, and the unit that they speak for."""

DISTANCES = ("lead_distance", "left_distance", "right_distance")  # no column of 0 and 1 is one of them: it is a flag
LISTED_TEXTS = 12  # so many different texts are written out at most
SIGNS = {"offset": "positive to the LEFT of travel, else :-m", "curvature": "positive in LEFT curves, else :-1/m"}


class Recognised(NamedTuple):
    """A column of a table by its standard name, and what that was seen from."""

    name: str
    header: str
    unit: str  # empty: none is stated, or seen by the size of the values
    why: str
    values: pd.Series

    @property
    def numbers(self) -> FloatArray:
        """What is a number in it."""
        return _numbers(self.values)


def recognised(tables: Sequence[pd.DataFrame], path: Path) -> tuple[list[Recognised], list[str]]:
    """Columns that all tables have, as their headers and values show them; and those that keep their names."""
    tables = [table.rename(columns=lambda name: str(name).strip()) for table in tables]
    shared = [name for name in tables[0].columns if all(name in table.columns for table in tables)]
    if not shared:
        raise FormatError("the tables have no column in common", path=path)
    headers: dict[str, str] = {}
    for header in shared:
        bare, _ = parts_of(header)
        placed = _place_named(bare)
        known = {} if set(bare.split("_")) & SATELLITE else HEADERS
        spellings = bare, bare.partition("_")[2] or "-"  # whole, and without a word before it
        usual = (name for name, words in known.items() if any(re.fullmatch(words, text) for text in spellings))
        is_flag = all(set(_numbers(table[header])) <= {0.0, 1.0} for table in tables)
        free = (name for name in (placed, *usual) if name not in headers and not (is_flag and name in DISTANCES))
        name = next((name for name in free if name is not None), None)
        if name is not None:
            headers[name] = header
    values = {header: pd.concat([table[header] for table in tables], ignore_index=True) for header in headers.values()}
    columns = [Recognised(name, header, *_unit_of(name, header, values[header]), values[header])
             for name, header in headers.items()]  # fmt: skip
    return columns, [header for header in shared if header not in values]


def mapping_text(files: Sequence[Path], known: TableMapping, columns: Sequence[Recognised], left: Sequence[str]) -> str:
    """TOML of a mapping of these tables, of columns that are `recognised` and headers that keep their names, with what
    each line was guessed from; `known`: what is stated already."""
    headers = {one.name for one in columns}
    needed = ("time",) if SIDES.keys() <= headers else ("time", "offset", "lane_width")
    lines = [
        f"# Proposed from {', '.join(path.name for path in files)}: read every line, correct it, save it, and give it",
        '# with --mapping FILE. NAME = "COLUMN" or "COLUMN:UNIT"; a unit with a minus turns the sign.',
        *_text_lines(files, known, columns),
        "",
        "[columns]",
        *map(_line, columns),
        *(
            f'# {name} = "?"  # needed, and not found; {no_time(left, "") if name == "time" else ""}'.rstrip("; ")
            for name in needed
            if name not in headers
        ),
    ]
    for column in columns:
        if column.name != "drive" and not len(column.numbers):
            lines += _texts(column.name, column.values)
    if left:
        lines += ["", f"# Others keep their names: {', '.join(left[:40])}"]
    lines += ["", "# [roles]  # where a column comes from, for close-loop", '# curvature = "road"', ""]
    return "\n".join(lines)


def _text_lines(files: Sequence[Path], known: TableMapping, columns: Sequence[Recognised]) -> list[str]:
    """How the tables are written, where that is not plain, and what stands for no value."""
    seen = [seen for path in files if (seen := text_layout(path, known)) is not None]
    codes, layouts = {code for code, _ in seen}, {layout[2:] for _, layout in seen}
    lines = [f"encoding = {_quoted(code)}" for code in sorted(codes - {"utf-8"})[:1]]
    if len(layouts) == 1 and (layout := seen[0][1]) and (layout.header > 1 or layout.units):
        lines += [f"separator = {_quoted(layout.separator or ',')}", f"header = {layout.header}  # line"]
        lines += [f"units = {layout.unit_row}  # line"] if layout.units else []
    markers = {one.header: marker for one in columns if (marker := usual_marker(one.numbers, one.header)) is not None}
    if markers:
        why = "; ".join(f"{value:g} in {rows} of {header}" for header, (value, rows) in markers.items())
        numbers = ", ".join(f"{value:g}" for value in sorted({value for value, _ in markers.values()}))
        lines.append(f"missing = [{numbers}]  # CHECK: {why}")
    return lines


def _place_named(bare: str) -> str | None:
    """Offset or distance to a marking, by a header's words; at most one of them may be of the system's own."""
    words = set(bare.split("_"))
    sides = [name for name, own in SIDES.items() if words & own]
    if words & FOREIGN_WORDS or "width" in words or len(sides) > 1:
        return None
    known = LATERAL | PLACE | MIDDLE | MARKING | FILLERS | frozenset().union(*SIDES.values())
    if len(words - known) > 1:
        return "offset" if COMPOUND.search(bare) and not sides else None
    if sides:
        return sides[0] if words & MARKING and words & (PLACE | {"c0", "marking", "line"}) else None
    means_offset = COMPOUND.search(bare) or (words & PLACE and (words & LATERAL or words & MIDDLE))
    return "offset" if means_offset else None


def _unit_of(name: str, header: str, column: pd.Series) -> tuple[str, str]:
    """Unit of a column, and what it was seen from."""
    _, unit = parts_of(header)
    if unit:
        try:
            factor(name, unit)
            return unit, "unit by its header"
        except ValueError:
            pass
    if not len(numbers := _numbers(column)):
        return "", "by its header"
    size = float(np.median(np.abs(numbers)))
    unit = next((unit for low, high, unit in BY_SIZE.get(name, ()) if low <= size < high), "")
    if name == "time" and float(np.median(numbers)) > EPOCHS_BEGIN:
        return "", "counts since 1970, by its size"
    if name == "time" and len(numbers) > 1:
        unit = "ms" if 2.0 <= float(np.median(np.abs(np.diff(numbers)))) <= 1000.0 else unit
    return unit, "unit by the size of its values" if unit else "by its header"


def _line(column: Recognised) -> str:
    numbers = column.numbers
    seen = f"; {numbers.min():.4g} to {numbers.max():.4g}" if len(numbers) else ""
    sign = f"; CHECK: {SIGNS[column.name]}" if column.name in SIGNS else ""
    source = f"{column.header}:{column.unit}" if column.unit else column.header
    entry = f"{{column = {_quoted(column.header)}}}" if ":" in column.header and not column.unit else _quoted(source)
    return f"{column.name} = {entry}  # {column.why}{seen}{sign}"


def _numbers(column: pd.Series) -> FloatArray:
    commas = None if pd.api.types.is_numeric_dtype(column) else comma_numbers(column)
    values = pd.to_numeric(column if commas is None else commas, errors="coerce").to_numpy(dtype=np.float64)
    return np.asarray(values[np.isfinite(values)])


def _texts(name: str, column: pd.Series) -> list[str]:
    texts = sorted({str(cell).strip() for cell in column.dropna()})
    if name == "time" or len(texts) > LISTED_TEXTS:
        return []
    numbers = {text: int(class_of(text) in TRUCKS) if name == "is_truck" else k for k, text in enumerate(texts)}
    return ["", f"[values.{name}]", *(f"{_quoted(text)} = {number}" for text, number in numbers.items())]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
