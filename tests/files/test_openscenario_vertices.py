"""Vertices become text while the document is written: set out like elements, and never all at once."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree

from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import BLOCK, TimedVertices, Vertices

SOURCE = b"<?xml version='1.0' encoding='UTF-8'?>\n<Root>\n   <A/>\n   <B/>\n</Root>\n"


@pytest.mark.parametrize("motion", [False, True])
def test_the_text_is_what_elements_would_be(motion: bool) -> None:
    rng = np.random.default_rng(1)
    n = 2 * BLOCK + 7
    columns = [rng.normal(size=n) for _ in range(9)]
    root, vertices = etree.fromstring(SOURCE), Vertices(SOURCE)
    holder = etree.Element("Holder")
    for count, number in ((n, 9 if motion else 7), (2, 7)):
        polyline = TimedVertices(
            count, lambda part, k=number, end=count: [values[:end][part] for values in columns[:k]]
        )
        vertices.add(build.sub(holder, "Polyline"), polyline)
    build.insert_indented(root, 1, holder)
    pieces = list(vertices.document(root))
    assert max(map(len, pieces)) < 600 * BLOCK  # no piece holds more than a block
    whole = b"".join(pieces)
    first, second = (list(line) for line in etree.fromstring(whole).iter("Polyline"))
    assert (len(first), len(second)) == (n, 2)
    assert float(first[-1].get("time") or 0) == pytest.approx(columns[0][-1], abs=1e-6)
    assert [child.tag for child in first[BLOCK]] == (["Position", "Motion"] if motion else ["Position"])
    again = etree.fromstring(whole)
    etree.indent(again, "   ")
    assert build.document(again) == whole


def test_many_numbers_become_the_same_text_as_one_by_one():
    digits = (6, 5, 4)
    values = np.random.default_rng(1).normal(scale=10.0, size=(200, 3)).round(2)
    values[0] = 0.0, -0.0, 100.0
    values[1] = -1e-9, 120000.0, -5.0
    expected = tuple(build.decimal(row[k], count) for row in values.tolist() for k, count in enumerate(digits))
    assert build.decimals(values, digits) == expected
    assert build.decimals(np.empty((3, 0)), ()) == ()
