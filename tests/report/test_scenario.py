"""The convert report says what was done, with the numbers of the result."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.report.made_enriched import made_enriched
from xosc_lateral.enrich.result import ConversionProvenance, ConvertedScenario
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.motion.nominal import Activity, Note
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.report import scenario_figures as figures
from xosc_lateral.report.path_dynamics import lateral_dynamics
from xosc_lateral.report.scenario import conversion_page, scenario_page
from xosc_lateral.report.scenario_figures import view_along


@pytest.fixture(scope="module")
def enriched(tmp_path_factory):
    return made_enriched(tmp_path_factory.mktemp("road"))


@pytest.fixture(scope="module")
def plain(enriched) -> str:
    return page(enriched)


def page(enriched, **more) -> str:
    return scenario_page(enriched, source="cut-in.xosc", output="out.xosc", provenance={"seed": 1}, **more)


def text(html: str) -> str:
    body = re.sub(r"<script.*?</script>", " ", html.split("<body>", 1)[1], flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))


def test_the_page_holds_every_section_and_the_same_bytes_each_time(enriched, plain):
    assert plain == page(enriched)
    headings = re.findall(r"<h2[^>]*>([^<]+)", plain)
    expected = ["Player", "Paths", "Offsets", "Speed and lateral dynamics", "Gaps", "Segments", "Not played as written"]
    assert headings == expected
    assert plain.count("<figure") == 7


def test_numbers_on_the_page_are_those_of_the_result(enriched, plain):
    said = text(plain)
    assert "2 of 3 entities now move inside their lanes" in said
    assert "road-following, all entities together 56 s" in said  # 30 s and 30 s less a lane change of 4 s
    ego = enriched.entity("Ego")
    acceleration = 0.3 * (2.0 * np.pi / 10.0) ** 2
    assert f"largest added lateral acceleration {acceleration:.2f} m/s²" in said
    assert f"Ego – 1 30.0 {ego.offset_spread:.3f} 0.300" in said
    assert "Slow below 40 km/h throughout" in said
    assert "Nothing: every action and condition was played" in said


def test_what_was_not_played_is_named_with_file_and_line(tmp_path):
    note = Note("controller <acc> is played as the default driver", "/home/me/cut-in.xosc", 41, "ControllerAction")
    said = text(page(made_enriched(tmp_path, notes=(note,))))
    assert "controller &lt;acc&gt; is played as the default driver ControllerAction cut-in.xosc 41" in said


def test_a_contact_that_enriching_caused_is_marked(enriched, plain):
    pair = ("Ego", "Slow")
    before = (Gap(pair, 0.4, 3.0),)
    html = page(replace(enriched, gaps_before=before, gaps_after=(Gap(pair, 0.0, 3.1),)), warnings=["they touch"])
    assert '<tr class="bad"><td>Ego and Slow</td>' in html
    assert "they touch" in html
    assert '<tr class="bad">' not in plain


def test_strong_lateral_acceleration_is_shown_as_bad(tmp_path):
    assert '<div class="bad">' in page(made_enriched(tmp_path, amplitude=1.5))


def test_a_scenario_in_which_nothing_was_enriched_gets_a_page_that_says_so(enriched):
    alone = enriched.entity("Slow")
    said = text(page(replace(enriched, entities=(alone,), gaps_before=(), gaps_after=())))
    assert "No entity was enriched" in said
    assert "No two vehicles come that close to each other." in said


def test_provenance_is_in_the_footer(enriched):
    options = ConvertSettings(seed=7, parameters={"speed": "30"}).record(Path())
    made = ConversionProvenance(
        "0.1",
        1,
        "cut-in.xosc",
        {"cut-in.xosc": "a" * 64},
        {"Ego": ("calm", "b" * 64)},
        options,
        2,
        "1.2",
        (),
        {},
        "d" * 64,
    )
    conversion = ConvertedScenario(
        Path("in/cut-in.xosc"), Path("out/lively.xosc"), "c" * 64, enriched, made, ("mind this",)
    )
    footer = text(conversion_page(conversion).split("<footer>")[1].join(["<body>", ""]))
    for fact in ("seed 7", "variant 2", "speed = 30", f"Ego: calm ({'b' * 12})", f"cut-in.xosc ({'a' * 12})", "c" * 64):
        assert fact in footer


def test_lateral_acceleration_on_an_arc_is_speed_squared_over_radius(enriched):
    """Lane -2 lies 1.5 lanes of 3.5 m outside of the reference line's radius of 400 m."""
    motion = enriched.entity("Ego").motion
    found = lateral_dynamics(motion, motion)
    on_arc = (found.time > 17.5) & (found.time < 29.5)
    np.testing.assert_allclose(found.acceleration[on_arc], 30.0**2 / 400.0 * (1 + 5.25 / 400.0), rtol=2e-3)
    straight = (found.time > 0.5) & (found.time < 16.0)
    np.testing.assert_allclose(found.acceleration[straight], 0.0, atol=1e-6)


def test_the_enriched_path_adds_the_second_derivative_of_the_offset(enriched):
    ego = enriched.entity("Ego")
    nominal, made = lateral_dynamics(ego.motion, ego.motion), lateral_dynamics(ego.motion, ego.trajectory)
    straight = (nominal.time > 0.5) & (nominal.time < 16.0)
    added = made.acceleration[straight] - nominal.acceleration[straight]
    omega = 2.0 * np.pi / 10.0
    np.testing.assert_allclose(added, -0.3 * omega**2 * np.sin(omega * nominal.time[straight]), atol=2e-3)


def test_dynamics_are_not_read_across_a_teleport(enriched):
    motion = enriched.entity("Ego").motion
    activity = motion.activity.copy()
    activity[700] |= int(Activity.TELEPORTED)
    x = motion.x.copy()
    x[700:] += 50.0
    jumped = replace(motion, x=x, activity=activity)
    assert np.nanmax(np.abs(lateral_dynamics(jumped, jumped).acceleration)) < 3.0


def test_the_view_from_above_runs_from_left_to_right():
    angle = np.linspace(0.0, 1.0, 50)
    x, y = 100.0 - 300.0 * angle, 40.0 + 400.0 * angle  # to the upper left
    turned_x, turned_y = view_along(x, y).turn(x, y)
    assert turned_x[0] < turned_x[-1]
    np.testing.assert_allclose(np.diff(turned_y), 0.0, atol=1e-9)
    assert np.ptp(turned_x) == pytest.approx(500.0)


def test_an_entity_that_stands_still_or_is_absent_breaks_no_figure(enriched):
    motion = enriched.entity("Slow").motion
    still = replace(motion, x=np.full_like(motion.x, 5.0), y=np.zeros_like(motion.y))
    absent = replace(motion, activity=np.zeros_like(motion.activity))
    for odd in (still, absent):
        entity = replace(enriched.entity("Slow"), motion=odd)
        alone = replace(enriched, entities=(entity,), gaps_before=(), gaps_after=())
        assert figures.paths_from_above(alone) is not None
        assert "Segments" in page(alone)
