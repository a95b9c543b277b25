"""One opening for whatever stands for inputs: each becomes a path, on disk or in memory; readers know files."""

from __future__ import annotations

import html
import io
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from glob import has_magic
from pathlib import Path, PosixPath, PurePosixPath, PureWindowsPath, WindowsPath
from typing import Any, TypeAlias
from xml.etree import ElementTree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pa, pd
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.files.held import Held, hold
from xosc_lateral.files.mapping import MappingLike, as_mapping
from xosc_lateral.files.openscenario.references import LEVELS_UP
from xosc_lateral.files.remote import address, inputs_of, local
from xosc_lateral.files.source import read_source
from xosc_lateral.files.tables import frame_of, read_table

DocumentLike: TypeAlias = Any
"""A path or URL; bytes, XML text, a file-like object, a parsed tree, a scenariogeneration object."""
RoadLike: TypeAlias = Any
"""The road; or roads and catalogs by their names as seen from the scenario."""

_KINDS = "a path, bytes, XML text, a file-like object, an lxml tree or a scenariogeneration object"
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_LOGIC_FILE = re.compile(rb"<LogicFile\s[^>]*?filepath\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_NAMED = re.compile(rb"<(?:LogicFile|Directory|ScenarioFile)\s[^>]*?(?:file)?path\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_ENCODING = re.compile(r"\A(\s*<\?xml[^>]*?)\s+encoding\s*=\s*[\"'](?!utf-?8[\"'])[^\"']*[\"']", re.IGNORECASE)


@dataclass(frozen=True, eq=False, slots=True)
class ScenarioInput:
    """A scenario to read, and its road if not where the scenario says; `held`: what of it is in memory."""

    path: Path
    road: Path | None
    held: Held | None = None


def scenario_input(scenario: DocumentLike, road: RoadLike | None = None, name: str = "scenario") -> ScenarioInput:
    """Paths of a scenario and its road, of files in memory where it is not on a disk; `name`: one without a name.

    Raises `TypeError`: neither can be that; `FormatError`: scenariogeneration can't write its object, or no such file.
    """
    in_memory = document(scenario, "scenario")
    of_road = None if road is None or isinstance(road, Mapping) else document(road, "road")
    if in_memory is None and not isinstance(road, Mapping) and of_road is None:
        return ScenarioInput(scenarios_at(scenario)[0], None if road is None else local(road))
    if in_memory is None:
        path = scenarios_at(scenario)[0]
        name, data = path.name, read_source(path).data
    else:
        stated = getattr(scenario, "name", "") if hasattr(scenario, "read") else ""
        name, data = (Path(stated).name if isinstance(stated, str) else "") or f"{name}.xosc", in_memory
    files, road_name = {name: data}, None
    if isinstance(road, Mapping):
        files |= {str(key): _bytes(value, f"road[{key!r}]") for key, value in road.items()}
    elif road is not None:
        written = _road_in(data)
        road_name = None if written and written != name else "road.xodr"
        files[road_name or written] = _bytes(road, "road") if of_road is None else of_road
    held = hold(files)
    return ScenarioInput(held.folder / name, None if road_name is None else held.folder / road_name, held)


def scenarios_at(stated: str | Path) -> list[Path]:
    """Scenarios, folders and tables of them at a path or pattern; if elsewhere, copies, with roads and catalogs.

    Raises `FormatError`: see `files.remote`.
    """
    if not (url := address(stated)):
        return [Path(stated)]
    copies = inputs_of([url])
    todo, done = [*copies], {*copies}
    while todo:
        file = todo.pop()
        if file.is_dir():
            todo += file.rglob("*.xosc")
        elif file.suffix.lower() == ".xosc":
            for path in _named_in(file) - done:
                done.add(path)
                if not any(folder in path.parents for folder in copies):  # else it has come with its folder
                    with suppress(FormatError):  # its reader says who names it
                        todo += inputs_of([address(path)])
    return copies


def _named_in(scenario: Path) -> set[Path]:
    """Roads, catalogs and scenarios that a copy of one names, no farther away than its reader would look."""
    matches = _NAMED.finditer(_COMMENT.sub(b"", read_source(scenario).data))
    written = [html.unescape((one[1] or one[2] or b"").decode(errors="replace")) for one in matches]
    names = [PurePosixPath(name.strip().replace("\\", "/")) for name in written if name.strip()]
    near = (name for name in names if name.parts.count("..") <= LEVELS_UP and not name.is_absolute())
    return {Path(os.path.normpath(scenario.parent / name)) for name in near}


def several(stated: Any) -> list[Any]:
    """One of them, or several."""
    is_list = isinstance(stated, list | tuple | Sequence) and not isinstance(
        stated, str | bytes | bytearray | memoryview
    )
    return list(stated) if is_list and not ElementTree.iselement(stated) else [stated]


def _bytes(stated: Any, what: str) -> bytes:
    data = document(stated, what)
    return read_source(local(stated)).data if data is None else data


def document(stated: Any, what: str) -> bytes | None:
    """Bytes of a file; None for a path."""
    if isinstance(stated, bytes | bytearray | memoryview):
        return bytes(stated)
    if isinstance(stated, str) and stated.lstrip("\ufeff \t\r\n").startswith("<"):
        return _encoded(stated)
    if isinstance(stated, str | os.PathLike):
        return None
    if hasattr(stated, "read"):
        content = stated.read()
        return _encoded(content) if isinstance(content, str) else bytes(content)
    if hasattr(stated, "get_element"):
        try:
            stated = stated.get_element()
        except Exception as error:  # whatever it finds missing
            raise FormatError(f"{what}: scenariogeneration can't write it: {error or type(error).__name__}") from error
    if type(stated).__module__.startswith("lxml."):
        from lxml import etree

        return bytes(etree.tostring(stated, encoding="utf-8", xml_declaration=True, with_tail=False))
    root = stated.getroot() if hasattr(stated, "getroot") else stated
    if ElementTree.iselement(root):
        return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))
    raise TypeError(f"{what}: expected {_KINDS}, not {type(stated).__name__}")


def _encoded(text: str) -> bytes:
    """XML text in UTF-8, whatever it says it was in."""
    return _ENCODING.sub(r"\1", text.removeprefix("\ufeff"), count=1).encode()


def _road_in(scenario: bytes) -> str:
    """The road's name as a scenario says it; empty: it says none, or one that holds on one machine alone."""
    match = _LOGIC_FILE.search(_COMMENT.sub(b"", scenario))
    written = "" if match is None else html.unescape((match[1] or match[2] or b"").decode(errors="replace")).strip()
    name = PureWindowsPath(written)
    usable = bool(name.suffix) and not (name.is_absolute() or name.drive or name.root) and "$" not in written
    return written if usable else ""


InputLike: TypeAlias = Any
"""A path, URL, pattern or folder; bytes, text or a file-like object; a data frame, a `Drive`, a result of ours."""

KINDS = {b"PAR1": ".parquet", b"ARROW1": ".feather", b"<": ".xml", b"\xef\xbb\xbf<": ".xml"}


DOCUMENTS = {b"<OpenSCENARIO": ".xosc", b"<OpenDRIVE": ".xodr"}


class HeldPath(WindowsPath if os.name == "nt" else PosixPath):  # type: ignore[misc]
    """A path in memory that keeps what lies there."""

    held: Held


def opened(stated: InputLike, name: str = "input") -> list[Path]:
    """Paths of all that is stated, in order."""
    items = several(stated)
    paths = list[Path]()
    for number, item in enumerate(items, start=1):
        label = name if len(items) == 1 else f"{name} {number}"
        if isinstance(item, str | os.PathLike) and not str(item).lstrip("\ufeff \t\r\n").startswith("<"):
            paths += inputs_of([item])  # type: ignore[list-item]
        else:
            paths.append(_in_memory(item, label))
    return paths


def opened_as_one(stated: InputLike, columns: MappingLike | None = None, name: str = "recording") -> Path:
    """The only path, or that of a table of which the stated ones are parts."""
    paths = opened(stated, name)
    if len(paths) == 1:
        return paths[0]
    mapping = as_mapping(columns)
    return _in_memory(pd.concat([read_table(path, mapping) for path in paths], ignore_index=True), name)


def _in_memory(item: InputLike, name: str) -> Path:
    made = getattr(item, "data", None)  # of a conversion
    data = made if isinstance(made, bytes) else _frame_bytes(item)
    if data is None:
        data = document(item, name)
        assert data is not None
    stem = Path(str(getattr(item, "name", "") or name)).name if hasattr(item, "read") else name
    ending = next((end for magic, end in KINDS.items() if data.startswith(magic)), ".csv")
    ending = next((end for tag, end in DOCUMENTS.items() if tag in data[:4096]), ending)
    file = stem if Path(stem).suffix else f"{stem}{ending}"
    held = hold({file: data})
    path = HeldPath(held.folder / file)
    path.held = held
    return path


def _frame_bytes(frame: InputLike) -> bytes | None:
    """Bytes of a table that is in memory; None: it is none."""
    if isinstance(frame, Drive):
        frame = {"time": frame.time, "offset": frame.offset, **frame.context, "drive": [frame.name] * len(frame)}
    elif hasattr(frame, "headline"):
        frame = frame.to_frame()
    try:
        frame = frame_of(frame)
    except TypeError:
        return None
    import pyarrow.feather as feather

    frame = frame.rename(columns=str).reset_index(drop=True)
    if not frame.columns.is_unique:
        raise FormatError(f"column {frame.columns[frame.columns.duplicated()][0]!r} appears twice")
    out = io.BytesIO()
    try:
        table = pa.Table.from_pandas(frame, preserve_index=False)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError):  # cells of several kinds become text
        mixed = [name for name in frame.columns if frame[name].dtype == object]
        texts = {name: frame[name].map(str, na_action="ignore") for name in mixed}
        table = pa.Table.from_pandas(frame.assign(**texts), preserve_index=False)
    feather.write_feather(table, out, compression="uncompressed")
    return out.getvalue()


def is_document(item: InputLike) -> bool:
    """Whether it is a scenario, or a path or folder of some, and no table in memory."""
    if isinstance(item, bytes | bytearray | memoryview):
        return bytes(item[:64]).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")
    if isinstance(item, str | os.PathLike) or hasattr(item, "read"):
        return not has_magic(str(item)) or hasattr(item, "read")
    return not isinstance(item, Drive) and not hasattr(item, "headline") and _frame_bytes(item) is None
