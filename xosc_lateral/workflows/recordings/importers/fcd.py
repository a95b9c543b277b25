"""SUMO's FCD output ("floating car data"): where every vehicle of a run with the sublane model was.

Lanes are SUMO's, so is `posLat`, the place in them: positive to the left. Widths and counts of lanes come from the net,
where it is given; else lanes are 3.2 m wide, as SUMO has them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.workflows.recordings.importers.table import guarded
from xosc_lateral.workflows.recordings.neighbours import find_neighbours

if TYPE_CHECKING:
    from lxml import etree

WIDTH = 3.2
"""Of SUMO's lanes. [m]"""

LENGTHS = {False: 5.0, True: 7.1}
"""Of SUMO's passenger cars and trucks; FCD output has no lengths. [m]"""

_TRUCKS = ("truck", "trailer", "bus", "coach", "lkw")


@guarded
def import_fcd(source: Path, *, net: str | Path | None = None, lane_width: float = WIDTH) -> pd.DataFrame:
    """A drive for every vehicle of what ``--fcd-output`` wrote; it is a truck when its type's name says so.

    Raises `FormatError`, `NotEnoughDataError`: not such a file; one without `posLat`; one without vehicles.

    `net`: the road network, ``.net.xml``, for widths and counts of lanes. `lane_width`: without it. [m]
    """
    widths = {} if net is None else _lanes(Path(net))
    rows = list(_rows(source))
    if not rows:
        raise NotEnoughDataError(f"{source}: no vehicle")
    time, name, lane, pos, offset, speed, kind = zip(*rows, strict=True)
    edge, index = zip(*(one.rpartition("_")[::2] for one in lane), strict=True)
    table = pd.DataFrame({"drive": name, "time": time, "offset": offset, "speed": speed})
    table["lane_width"] = [widths.get(one, lane_width) for one in lane]
    table["lane_index"] = np.array(index, dtype=np.int64)
    top: dict[str, int] = {}
    for one in widths or lane:
        road, _, number = one.rpartition("_")
        top[road] = max(top.get(road, 0), int(number) + 1)
    table["lane_count"] = [top[one] for one in edge]
    table["is_truck"] = [float(any(word in one.lower() for word in _TRUCKS)) for one in kind]
    instant = pd.factorize(pd.Series(time).astype(str) + "\0" + pd.Series(edge))[0]
    truck = table["is_truck"].to_numpy() > 0
    length = np.where(truck, LENGTHS[True], LENGTHS[False])
    number = table["lane_index"].to_numpy()
    around = find_neighbours(
        instant, number, np.array(pos) - 0.5 * length, length, truck,
        lane_on_left=number + 1 < table["lane_count"].to_numpy(), lane_on_right=number > 0,
    )  # fmt: skip
    table = table.assign(**around)
    return table.sort_values(["drive", "time"], kind="stable").reset_index(drop=True)


def _rows(source: Path) -> Iterator[tuple[float, str, str, float, float, float, str]]:
    time, found = float("nan"), False
    for event, element in _elements(source, ("timestep", "vehicle")):
        if element.tag == "timestep":
            if event == "start":
                time, found = _number(element, "time", source), True
            else:
                element.clear()
        elif event == "start" and not element.get("lane", "").startswith(":"):  # inside a junction
            if not found:
                raise _wrong("a vehicle outside a timestep", element, source)
            if element.get("posLat") is None:
                what = "no posLat: it is written with the sublane model and --fcd-output.attributes all"
                raise _wrong(what, element, source)
            if element.get("lane") is None or element.get("id") is None:
                raise _wrong("no id or lane", element, source)
            place, side, speed = (_number(element, name, source) for name in ("pos", "posLat", "speed"))
            yield time, str(element.get("id")), str(element.get("lane")), place, side, speed, element.get("type", "")


def _lanes(net: Path) -> dict[str, float]:
    """Widths of a net's lanes, by their ids. [m]"""
    found = {}
    for event, element in _elements(net, ("lane",)):
        if event == "start" and element.get("id") and not str(element.get("id")).startswith(":"):
            found[str(element.get("id"))] = WIDTH if element.get("width") is None else _number(element, "width", net)
    if not found:
        raise FormatError("no lane: not a SUMO network", path=net)
    return found


def _elements(path: Path, tags: tuple[str, ...]) -> Iterator[tuple[str, etree._Element]]:
    from lxml import etree

    try:
        with path.open("rb") as file:
            yield from etree.iterparse(
                file, events=("start", "end"), tag=tags, resolve_entities=False, no_network=True, load_dtd=False
            )
    except etree.XMLSyntaxError as error:
        raise FormatError(f"not XML: {error.msg}", path=path, line=error.lineno) from error


def _wrong(what: str, element: etree._Element, path: Path) -> FormatError:
    line: Any = element.sourceline  # int or None; its stubs say otherwise
    return FormatError(what, path=path, line=line, element=str(element.tag))


def _number(element: etree._Element, name: str, path: Path) -> float:
    text = element.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise _wrong(f"{name}={text!r}", element, path)
    return value
