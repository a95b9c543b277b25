"""The convert report says what was done, with the numbers of the result."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.kit.enriched import converted, made_enriched
from xosc_lateral.base.note import Note
from xosc_lateral.workflows.conversion.page import conversion_page
from xosc_lateral.workflows.playing import figures as figures
from xosc_lateral.world.motion.gaps import Gap


@pytest.fixture(scope="module")
def enriched(tmp_path_factory):
    return made_enriched(tmp_path_factory.mktemp("road"))


@pytest.fixture(scope="module")
def plain(enriched) -> str:
    return page(enriched)


def page(enriched, *warnings: str) -> str:
    return conversion_page(converted(enriched, *warnings))


def text(html: str) -> str:
    body = re.sub(r"<script.*?</script>", " ", html.split("<body>", 1)[1], flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))


def test_the_page_holds_every_section_and_the_same_bytes_each_time(enriched, plain):
    assert plain == page(enriched)
    headings = re.findall(r"<h2[^>]*>([^<]+)", plain)
    expected = ["Player", "Paths", "Offsets", "Speed and lateral dynamics", "Gaps", "Segments", "Not played as written"]
    assert headings == expected
    assert plain.count("<figure") == 4


def test_numbers_on_the_page_are_those_of_the_result(enriched, plain):
    said = text(plain)
    assert "2 of 3 entities now move inside their lanes" in said
    assert "road-following, all entities together 56 s" in said  # 30 s and 30 s less a lane change of 4 s
    ego = enriched.entity("Ego")
    acceleration = 0.3 * (2.0 * np.pi / 10.0) ** 2
    assert f"largest added lateral acceleration {acceleration:.2f} m/s²" in said
    assert f"Ego – 1 30.0 {ego.offset_spread:.3f} 0.30 " in said
    assert "Slow below 40 km/h throughout" in said
    assert "Nothing: every action and condition was played" in said


def test_what_was_not_played_is_named_with_file_and_line(tmp_path):
    note = Note("controller <acc> is played as the default driver", "/home/me/cut-in.xosc", 41, "ControllerAction")
    said = text(page(made_enriched(tmp_path, notes=(note,))))
    assert "controller &lt;acc&gt; is played as the default driver ControllerAction cut-in.xosc 41" in said


def test_a_contact_that_enriching_caused_is_marked(enriched, plain):
    pair = ("Ego", "Slow")
    before = (Gap(pair, 0.4, 3.0),)
    html = page(replace(enriched, gaps_before=before, gaps_after=(Gap(pair, 0.0, 3.1),)), "they touch")
    assert '<tr class="bad"><td>Ego and Slow</td>' in html
    assert "they touch" in html
    assert '<tr class="bad">' not in plain


def test_strong_lateral_acceleration_is_shown_as_bad(tmp_path):
    assert '<div class="bad">' in page(made_enriched(tmp_path, amplitude=1.5))


def test_a_scenario_in_which_nothing_was_enriched_gets_a_page_that_says_so(enriched):
    alone = enriched.entity("Slow")
    said = text(page(replace(enriched, entities=(alone,), gaps_before=(), gaps_after=())))
    assert "No entity was enriched" in said
    assert "No two vehicles come that close to each other there." in said


def test_provenance_is_in_the_footer(plain):
    footer = text(plain.split("<footer>")[1].join(["<body>", ""]))
    for fact in ("seed 7", "variant 2", "speed = 30", f"Ego: calm ({'b' * 12})", f"in.xosc ({'a' * 12})", "c" * 64):
        assert fact in footer


def test_an_entity_that_stands_still_or_is_absent_breaks_no_figure(enriched):
    motion = enriched.entity("Slow").motion
    still = motion.having(x=np.full_like(motion.x, 5.0), y=np.zeros_like(motion.y))
    absent = motion.having(activity=np.zeros_like(motion.activity))
    for odd in (still, absent):
        entity = replace(enriched.entity("Slow"), motion=odd)
        alone = replace(enriched, entities=(entity,), gaps_before=(), gaps_after=())
        assert (figures.paths_stretched(alone) is None) is (odd is absent)
        assert "Segments" in page(alone)
