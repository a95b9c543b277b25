"""The option codes against the enumerations of the published schemas, every version of them."""

from __future__ import annotations

from enum import StrEnum
from functools import cache
from pathlib import Path

import pytest
from lxml import etree

from xosc_lateral.world.scenario import enums
from xosc_lateral.world.scenario.enums import EntityCategory, ParameterType, Priority, RelativeDistanceType

XSD = Path(__file__).resolve().parents[2] / "data" / "xsd"
VERSIONS = ("1.0.0", "1.1.1", "1.2.0", "1.3.0")
NAMES = {EntityCategory: "ObjectType"}
"""Where the schema's name is another one."""

OLDER = {
    Priority: {"overwrite": "override"},
    RelativeDistanceType: {"cartesianDistance": "euclidianDistance"},
    ParameterType: {"integer": "int"},
}
"""Words that the standard itself has replaced, and by which."""

ALL = [one for one in vars(enums).values() if isinstance(one, type) and issubclass(one, StrEnum) and one is not StrEnum]


@cache
def enumerations(version: str) -> dict[str, set[str]]:
    root = etree.parse(str(XSD / f"OpenSCENARIO-{version}.xsd"))
    space = {"xsd": "http://www.w3.org/2001/XMLSchema"}
    found: dict[str, set[str]] = {}
    for kind in root.iterfind(".//xsd:simpleType[@name]", space):
        found[kind.get("name")] = {one.get("value") for one in kind.iterfind(".//xsd:enumeration", space)}
    return found


def published(enum: type[StrEnum]) -> set[str]:
    """Every word of any version."""
    name = NAMES.get(enum, enum.__name__)
    return set().union(*(enumerations(version).get(name, set()) for version in VERSIONS))


@pytest.mark.parametrize("enum", ALL, ids=lambda enum: enum.__name__)
def test_every_word_of_the_schemas_is_known_and_no_other(enum):
    older = OLDER.get(enum, {})
    words = published(enum)
    assert words, f"no schema has an enumeration {NAMES.get(enum, enum.__name__)}"
    assert {older.get(word, word) for word in words} == {member.value for member in enum}


def test_a_word_that_was_replaced_is_in_an_older_schema_than_the_one_that_replaces_it():
    for enum, words in OLDER.items():
        for old, new in words.items():
            first = {word: next(v for v in VERSIONS if word in enumerations(v)[enum.__name__]) for word in (old, new)}
            assert first[old] < first[new]
