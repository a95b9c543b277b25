"""XML from strangers: parsed without entities, document types or network, refused in one line."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from lxml import etree
from msgspec import Struct

from xosc_lateral.base.errors import FormatError, meant_for
from xosc_lateral.base.limits import XML_ATTRIBUTES, XML_TREE
from xosc_lateral.files.source import check_regular, guard_input, hash_of, open_source, read_source, state_key
from xosc_lateral.files.tables import unpacked_text

MAX_CACHED_BYTES = 1_000_000  # larger files are read anew each time: catalogs are small, and 16 trees are kept
_BLANKS, _DECLARATION = re.compile(rb"\s*"), re.compile(rb"<\?xml\s[^<>\r\n]*\?>")

_DSL = re.compile(
    rb"\A(?:\xef\xbb\xbf)?(?:\s*#[^\n]*\n|\s*\n)*\s*(?:import|scenario|struct|actor|action|enum|type)\s+[\w.\"]"
)
"""How a file of OpenSCENARIO DSL begins: comments, then a declaration."""

_CROWDED = etree.XPath(f"//*[count(@*) > {XML_ATTRIBUTES}]")

# Measured with libxml2 2.14 on element-only, attribute-rich and text-rich files: within 15 % of the memory taken.
_BYTES_PER_TAG, _BYTES_PER_ATTRIBUTE = 150, 250


class XmlDocument(Struct, frozen=True):
    """A parsed file: root element, the bytes that it was parsed from, and their SHA-256."""

    root: etree._Element
    data: bytes
    sha256: str


def parse_xml(data: bytes, path: object) -> etree._Element:
    """Root element of a document.

    Raises `FormatError`: Not XML (with line), empty, too large, or with a document type that declares entities: neither
    format has one, and both entity expansion and external entities come in this way.
    """
    if not data.strip(b" \t\r\n\xef\xbb\xbf"):
        raise FormatError("the file is empty", path=path)
    estimate = len(data) + _BYTES_PER_TAG * data.count(b"<") + _BYTES_PER_ATTRIBUTE * data.count(b"=")
    if estimate > XML_TREE.bytes:
        raise FormatError(XML_TREE.refusal(estimate / 1e6), path=path)
    if b"<!ENTITY" in data:
        line = data[: data.index(b"<!ENTITY")].count(b"\n") + 1
        raise FormatError("entity declarations are not allowed", path=path, line=line, element="DOCTYPE")
    # A parser of its own for each call: lxml's are not meant to be shared between threads, and making one is cheap.
    data = _declared_late(data)
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        what = f"not well-formed XML: {error.msg}"
        if not str(path).lower().endswith((".xosc", ".xodr")):
            what += meant_for(path)
        if _DSL.search(data):
            what = "an OpenSCENARIO DSL file: OpenSCENARIO XML is read, and there is no converter from DSL here"
        raise FormatError(what, path=path, line=error.lineno or None) from error
    except (ValueError, LookupError) as error:  # an encoding that nobody knows
        raise FormatError(f"not readable as XML: {error}", path=path) from error
    document_type: Any = root.getroottree().docinfo.internalDTD  # the stubs know less than lxml
    if document_type is not None and any(True for _ in document_type.entities()):
        raise FormatError("entity declarations are not allowed", path=path, element="DOCTYPE")
    if crowded := cast("list[etree._Element]", _CROWDED(root)):
        element = crowded[0]
        raise FormatError(
            XML_ATTRIBUTES.refusal(len(element.keys())), path=path, line=line_of(element), element=element.tag
        )
    return root


def _declared_late(data: bytes) -> bytes:
    """Blanks in place of an XML declaration after comments or blanks: not allowed, yet in the field; places stay."""
    begin = at = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    while True:
        at = _BLANKS.match(data, at).end()  # type: ignore[union-attr]  # matches nothing, too
        if not data.startswith(b"<!--", at):
            break
        at = data.find(b"-->", at + 4) + 3
        if at < 3:
            return data
    declaration = _DECLARATION.match(data, at)
    if declaration is None or at == begin:
        return data
    return data[:at] + b" " * (declaration.end() - at) + data[declaration.end() :]


def read_xml(path: Path) -> tuple[etree._Element, bytes]:
    """Root element and bytes of a file; see `read_document`."""
    document = read_document(path)
    return document.root, document.data


def document_of(data: bytes, path: object) -> XmlDocument:
    """From bytes, as if they were that file's."""
    return XmlDocument(parse_xml(data, path), data, hash_of(data))


def line_of(xml: etree._Element) -> int | None:
    """Line in the file, from 1; None for an element that was made, not read."""
    return cast("int | None", xml.sourceline)  # the stubs have an ellipsis there


def root_tag(path: Path) -> str:
    """Name of a file's root element, without its namespace; empty: it is no XML. The file may be packed with gzip."""
    try:
        with open_source(path) as source:
            begin = etree.iterparse(
                unpacked_text(source), events=("start",), resolve_entities=False, no_network=True, load_dtd=False
            )
            return next((etree.QName(element).localname for _, element in begin), "")
    except (etree.XMLSyntaxError, ValueError):
        return ""


def read_document(path: Path) -> XmlDocument:
    """Read a file. The tree is shared between callers: never change it. Raises `FormatError`."""
    state = check_regular(path)
    guard_input(path)
    return _read(path) if state.st_size > MAX_CACHED_BYTES else _read_cached(str(path), state_key(state))


@lru_cache(maxsize=16)  # catalogs are named by thousands of scenarios; a changed file has another key
def _read_cached(path: str, _state: tuple[int, ...]) -> XmlDocument:
    return _read(Path(path))


def _read(path: Path) -> XmlDocument:
    content = read_source(path, XML_TREE)
    return XmlDocument(parse_xml(content.data, path), content.data, content.sha256)
