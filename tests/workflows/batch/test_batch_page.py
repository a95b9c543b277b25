"""The index of a batch: what needs attention comes first, and nothing is said of outputs that there are none of."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from tests.workflows.batch.test_manifest import ROW
from xosc_lateral.workflows.batch.call import batch_page

CALM = replace(ROW, output="calm.xosc", gap_before=2.0, gap_after=1.9, warnings=(), error="")


@pytest.fixture
def page() -> str:
    rows = [
        CALM,
        replace(CALM, output="warned.xosc", warnings=("one", "two <b>")),
        replace(CALM, output="broken.xosc", error="broken.xosc:3: no road"),
        replace(CALM, output="touching.xosc", gap_after=0.0),
        replace(CALM, output="touching_before.xosc", gap_before=0.0, gap_after=0.0),
    ]
    return batch_page(rows, {row.output: f"{row.output}.html" for row in rows if not row.error}, "out")


def test_failures_come_first_then_contacts_then_warnings(page):
    outputs = re.findall(r"[a-z_]+\.xosc(?=<)", page)
    assert outputs[:5] == ["broken.xosc", "touching.xosc", "warned.xosc", "calm.xosc", "touching_before.xosc"]


def test_only_what_needs_attention_is_marked(page):
    assert page.count('<tr class="bad">') == 2


def test_a_failed_output_has_its_reason_and_no_link_or_picture(page):
    row = page.split("broken.xosc", 1)[1].split("</tr>")[0]
    assert "failed: broken.xosc:3: no road" in row
    assert "<img" not in page.split('<tr class="bad">')[1].split("</tr>")[0]


def test_warnings_are_escaped(page):
    assert "two &lt;b&gt;" in page
