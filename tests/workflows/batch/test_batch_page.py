"""The index of a batch: what needs attention comes first, and nothing is said of outputs that there are none of."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from tests.workflows.batch.test_manifest import ROW
from xosc_lateral.workflows.batch.page import batch_page, by_cause

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
    outputs = re.findall(r"[a-z_]+\.xosc(?=<)", page.split("<tbody>")[1])
    assert outputs == ["broken.xosc", "touching.xosc", "warned.xosc", "calm.xosc", "touching_before.xosc"]


def test_only_what_needs_attention_is_marked(page):
    assert page.count('<tr class="bad">') == 2


def test_a_failed_output_has_its_reason_and_no_link_or_picture(page):
    assert "<b>1</b> no road</summary><ul><li>broken.xosc: broken.xosc:3: no road</li>" in page
    assert "<img" not in page.split('<tr class="bad">')[1].split("</tr>")[0]


def test_the_lead_and_the_tiles_count_what_is_listed(page):
    assert "1 of 5 outputs could not be made, for 1 cause." in page
    tiles = dict(re.findall(r"<dt>([^<]+)</dt><dd>(\d+)</dd>", page))
    assert tiles == {"outputs": "4", "failed": "1", "with new contacts": "1", "with warnings": "1"}
    assert page.count("<td>failed</td>") == 1 and page.count("<td>new contact</td>") == 1


def test_contacts_under_other_egos_are_counted_apart():
    page = batch_page([CALM, replace(CALM, output="tried.xosc", trial_contacts=2)], {}, "out")
    assert re.search(r"<dt>with new contacts</dt><dd>0</dd><dd[^>]*>[^<]*; 1 more only with an ego that drives", page)


def test_causes_are_alike_but_for_files_names_and_numbers():
    said = [(replace(CALM, output=f"{k}.xosc"), f"a/{k}.xosc:{k}: no entity 'X{k}' at {k}.5 s") for k in range(3)]
    said += [(CALM, "calm.xosc: the file is empty")] * 2
    said += [(replace(CALM, output=f"r{k}.xosc"), f"road 'r{k}' is gone (looked for /db/r{k}.xodr)") for k in range(4)]
    (lost, of_lost), (several, of_several), (one, of_one) = by_cause(said)
    assert (lost, len(of_lost)) == ("road … is gone (looked for …)", 4)
    assert (several, len(of_several)) == ("no entity … at … s", 3)
    assert (one, of_one) == ("the file is empty", [CALM]), "one output counts once"


def test_warnings_are_escaped(page):
    assert "two &lt;b&gt;" in page
