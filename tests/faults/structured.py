"""Mutants that keep a file's form: the tree of a document or the cells of a table are changed, then written properly.

`mutants.py` damages bytes, which parsers refuse early. What comes from here is well-formed and gets further in.
"""

from __future__ import annotations

import csv
import gzip
import io
import json
import re
import zipfile
from collections.abc import Callable
from copy import deepcopy
from typing import Any

from lxml import etree

from tests.faults.mutants import HOSTILE_NUMBERS, HOSTILE_WORDS, Rng, mutate
from tests.faults.structured_tables import mutate_mf4, mutate_parquet, mutate_rows
from xosc_lateral.files.openscenario.provenance import content_hash

FACTORS = (-1.0, 0.0, 1e-300, 1e-6, 0.01, 0.5, 2.0, 100.0, 1e6, 1e12, 1e300)


def mutate_structure(data: bytes, rng: Rng) -> bytes:
    """One to three changes of what a file says; bytes of a form that is not known are changed as bytes."""
    if data[:2] == b"\x1f\x8b":
        return gzip.compress(mutate_structure(gzip.decompress(data), rng), mtime=0)
    if data[:4] == b"PAR1":
        return mutate_parquet(data, rng)
    if data[:3] == b"MDF":
        try:
            return mutate_mf4(data, rng)
        except Exception:  # asammdf does not write everything that it reads
            return mutate(data, rng)
    if data[:2] == b"PK":
        return _mutate_zip(data, rng)
    head = data.lstrip()[:1]
    if _PROVENANCE.search(data) and rng.random() < 0.5:
        return _mutate_provenance(data, rng)
    if head == b"<":
        return _mutate_xml(data, rng)
    if head in (b"{", b"["):
        return _mutate_json(data, rng)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        return mutate(data, rng)
    rows = list(csv.reader(io.StringIO(text)))
    return mutate_rows(rows, rng) if len(rows) > 1 else mutate(data, rng)


def _pick(rng: Rng, choices: Any) -> Any:
    return choices[int(rng.integers(len(choices)))]


_PROVENANCE = re.compile(rb"(?<=<!-- xosc-lateral provenance: ).*?(?= -->)", re.DOTALL)


def _mutate_provenance(data: bytes, rng: Rng) -> bytes:
    """By who knows how a file of ours is sealed: other facts, or other content, and its hash made anew."""
    found = _PROVENANCE.search(data)
    assert found is not None
    facts = _changed(json.loads(found[0]), rng)
    if rng.random() < 0.3:
        data = mutate(data[: found.start()], rng) + found[0] + data[found.end() :]
        facts = json.loads(found[0]) | {"content_sha256": content_hash(data)}
    text = json.dumps(facts, sort_keys=True).replace("--", "-\\u002d")
    return _PROVENANCE.sub(lambda _: text.encode(), data, count=1)


# ---- JSON ------------------------------------------------------------------------------------------------------------
def _mutate_json(data: bytes, rng: Rng) -> bytes:
    """One document, or one a line."""
    try:
        return json.dumps(_changed(json.loads(data), rng), ensure_ascii=bool(rng.integers(2))).encode()
    except json.JSONDecodeError:
        lines = data.splitlines()
        k = int(rng.integers(len(lines)))
        lines[k] = json.dumps(_changed(json.loads(lines[k]), rng)).encode()
        return b"\n".join(lines) + b"\n"


def _changed(document: Any, rng: Rng) -> Any:
    for _ in range(int(rng.integers(1, 4))):
        places = list(_places(document))
        if not places:
            return document
        # numbers in long lists are most of a file and all alike: half of the time anything else
        few = [place for place in places if not (isinstance(place[0], list) and len(place[0]) > 8)]
        holder, key = _pick(rng, few if few and rng.random() < 0.6 else places)
        other = _pick(rng, places)
        _JSON_CHANGES[int(rng.integers(len(_JSON_CHANGES)))](holder, key, deepcopy(other[0][other[1]]), rng)
    return document


def _places(node: Any) -> Any:
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield node, key
        yield from _places(value)


def _scaled(value: Any, rng: Rng) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return [_scaled(one, rng) for one in value] if isinstance(value, list) else str(value)
    changed = value * _pick(rng, FACTORS)
    return int(changed) if isinstance(value, int) and abs(changed) < 1e18 else changed


def _set(value: Callable[[Any, Any, Rng], Any]) -> Callable[[Any, Any, Any, Rng], None]:
    def change(holder: Any, key: Any, other: Any, rng: Rng) -> None:
        holder[key] = value(holder[key], other, rng)

    return change


def _drop(holder: Any, key: Any, other: Any, rng: Rng) -> None:
    del holder[key]


def _add(holder: Any, key: Any, other: Any, rng: Rng) -> None:
    if isinstance(holder, dict):
        holder[_pick(rng, (f"{key}2", key.upper(), "", "__class__", *HOSTILE_WORDS))] = other
    else:
        holder.insert(key, other)


def _longer(value: Any, other: Any, rng: Rng) -> Any:
    if isinstance(value, list):
        change = int(rng.integers(4))
        return (value[: len(value) // 2], value + value[-1:], value[::-1], value * 50)[change]
    return [value] * int(rng.integers(3))


def _nested(value: Any, other: Any, rng: Rng) -> Any:
    for _ in range(int(_pick(rng, (1, 3, 70)))):
        value = [value] if rng.random() < 0.5 else {"a": value}
    return value


def _hostile(value: Any, other: Any, rng: Rng) -> Any:
    return _pick(rng, (None, True, False, "", [], {}, 0, -1, 1e308, -1e308, 10**30, float("nan"), float("inf")))


_JSON_CHANGES: tuple[Callable[[Any, Any, Any, Rng], None], ...] = (
    *(_set(lambda value, other, rng: _scaled(value, rng)),) * 5,
    *(_set(lambda value, other, rng: other),) * 2,
    _set(lambda value, other, rng: str(value)),
    _set(lambda value, other, rng: _pick(rng, HOSTILE_WORDS + HOSTILE_NUMBERS)),
    *(_set(_hostile), _set(_longer), _set(_nested), _drop, _add),
)


# ---- XML -------------------------------------------------------------------------------------------------------------
def _mutate_xml(data: bytes, rng: Rng) -> bytes:
    root = etree.fromstring(data)
    for _ in range(int(rng.integers(1, 4))):
        elements = [element for element in root.iter() if isinstance(element.tag, str)]
        _XML_CHANGES[int(rng.integers(len(_XML_CHANGES)))](_pick(rng, elements), elements, rng)
    return etree.tostring(root, xml_declaration=True, encoding=_pick(rng, ("utf-8", "utf-16", "ascii")))


def _copied(element: Any) -> Any:
    return etree.fromstring(etree.tostring(element, with_tail=False))


def _remove(element: Any, elements: list[Any], rng: Rng) -> None:
    if element.getparent() is not None:
        element.getparent().remove(element)


def _repeat(element: Any, elements: list[Any], rng: Rng) -> None:
    if element.getparent() is not None:
        for _ in range(int(_pick(rng, (1, 2, 30)))):
            element.addnext(_copied(element))


def _graft(element: Any, elements: list[Any], rng: Rng) -> None:
    element.append(_copied(_pick(rng, elements)))


def _replace(element: Any, elements: list[Any], rng: Rng) -> None:
    if element.getparent() is not None:
        element.getparent().replace(element, _copied(_pick(rng, elements)))


def _rename(element: Any, elements: list[Any], rng: Rng) -> None:
    element.tag = _pick(rng, (*(other.tag for other in elements), "Unknown", "{urn:x}y"))


def _turn(element: Any, elements: list[Any], rng: Rng) -> None:
    element[:] = element[::-1]


def _empty(element: Any, elements: list[Any], rng: Rng) -> None:
    element[:] = []
    element.text = _pick(rng, (None, "12", "text", "\n"))


def _attribute(element: Any, elements: list[Any], rng: Rng) -> None:
    with_some = [element for element in elements if element.attrib]
    if not with_some:
        return
    element = _pick(rng, with_some)
    name = _pick(rng, sorted(element.attrib))
    match int(rng.integers(6)):
        case 0:
            del element.attrib[name]
        case 1:
            element.set(f"{name}2", element.attrib.pop(name))
        case 2:
            donor = _pick(rng, with_some)
            element.set(name, donor.get(_pick(rng, sorted(donor.attrib))))
        case 3:
            element.set(name, _legal(_pick(rng, HOSTILE_WORDS + HOSTILE_NUMBERS)))
        case _:
            try:
                element.set(name, repr(float(element.get(name)) * _pick(rng, FACTORS)))
            except ValueError:
                element.set(name, _pick(rng, ("true", "${1 + 1}", "$Speed", "0", "a")))


def _legal(text: str) -> str:
    """Without what XML can't hold."""
    return "".join(letter for letter in text if letter >= " ")


_XML_CHANGES: tuple[Callable[[Any, list[Any], Rng], None], ...] = (
    *(_attribute,) * 7,
    *(_remove, _repeat, _graft, _replace, _rename, _turn, _empty),
)


# ---- archives --------------------------------------------------------------------------------------------------------
def _mutate_zip(data: bytes, rng: Rng) -> bytes:
    packed = io.BytesIO()
    change = int(rng.integers(4))
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            renamed = _pick(rng, ("../../x.csv", "/abs.csv", "漢字.csv", "x/", name.upper(), "trajectories_.csv"))
            new.writestr(renamed if change == 0 else name, mutate_structure(content, rng) if change < 3 else content)
            if change == 1:
                new.writestr(f"second/{name}", content)
        if change == 3:
            new.writestr("inner.zip", data)
    return packed.getvalue()
