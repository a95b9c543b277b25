"""Figures against what was to be drawn: every mark in its place, where the page's script looks for it too."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.kit.enriched import converted, made_enriched
from tests.kit.places import hand_written
from xosc_lateral.files.pages.chart import BLUE
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.workflows.playing.figures import thumbnail
from xosc_lateral.workflows.playing.scene import lane_surfaces, markings
from xosc_lateral.world.motion.nominal import Activity

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def enriched(tmp_path_factory):
    return made_enriched(tmp_path_factory.mktemp("road"))


# ---- marks in their place --------------------------------------------------------------------------------------------
def _places(panel: etree._Element, x: list[float], y: list[float]) -> np.ndarray:
    """Where values lie in a panel by what it says of itself, which is all that the page's script knows."""
    found = []
    for name, values in (("x", x), ("y", y)):
        low, high, *log = panel.get(f"data-{name}").split()
        place = np.log if log else np.asarray
        ends = place(np.array([float(low), float(high)]))
        share = (place(np.array(values)) - ends[0]) / (ends[1] - ends[0])
        found.append(share * float(panel.get("width")) if name == "x" else (1.0 - share) * float(panel.get("height")))
    return np.column_stack(found)


def _points(path: str) -> np.ndarray:
    return np.array(path.replace("M", " ").replace("L", " ").replace("Z", " ").split(), dtype=float).reshape(-1, 2)


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("limits", [None, (3.0, -2.0)])
def test_the_script_finds_every_point_where_the_svg_has_it(log, limits):
    figure = Figure(1, 2)
    x, y = [1.0, 10.0, 100.0], [0.5, 2.0, -1.0]
    for panel in figure.panels:
        panel.line(x, y, BLUE, label="shown")
        panel.dots(x, y, BLUE)
        panel.x.log, panel.y.limits = log, limits
    root = etree.fromstring(figure.svg().encode())
    panels = root.findall(f"{SVG}svg")
    assert len(panels) == 2
    for panel in panels:
        (line,) = panel.findall(f"{SVG}path")
        assert line.get("data-label") == "shown" and (" log" in panel.get("data-x")) is log
        expected = _places(panel, x, y)
        np.testing.assert_allclose(_points(line.get("d")), expected, atol=0.06)
        dots = [(float(one.get("cx")), float(one.get("cy"))) for one in panel.iter(f"{SVG}circle")]
        np.testing.assert_allclose(dots, expected, atol=0.06)


def test_numbers_stand_at_their_ticks():
    figure = Figure()
    (panel,) = figure.panels
    panel.line([0.0, 47.0], [0.0, 1.0], BLUE)
    root = etree.fromstring(figure.svg().encode())
    (inner,) = root.findall(f"{SVG}svg")
    below = float(inner.get("y")) + float(inner.get("height")) + 11.0
    numbers = [one for one in root.findall(f"{SVG}text") if abs(float(one.get("y")) - below) < 0.2]
    assert [one.text for one in numbers] == ["0", "10", "20", "30", "40"]
    at = _places(inner, [float(one.text) for one in numbers], [0.0] * 5)[:, 0] + float(inner.get("x"))
    np.testing.assert_allclose([float(one.get("x")) for one in numbers], at, atol=0.06)


@pytest.mark.parametrize(
    ("log", "limits", "expected"),
    [
        (False, (-0.6, 0.6), ["−0.5", "0.0", "0.5"]),
        (False, (0.0, 3e-6), ["0", "1e-06", "2e-06", "3e-06"]),
        (False, (5.0, 5.0 + 1e-9), None),
        (True, (1e-6, 1.0), ["10⁻⁶", "10⁻⁵", "10⁻⁴", "0.001", "0.01", "0.1", "1"]),
        (True, (0.9, 12.0), ["1", "2", "5", "10"]),
    ],
)
def test_ticks_are_round_and_read_as_what_they_are(log, limits, expected):
    figure = Figure(height=100.0)
    (panel,) = figure.panels
    panel.line([0.0, 1.0], limits, BLUE)
    panel.x.ticks, panel.y.log, panel.y.limits = [], log, limits
    texts = [one.text for one in etree.fromstring(figure.svg().encode()).findall(f"{SVG}text")]
    assert expected is None or texts == expected


def test_a_line_breaks_at_nan_and_thousands_of_points_keep_their_extremes():
    figure = Figure()
    (panel,) = figure.panels
    x = np.linspace(0.0, 1.0, 20_000)
    y = np.random.default_rng(0).normal(size=len(x))
    y[12_345], y[777:800] = 9.0, np.nan
    panel.line(x, y, BLUE)
    panel.y.limits = (-10.0, 10.0)
    text = figure.svg()
    (drawn,) = etree.fromstring(text.encode()).iterfind(f".//{SVG}svg/{SVG}path")
    assert drawn.get("d").count("M") == 2 and len(text) < 100_000
    assert _points(drawn.get("d"))[:, 1].min() == pytest.approx(150.0 * (1.0 - 19.0 / 20.0), abs=0.06)


def test_nothing_and_a_single_value_can_be_drawn():
    figure = Figure(2, 1, legend=True)
    figure.panels[0].line([], [], BLUE)
    figure.panels[1].dots(3.0, 0.0, BLUE)
    etree.fromstring(figure.svg().encode())


# ---- the thumbnail ---------------------------------------------------------------------------------------------------
def test_a_thumbnail_holds_every_path_inside_its_border_from_left_to_right(enriched):
    root = etree.fromstring(thumbnail(enriched).encode())
    (panel,) = root.findall(f"{SVG}svg")
    lines = panel.findall(f"{SVG}path")
    assert len(lines) == 3
    for line, start in zip(lines, panel.iter(f"{SVG}circle"), strict=True):
        points = _points(line.get("d"))
        assert points.min() >= 0.0
        assert (points.max(axis=0) <= [float(panel.get("width")), float(panel.get("height"))]).all()
        assert points[0, 0] == float(start.get("cx")) < points[-1, 0]
    assert thumbnail(enriched) == thumbnail(enriched)


def test_who_never_appears_is_not_drawn_and_a_scenario_of_nobody_is_empty(enriched):
    absent = [
        replace(one, motion=one.motion.having(activity=np.zeros_like(one.motion.activity))) for one in enriched.entities
    ]
    some = replace(enriched, entities=(enriched.entities[0], *absent[1:]))
    assert thumbnail(some).count("<circle") == 1
    for nobody in (tuple(absent), ()):
        assert "<circle" not in thumbnail(replace(enriched, entities=nobody))


# ---- roads -----------------------------------------------------------------------------------------------------------
def test_lanes_and_markings_of_a_straight_road_are_drawn_where_its_lanes_end():
    road = hand_written("straight")
    surfaces = [lane for lane in lane_surfaces(road, 0, 100.0, 300.0) if lane[0] == "driving"]
    edges = sorted({round(float(t[0]), 9) for _, _, *both in surfaces for t in both})
    assert edges == [-6.75, -3.5, 0.0, 3.5]
    paint = list(markings(road, 0, 100.0, 300.0))
    for s in (*(lane[1] for lane in surfaces), *(line[1] for line in paint)):
        assert s[0] == 100.0 and s[-1] == pytest.approx(300.0, abs=1e-5)
    (broken,) = (t for mark, _, t in paint if "broken" in mark.type)
    assert not np.any(broken)  # in the middle of the road


def test_lanes_are_drawn_section_by_section_and_not_beyond_them():
    """A lane has other ids, widths and neighbours in each section: no line crosses from one into the next."""
    for _, s, _, _ in lane_surfaces(hand_written("sections"), 0, 0.0, 1e9):
        cuts = [cut for cut in (100.0, 200.0, 300.0) if s[0] < cut <= s[-1]]
        assert not cuts and s[-1] <= 400.0


def test_nothing_is_drawn_of_a_road_beyond_its_ends():
    road = hand_written("straight")
    assert [*lane_surfaces(road, 0, 2000.0, 3000.0), *markings(road, 0, 2000.0, 3000.0)] == []


# ---- results as tables and text --------------------------------------------------------------------------------------
def test_rows_of_a_conversion_hold_the_world_and_the_lane_of_the_same_place(enriched):
    frame = converted(enriched).to_frame()
    assert frame["time"].is_monotonic_increasing
    assert len(frame) == sum(int(((one.motion.activity & Activity.ACTIVE) != 0).sum()) for one in enriched.entities)
    ego = frame[frame["name"] == "Ego"]
    on_straight = ego[ego["road"] == "a"]  # along x, lane -2: its middle at y = -5.25 m
    assert on_straight["y"].to_numpy() == pytest.approx(-5.25 + on_straight["offset"].to_numpy(), abs=1e-6)
    assert on_straight["y_nominal"].to_numpy() == pytest.approx(np.full(len(on_straight), -5.25), abs=1e-9)
    assert ego["deviation"].to_numpy() == pytest.approx(0.3 * np.sin(2.0 * np.pi * ego["time"] / 10.0), abs=1e-9)


def test_rows_of_one_moment_come_in_the_order_of_the_scenario(enriched):
    frame = converted(enriched).to_frame()
    assert frame[frame["time"] == 0.0]["name"].tolist() == [one.name for one in enriched.entities]


def test_facts_are_json_and_add_up_to_the_scenario(enriched):
    found = json.loads(json.dumps(converted(enriched, "mind this").to_dict(), allow_nan=False))
    assert [one["name"] for one in found["entities"]] == ["Ego", "Van", "Slow"]
    assert found["entities"][2]["why_not"] == "below 40 km/h throughout" and found["entities"][2]["segments"] == []
    (ego,) = found["entities"][0]["segments"]
    assert ego == pytest.approx([0.0, found["end_time"]])
    first, second = found["entities"][1]["segments"]  # a lane change from 12 s to 16 s between them
    assert first[1] == pytest.approx(12.0, abs=0.05) and second[0] == pytest.approx(16.0, abs=0.05)
    assert found["gap_after"] == pytest.approx(min(gap.distance for gap in enriched.gaps_after), abs=1e-6)


def test_a_conversion_says_of_every_entity_what_was_done_or_why_not(enriched):
    conversion = converted(enriched, "mind this")
    conversion.report = Path("page.html")
    lines = str(conversion).splitlines()
    assert lines[0] == "out.xosc" and lines[-1] == "report: page.html"
    assert "  Slow: as in the scenario (below 40 km/h throughout)" in lines
    assert "  warning: mind this" in lines
