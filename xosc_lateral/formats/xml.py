"""XML from strangers: parsed without entities, document types or network, refused in one line."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.errors import FormatError

MAX_BYTES = 256 * 2**20
"""Largest file that is read. The largest field road is under 60 MB."""


def parse_xml(data: bytes, path: object) -> etree._Element:
    """Root element of a document.

    Raises
    ------
    FormatError
        Not XML (with line), empty, or with a document type that declares entities: neither format has one, and both
        entity expansion and external entities come in this way.
    """
    if not data.strip(b" \t\r\n\xef\xbb\xbf"):
        raise FormatError("the file is empty", path=path)
    if b"<!ENTITY" in data:
        line = data[: data.index(b"<!ENTITY")].count(b"\n") + 1
        raise FormatError("entity declarations are not allowed", path=path, line=line, element="DOCTYPE")
    # A parser of its own for each call: lxml's are not meant to be shared between threads, and making one is cheap.
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise FormatError(f"not well-formed XML: {error.msg}", path=path, line=error.lineno or None) from error
    except (ValueError, LookupError) as error:  # an encoding that nobody knows
        raise FormatError(f"not readable as XML: {error}", path=path) from error
    document_type: Any = root.getroottree().docinfo.internalDTD  # the stubs know less than lxml
    if document_type is not None and any(True for _ in document_type.entities()):
        raise FormatError("entity declarations are not allowed", path=path, element="DOCTYPE")
    return root


def read_xml(path: Path) -> tuple[etree._Element, bytes]:
    """Root element and bytes of a file. The tree is shared between callers: never change it.

    Raises
    ------
    FormatError
        Missing, a folder, too large, or see `parse_xml`.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise FormatError("the file does not exist or can't be read", path=path) from error
    if not path.is_file():
        raise FormatError("not a file", path=path)
    if status.st_size > MAX_BYTES:
        raise FormatError(f"{status.st_size} bytes, at most {MAX_BYTES} are read", path=path)
    return _read_xml(str(path), status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=32)  # catalogs are named by thousands of scenarios; a changed file has another key
def _read_xml(path: str, _modified: int, _size: int) -> tuple[etree._Element, bytes]:
    data = Path(path).read_bytes()
    return parse_xml(data, path), data
