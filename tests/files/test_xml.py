from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import XML_TREE
from xosc_lateral.files.xml import parse_xml, read_xml


def test_entities_are_refused_in_any_encoding() -> None:
    text = '<?xml version="1.0" encoding="{}"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'
    for encoding in ("utf-8", "utf-16", "iso-8859-1"):
        with pytest.raises(FormatError, match="entit"):
            parse_xml(text.format(encoding).encode(encoding), "f.xosc")


def test_expanding_entities_in_attributes_never_grow() -> None:
    entities = "".join(f'<!ENTITY e{n + 1} "{f"&e{n};" * 10}">' for n in range(12))
    bomb = f'<!DOCTYPE a [<!ENTITY e0 "boom">{entities}]><a b="&e12;"/>'
    for encoding in ("utf-8", "utf-16"):
        with pytest.raises(FormatError):
            parse_xml(bomb.encode(encoding), "f.xosc")


def test_a_tree_that_would_not_fit_is_refused_before_it_is_built() -> None:
    data = b"<r>" + b"<a/>" * (XML_TREE.bytes // 150 + 1) + b"</r>"
    with pytest.raises(FormatError, match=r"memory of an XML file, estimated: .* MB, at most 750 MB"):
        parse_xml(data, "f.xosc")


def test_syntax_errors_carry_the_line() -> None:
    with pytest.raises(FormatError) as refused:
        parse_xml(b"<a>\n<b>\n</a>", "f.xosc")
    assert refused.value.line == 3


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(FormatError, match="not well-formed"):
        parse_xml(b"<a>" * 100_000, "f.xosc")


def test_a_file_without_permission_is_an_input_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "f.xml"
    path.write_text("<a/>")

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(FormatError, match="permission denied"):
        read_xml(path)


def test_small_files_are_parsed_once(tmp_path: Path) -> None:
    path = tmp_path / "f.xml"
    path.write_text("<a/>")
    assert read_xml(path)[0] is read_xml(path)[0]
    path.write_text("<bb/>")
    assert read_xml(path)[0].tag == "bb"


def test_an_element_of_a_million_attributes_and_a_name_of_a_million_letters_cost_a_second() -> None:
    crowded = b"<r>" + b"<a" + b"".join(b' a%d="True"' % number for number in range(100_000)) + b"/></r>"
    with pytest.raises(FormatError, match=r"f\.xosc:1: a: attributes of an XML element: 100000, at most 1000"):
        parse_xml(crowded, "f.xosc")
    assert len(parse_xml(b"<a" + b"".join(b' a%d="1"' % number for number in range(1000)) + b"/>", "f").keys()) == 1000
    begin = time.perf_counter()
    text = str(FormatError(f"{'x' * 10**6!r} is not a number", path="/" + "p" * 120_000 + ".xosc"))
    assert time.perf_counter() - begin < 1.0
    assert len(text) < 3000 and text.endswith("is not a number")
