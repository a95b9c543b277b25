"""The mark of an output: any text in it comes back, and who converts an output is told what to convert instead."""

from __future__ import annotations

import pytest
from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.provenance import facts_in, mark, provenance_of, refuse_converted


@pytest.mark.parametrize("text", ["-", "--", "---", "-----", "a -- b ---", "-->", "<!--", "\\u002d--"])
def test_any_text_comes_back_from_a_comment(text: str) -> None:
    root = etree.fromstring("<OpenSCENARIO><FileHeader description='d'/></OpenSCENARIO>")
    mark(root, {"name": text}, "s")
    written = etree.tostring(root)
    assert provenance_of(etree.fromstring(written)) == facts_in(written) == {"name": text}


@pytest.mark.parametrize(
    ("inputs", "hint"),
    [
        (["a.xosc", "r.xodr", "x/b.xosc"], "; convert a.xosc instead"),
        (["a.xosc", "b.xosc"], "; convert its source instead"),
        ([], "; convert its source instead"),
    ],
)
def test_the_source_is_named_where_it_is_one(inputs: list[str], hint: str) -> None:
    root = etree.fromstring("<OpenSCENARIO><FileHeader/></OpenSCENARIO>")
    mark(root, {"inputs": dict.fromkeys(inputs, "0")}, "s")
    with pytest.raises(FormatError, match=f"already{hint}"):
        refuse_converted(root, "o.xosc")
