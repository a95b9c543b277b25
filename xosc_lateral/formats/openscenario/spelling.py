"""Truth values in words that the standard does not have: read as they are meant, and named, since players differ."""

from __future__ import annotations

from collections import Counter

from lxml import etree

from xosc_lateral.formats.openscenario.element import XmlElement, means_true
from xosc_lateral.scenario.place import Place, Unsupported

BOOLEANS = frozenset(
    {
        *("activateAnimation", "activateLateral", "activateLighting", "activateLongitudinal", "active", "alongRoute"),
        *("animation", "closed", "continuous", "freeSpace", "freespace", "graphics", "lateral", "lighting"),
        *("longitudinal", "loop", "oppositeLanes", "selectTriggeringEntities", "sensors", "traffic"),
    }
)
"""Attributes that the standard calls Boolean, all versions."""
_STANDARD = frozenset({"true", "1"})


def remark_spellings(root: XmlElement) -> list[Unsupported]:
    """One remark for each attribute and word such as ``freespace="True"``, at its first place."""
    first: dict[tuple[str, str], Place] = {}
    count: Counter[tuple[str, str]] = Counter()
    for item in root.xml.iter("{*}*"):
        _count(item, root, first, count)
    return [
        Unsupported(
            place.element,
            place,
            f"{name}='{word}' is read as true{'' if count[name, word] == 1 else f' ({count[name, word]} times)'}; "
            "the standard's word is 'true', and the reference player takes this one for false",
        )
        for (name, word), place in first.items()
    ]


def _count(
    item: etree._Element, root: XmlElement, first: dict[tuple[str, str], Place], count: Counter[tuple[str, str]]
) -> None:
    """One element's attributes."""
    is_truth = item.get("parameterType") == "boolean"
    for name, value in item.attrib.items():
        key = str(name), str(value).strip()
        is_boolean = key[0] in BOOLEANS or (is_truth and key[0] == "value")
        if is_boolean and means_true(key[1]) and key[1] not in _STANDARD:
            count[key] += 1
            first.setdefault(key, XmlElement(item, root.path, root.scope).place())
