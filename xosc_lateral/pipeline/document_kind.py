"""What an OpenSCENARIO file holds, by its first elements."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import IO

from lxml import etree

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import HEADER_MARK
from xosc_lateral.formats.source import open_source
from xosc_lateral.limits import XML_TREE


class DocumentKind(Enum):
    """What an OpenSCENARIO file holds."""

    SCENARIO = "scenario"
    CATALOG = "catalog"
    DISTRIBUTION = "parameter value distribution"
    CONVERTED = "converted scenario"
    VARIANTS = "set of converted variants"


DISTRIBUTIONS = frozenset({DocumentKind.DISTRIBUTION, DocumentKind.VARIANTS})
"""Files that stand for several scenarios."""

_KINDS = {"Catalog": DocumentKind.CATALOG, "ParameterValueDistribution": DocumentKind.DISTRIBUTION}

_SCENARIO_PARTS = frozenset({"CatalogLocations", "RoadNetwork", "Entities", "Storyboard"})


def document_kind(path: Path) -> DocumentKind:
    """What a file holds, from its first elements; what can't be read counts as a scenario (its reader says why)."""
    try:
        with open_source(path, XML_TREE) as source:
            return _kind_from(source.file)
    except (etree.XMLSyntaxError, FormatError, OSError, ValueError, LookupError):
        return DocumentKind.SCENARIO


def _kind_from(file: IO[bytes]) -> DocumentKind:
    events = etree.iterparse(
        file, events=("start",), resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True
    )
    is_ours = False
    for _, element in events:
        parent = element.getparent()
        if parent is not None and parent.getparent() is None and isinstance(element.tag, str):
            name = local_name(element)
            if name == "FileHeader" and HEADER_MARK in (element.get("description") or ""):
                is_ours = True
            elif is_ours:
                is_set = name == "ParameterValueDistribution"
                return DocumentKind.VARIANTS if is_set else DocumentKind.CONVERTED
            if name in _KINDS or name in _SCENARIO_PARTS:
                return _KINDS.get(name, DocumentKind.SCENARIO)
    return DocumentKind.CONVERTED if is_ours else DocumentKind.SCENARIO
