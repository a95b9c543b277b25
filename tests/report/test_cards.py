"""The library's page says which profile is for what, from the profiles alone."""

from __future__ import annotations

from msgspec.structs import replace

import xosc_lateral as xl
from xosc_lateral.report.cards import library_page


def test_the_page_of_a_library_tells_what_the_loop_found_and_has_a_card_of_each() -> None:
    plain, refined = xl.read_profile("motorway-vehicle-1"), xl.read_profile("motorway")
    loop = {"base": "two-level", "seed": 1, "found": ["slow & <heavy> vehicles keep right", "memory"]}
    provenance = replace(refined.provenance, fit={**refined.provenance.fit, "closed_loop": loop})
    page = library_page([plain, replace(refined, provenance=provenance)])
    assert "started from a two-level model and found: slow & <heavy> vehicles keep right; memory." in page
    assert [line for line in page.splitlines() if line.startswith("### ")] == [
        "### `motorway-vehicle-1`",
        "### `motorway`",
    ]
    assert page.endswith("|\n")
