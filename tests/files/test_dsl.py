"""A file of the other OpenSCENARIO."""

from __future__ import annotations

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.xml import parse_xml


@pytest.mark.parametrize("text", ["import osc.standard\n", "# a comment\n\nscenario top:\n    car: vehicle\n"])
def test_a_dsl_file_is_called_by_its_name(text: str) -> None:
    with pytest.raises(FormatError, match="OpenSCENARIO DSL"):
        parse_xml(text.encode(), "a.osc")


def test_broken_xml_is_still_broken_xml() -> None:
    with pytest.raises(FormatError, match="not well-formed"):
        parse_xml(b"<a>", "a.xosc")
