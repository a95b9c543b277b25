"""What a batch is asked for: files, folders, globs and tables, as one list of scenarios with their settings."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import islice
from pathlib import Path

from lxml import etree

from xosc_lateral.base.errors import FormatError, XoscLateralError, absent, meant_for
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import PARAMETER_SETS, XML_TREE
from xosc_lateral.files.openscenario.element import local_name
from xosc_lateral.files.openscenario.provenance import HEADER_MARK
from xosc_lateral.files.output_paths import file_name
from xosc_lateral.files.remote import is_url
from xosc_lateral.files.source import open_source
from xosc_lateral.files.tables import TABLE_SUFFIXES, as_text, read_text_table
from xosc_lateral.workflows.conversion.settings import OPTIONS, ConvertSettings
from xosc_lateral.workflows.opened import scenarios_at
from xosc_lateral.workflows.options import Option, as_it_is, whole_number


class DocumentKind(Enum):
    """What an OpenSCENARIO file holds."""

    SCENARIO = "scenario"
    CATALOG = "catalog"
    DISTRIBUTION = "parameter value distribution"
    CONVERTED = "converted scenario"


_KINDS = dict.fromkeys(("CatalogLocations", "RoadNetwork", "Entities", "Storyboard"), DocumentKind.SCENARIO)
_KINDS |= {"Catalog": DocumentKind.CATALOG, "ParameterValueDistribution": DocumentKind.DISTRIBUTION}
"""By the first element that says it."""


def document_kind(path: Path) -> DocumentKind:
    """What a file holds, from its first elements; what can't be read counts as a scenario (its reader says why)."""
    is_ours = False
    try:
        with open_source(path, XML_TREE) as source:
            safe = {"resolve_entities": False, "no_network": True, "load_dtd": False, "remove_comments": True}
            for _, element in etree.iterparse(source.file, events=("start",), **safe):
                parent = element.getparent()
                if parent is None or parent.getparent() is not None or not isinstance(element.tag, str):
                    continue
                name = local_name(element)
                if name == "FileHeader" and HEADER_MARK in (element.get("description") or ""):
                    is_ours = True
                elif is_ours or name in _KINDS:
                    return DocumentKind.CONVERTED if is_ours else _KINDS[name]
    except (etree.XMLSyntaxError, FormatError, OSError, ValueError, LookupError):
        return DocumentKind.SCENARIO
    return DocumentKind.CONVERTED if is_ours else DocumentKind.SCENARIO


SCENARIO_SUFFIX = ".xosc"

COLUMNS = ("scenario", *(name for name, option in OPTIONS.items() if option.cell is not None), "variants", "name")

PREFIXES = (*(option.prefix for option in OPTIONS.values() if option.prefix), "user:")
"""What a table of scenarios may hold."""

_VARIANTS = Option(whole_number(1), cell=as_it_is)

_GLOB_CHARACTERS = frozenset("*?[")


@dataclass(frozen=True, slots=True)
class Request:
    """One scenario to convert, or a parameter value distribution that stands for several."""

    scenario: Path
    settings: ConvertSettings = field(default_factory=ConvertSettings)
    variants: int = 1  # outputs per scenario, each with offsets of its own
    base: Path | None = None  # folder whose layout below the output tree mirrors; None: the scenario's own
    listed: bool = True  # named one by one; of what was found in a folder, catalogs and converted scenarios stay out
    label: str = ""  # tells outputs of this scenario with these settings from its others: part of their names
    name: str = ""  # in place of the scenario's name and the label


def concrete(request: Request, kind: DocumentKind) -> Iterator[tuple[Path, str, ConvertSettings, str]]:
    """The scenarios that a file stands for: itself, or those of its distribution.

    Each its file, a suffix of its output's name, its settings, and why it can't be converted, normally empty.
    """
    from xosc_lateral.files.openscenario.distribution import read_distribution

    scenario, settings = request.scenario, request.settings
    if kind is not DocumentKind.DISTRIBUTION:
        yield scenario, "", settings, ""
        return
    try:
        logical = read_distribution(scenario, allowed=settings.allow)
        sets = list(islice(logical.parameter_sets(settings.seed), int(PARAMETER_SETS.value) + 1))
        if len(sets) > PARAMETER_SETS.value:
            raise FormatError(PARAMETER_SETS.refusal(logical.count), path=scenario)
        if not sets:
            raise FormatError("no set of parameters satisfies the scenario's constraints", path=scenario)
    except (XoscLateralError, OSError) as error:
        why = str(error)
    except Exception as error:  # a bug of ours in one file must not cost the others; the row says that it is one
        why = f"{scenario}: internal error: {type(error).__name__}: {error}"
    else:
        for index, values in enumerate(sets):
            parameters = {**values, **settings.parameters}
            yield logical.scenario_file, f"_p{index:05d}", replace(settings, parameters=parameters), ""
        return
    yield scenario, "", settings, " ".join(why.split())


def find_requests(text: str | Path, settings: ConvertSettings, variants: int, leave_out: Path) -> Iterator[Request]:
    """Scenarios that a file, a folder, a glob or a table names.

    `text`: a ``.xosc`` file, a folder (searched to the bottom), a glob (``db/**/cut*.xosc``) or a table (CSV, Parquet;
    see `read_request_table`), whose columns go before `settings`; `leave_out`: folder that is not searched: the
    output's. Raises `FormatError`: an input that is not there, a glob that matches nothing, a table that can't be read.
    """
    path = Path(text)
    if path.is_dir():
        scenarios = list(_search(path, leave_out.resolve()))
        if not scenarios:
            raise FormatError(f"no {SCENARIO_SUFFIX} file in this folder or below", path=path)
        yield from (Request(scenario, settings, variants, path, listed=False) for scenario in scenarios)
    elif path.exists() and path.name.lower().endswith(TABLE_SUFFIXES):
        yield from read_request_table(path, settings, variants=variants)
    elif path.exists():
        yield Request(path, settings, variants)  # a device or a fifo: its reader says so
    elif _GLOB_CHARACTERS & set(str(text)):
        base, scenarios = _matches(str(text), leave_out.resolve())
        yield from (Request(scenario, settings, variants, base, listed=False) for scenario in scenarios)
    else:
        raise FormatError(absent(text), path=text)


def read_request_table(rows: Path | pd.DataFrame, settings: ConvertSettings, *, variants: int = 1) -> Iterator[Request]:
    """Scenarios of a table, one a row; paths are seen from its folder, those of a frame from the current one.

    Columns: ``scenario`` (path), and if wanted those of `COLUMNS` and `PREFIXES`: ``name`` of the output in place of
    the scenario's, ``variants``, ``profile:ENTITY``, ``only`` and ``ego`` with entities separated by semicolons (ego
    ``none``: there is none), ``parameter:NAME``, ``parameters`` as a JSON object, and so on; ``user:NAME`` is for the
    user. An empty cell leaves what `settings` says.

    Raises `FormatError`: with the line of the table (the header is line 1).
    """
    if isinstance(rows, Path):
        table, path, base = read_text_table(rows), rows, rows.parent
    else:
        table, path, base = as_text(rows), Path("DataFrame"), None
    if "scenario" not in table.columns:
        known = ", ".join(map(str, table.columns[:12]))
        raise FormatError(f"no column 'scenario'; there are {known}{meant_for(path)}", path=path, line=1)
    for name in map(str, table.columns):  # what is not understood is a setting that would be ignored
        if name not in COLUMNS and not name.startswith(PREFIXES):
            known = ", ".join((*COLUMNS, *(f"{prefix}NAME" for prefix in PREFIXES)))
            raise FormatError(f"unknown column {name!r}; there are {known} (user: is for your own)", path=path, line=1)
    folder = base or Path()
    for number, row in enumerate(table.to_dict("records"), start=2):
        cells = {str(name): text for name, value in row.items() if (text := str(value).strip())}
        try:
            scenario = cells.pop("scenario", "")
            if not scenario or "\0" in scenario:
                raise ValueError(f"scenario {scenario!r}: a path holds no zero byte" if scenario else "no scenario")
            rows_variants = _VARIANTS.of_row("variants", variants, cells, folder)
            row_settings = settings.of_row(cells, folder)
            name = file_name(cells["name"], "name") if "name" in cells else ""
        except ValueError as error:
            raise FormatError(str(error), path=path, line=number) from error
        (place,) = scenarios_at(scenario if is_url(scenario) else folder / scenario)
        yield Request(place, row_settings, rows_variants, base, label=_label(cells), name=name)


def _label(cells: Mapping[str, str]) -> str:
    """What a row says of the settings, in short: the same in whatever table and at whatever place it stands."""
    stated = {name: text for name, text in cells.items() if name not in ("variants", "name") and name[:5] != "user:"}
    profile = Path(stated.get("profile", "")).stem
    if not re.fullmatch(r"[\w.-]{1,60}", profile):
        profile = ""
    elif stated.get("profile") == profile:  # a name says all, a path may be another folder's
        del stated["profile"]
    listed = json.dumps(stated, sort_keys=True).encode()
    return "".join(f"_{part}" for part in (profile, hashlib.sha256(listed).hexdigest()[:8] if stated else "") if part)


def is_single(text: str | Path) -> bool:
    """Whether an input is one scenario, or nothing that is there: neither folder, glob, table nor distribution."""
    path = Path(text)
    if path.is_file():
        is_table = path.name.lower().endswith(TABLE_SUFFIXES)
        return not is_table and document_kind(path) is not DocumentKind.DISTRIBUTION
    return not path.is_dir() and not _GLOB_CHARACTERS & set(str(text))


def _search(folder: Path, avoided: Path) -> Iterator[Path]:
    """Scenario files below a folder, sorted; hidden folders, output trees of former batches and `avoided` aside."""
    from xosc_lateral.workflows.batch.manifest import MANIFEST  # one scenario needs none

    for name, folders, files in os.walk(folder):
        here = Path(name)
        folders[:] = [inner for inner in sorted(folders) if not inner.startswith(".")
                      and (here / inner).resolve() != avoided and not (here / inner / MANIFEST).exists()]  # fmt: skip
        for file in sorted(files):
            if file.lower().endswith(SCENARIO_SUFFIX) and not file.startswith("."):
                yield here / file


def _matches(pattern: str, avoided: Path) -> tuple[Path, list[Path]]:
    """Folder before the first wild part, and files that match, sorted; hidden ones and those in `avoided` aside."""
    parts = Path(pattern).parts
    wild = next(index for index, part in enumerate(parts) if _GLOB_CHARACTERS & set(part))
    base = Path(*parts[:wild]) if wild else Path()
    matching = sorted(base.glob(str(Path(*parts[wild:]))))
    shown = [path for path in matching if not any(part.startswith(".") for part in path.relative_to(base).parts)]
    if not shown:
        raise FormatError("nothing matches", path=pattern)
    return base, [path for path in shown if path.is_file() and avoided not in path.resolve().parents]
