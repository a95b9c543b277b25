"""XML from strangers: parsed without entities, document types or network, refused in one line."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.errors import FormatError

MAX_TREE_BYTES = 750_000_000
"""Largest tree in memory, estimated before it is built: reading never takes more than 1 GB. A road of 25 MB fits."""
MAX_CACHED_BYTES = 1_000_000
"""Larger files are read anew each time: catalogs are small, and 16 trees are kept."""

# Measured with libxml2 2.14 on element-only, attribute-rich and text-rich files: within 15 % of the memory taken.
_BYTES_PER_TAG, _BYTES_PER_ATTRIBUTE = 150, 250


def parse_xml(data: bytes, path: object) -> etree._Element:
    """Root element of a document.

    Raises
    ------
    FormatError
        Not XML (with line), empty, too large, or with a document type that declares entities: neither format has one,
        and both entity expansion and external entities come in this way.
    """
    if not data.strip(b" \t\r\n\xef\xbb\xbf"):
        raise FormatError("the file is empty", path=path)
    _check_size(data, path)
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
    if status.st_size > MAX_TREE_BYTES:
        raise _too_large(status.st_size, path)
    if status.st_size > MAX_CACHED_BYTES:
        return _read(path)
    return _read_cached(str(path), status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=16)  # catalogs are named by thousands of scenarios; a changed file has another key
def _read_cached(path: str, _modified: int, _size: int) -> tuple[etree._Element, bytes]:
    return _read(Path(path))


def _read(path: Path) -> tuple[etree._Element, bytes]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FormatError(f"can't be read ({error.strerror})", path=path) from error
    return parse_xml(data, path), data


def _check_size(data: bytes, path: object) -> None:
    estimate = len(data) + _BYTES_PER_TAG * data.count(b"<") + _BYTES_PER_ATTRIBUTE * data.count(b"=")
    if estimate > MAX_TREE_BYTES:
        raise _too_large(estimate, path)


def _too_large(size: int, path: object) -> FormatError:
    return FormatError(
        f"would take {size / 1e6:.0f} MB of memory, at most {MAX_TREE_BYTES / 1e6:.0f} MB are allowed", path=path
    )
