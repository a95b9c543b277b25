"""Pictures against the plane: where a page's script looks for a value is where the drawing has it."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.report.made_enriched import made_enriched
from tests.road.places import hand_written
from xosc_lateral.enrich.result import ConversionProvenance, ConvertedScenario
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.report.batch import BORDER, HEIGHT, WIDTH, thumbnail
from xosc_lateral.report.figures import figure_style, new_figure
from xosc_lateral.report.frames import conversion_frame
from xosc_lateral.report.interactive import describe_axes, name_parts
from xosc_lateral.report.road_drawing import edge_lines, view_along
from xosc_lateral.report.scenario import as_text, facts

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def enriched(tmp_path_factory):
    return made_enriched(tmp_path_factory.mktemp("road"))


# ---- values read off a figure ----------------------------------------------------------------------------------------
@figure_style()
def _figure(kind: str):
    figure, axes = new_figure(1, 2, height=2.5)
    for axis in axes[0]:
        axis.plot([1.0, 10.0, 100.0], [0.5, 2.0, -1.0], label="shown")
        axis.text(10.0, 2.0, "top")
        axis.set(xscale=kind, xlim=(0.5, 200.0), ylim=(3.0, -2.0), xlabel="x", ylabel="y")
    return figure


@pytest.mark.parametrize("kind", ["linear", "log"])
def test_the_script_finds_every_point_where_the_svg_has_it(kind):
    """Box and limits are all that the script knows; the path in the SVG is where the point was drawn."""
    figure = _figure(kind)
    name_parts(figure)
    file = io.BytesIO()
    figure.savefig(file, format="svg")
    described = describe_axes(figure, "f", lambda color: color)["axes"]
    root = etree.fromstring(file.getvalue())
    assert [one["id"] for one in described] == ["f-a0", "f-a1"]
    for number, axes in enumerate(described):
        (group,) = root.iterfind(f".//{SVG}g[@id='a{number}l0']")
        drawn = group.find(f"{SVG}path").get("d").replace("M", " ").replace("L", " ").split()
        points = np.array(drawn, dtype=float).reshape(-1, 2)
        left, top, right, bottom = axes["box"]
        place = np.log if axes["xlog"] else np.asarray
        low, high = place(np.array(axes["x"]))
        x = left + (place(np.array([1.0, 10.0, 100.0])) - low) / (high - low) * (right - left)
        y = bottom + (np.array([0.5, 2.0, -1.0]) - axes["y"][0]) / (axes["y"][1] - axes["y"][0]) * (top - bottom)
        np.testing.assert_allclose(points, np.column_stack([x, y]), atol=0.05)
        assert axes["texts"][0]["at"] == pytest.approx(points[1], abs=0.05)
        assert axes["lines"][0]["label"] == "shown" and axes["xlog"] is (kind == "log")


# ---- the thumbnail ---------------------------------------------------------------------------------------------------
def test_a_thumbnail_holds_every_path_inside_its_border_from_left_to_right(enriched):
    root = etree.fromstring(thumbnail(enriched).encode())
    lines = root.findall(f"{SVG}polyline")
    assert len(lines) == 3
    for line, start in zip(lines, root.findall(f"{SVG}circle"), strict=True):
        points = np.array([pair.split(",") for pair in line.get("points").split()], dtype=float)
        assert points.min() >= BORDER and (points.max(axis=0) <= [WIDTH - BORDER, HEIGHT - BORDER]).all()
        assert points[0, 0] == float(start.get("cx")) < points[-1, 0]


def test_who_never_appears_is_not_drawn_and_a_scenario_of_nobody_is_empty(enriched):
    absent = [
        replace(one, motion=replace(one.motion, activity=np.zeros_like(one.motion.activity)))
        for one in enriched.entities
    ]
    some = replace(enriched, entities=(enriched.entities[0], *absent[1:]))
    assert thumbnail(some).count("<polyline") == 1
    assert etree.fromstring(thumbnail(replace(enriched, entities=tuple(absent))).encode()).findall("*") == []


@pytest.mark.parametrize("angle", np.linspace(-3.0, 3.0, 7))
def test_a_view_shows_the_same_shape_however_the_road_lies(angle):
    """Turning the world turns the view with it: a drawing is about the road, not about north."""
    t = np.linspace(0.0, 1.0, 40)
    curve = 400.0 * t + 1j * 30.0 * t * t
    turned = curve * np.exp(1j * angle) + complex(5e5, -3e6)
    here = view_along(curve.real, curve.imag)
    there = view_along(turned.real, turned.imag)
    a, b = here.turn(curve.real, curve.imag), there.turn(turned.real, turned.imag)
    np.testing.assert_allclose(np.ptp(a[0]), np.ptp(b[0]), rtol=1e-9)
    np.testing.assert_allclose(a[0] - a[0][0], b[0] - b[0][0], atol=1e-6)
    np.testing.assert_allclose(a[1] - a[1][0], b[1] - b[1][0], atol=1e-6)


# ---- roads -----------------------------------------------------------------------------------------------------------
def test_edges_of_a_straight_road_are_drawn_where_its_lanes_end():
    lines = list(edge_lines(hand_written("straight"), 0, 100.0, 300.0))
    levels = sorted({float(t) for line in lines for t in np.round(np.broadcast_to(line.t, line.s.shape), 9)})
    assert levels == [-6.75, -3.5, 0.0, 3.5]
    for line in lines:
        assert line.s[0] == 100.0 and line.s[-1] == pytest.approx(300.0, abs=1e-5)
    dashed = [line for line in lines if "dashes" in line.style]
    assert len(dashed) == 1 and not np.any(dashed[0].t)  # the broken line in the middle of the road


def test_lanes_are_drawn_section_by_section_and_not_beyond_them():
    """A lane has other ids, widths and neighbours in each section: no line crosses from one into the next."""
    for line in edge_lines(hand_written("sections"), 0, 0.0, 1e9):
        cuts = [cut for cut in (100.0, 200.0, 300.0) if line.s[0] < cut <= line.s[-1]]
        assert not cuts and line.s[-1] <= 400.0


def test_nothing_is_drawn_of_a_road_beyond_its_ends():
    assert list(edge_lines(hand_written("straight"), 0, 2000.0, 3000.0)) == []


# ---- results as tables and text --------------------------------------------------------------------------------------
def test_rows_of_a_conversion_hold_the_world_and_the_lane_of_the_same_place(enriched):
    frame = conversion_frame(enriched)
    assert frame["time"].is_monotonic_increasing
    assert len(frame) == sum(int(((one.motion.activity & Activity.ACTIVE) != 0).sum()) for one in enriched.entities)
    ego = frame[frame["name"] == "Ego"]
    on_straight = ego[ego["road"] == "a"]  # along x, lane -2: its middle at y = -5.25 m
    assert on_straight["y"].to_numpy() == pytest.approx(-5.25 + on_straight["offset"].to_numpy(), abs=1e-6)
    assert on_straight["y_nominal"].to_numpy() == pytest.approx(np.full(len(on_straight), -5.25), abs=1e-9)
    assert ego["deviation"].to_numpy() == pytest.approx(0.3 * np.sin(2.0 * np.pi * ego["time"] / 10.0), abs=1e-9)


def test_rows_of_one_moment_come_in_the_order_of_the_scenario(enriched):
    frame = conversion_frame(enriched)
    assert frame[frame["time"] == 0.0]["name"].tolist() == [one.name for one in enriched.entities]


def _converted(enriched, **more) -> ConvertedScenario:
    options = ConvertSettings(seed=7, parameters={"speed": "30"}).record(Path())
    made = ConversionProvenance(
        "0.1", 1, "in.xosc", {"in.xosc": "a" * 64}, {"Ego": ("calm", "b" * 64)}, options, 2, "1.2", (), {}, "d" * 64
    )
    return ConvertedScenario(Path("in.xosc"), Path("out.xosc"), "c" * 64, enriched, made, ("mind this",), **more)


def test_facts_are_json_and_add_up_to_the_scenario(enriched):
    found = json.loads(json.dumps(facts(_converted(enriched)), allow_nan=False))
    assert [one["name"] for one in found["entities"]] == ["Ego", "Van", "Slow"]
    assert found["entities"][2]["why_not"] == "below 40 km/h throughout" and found["entities"][2]["segments"] == []
    (ego,) = found["entities"][0]["segments"]
    assert ego == pytest.approx([0.0, found["end_time"]])
    first, second = found["entities"][1]["segments"]  # a lane change from 12 s to 16 s between them
    assert first[1] == pytest.approx(12.0, abs=0.05) and second[0] == pytest.approx(16.0, abs=0.05)
    assert found["gap_after"] == pytest.approx(min(gap.distance for gap in enriched.gaps_after), abs=1e-6)


def test_a_conversion_says_of_every_entity_what_was_done_or_why_not(enriched):
    lines = as_text(_converted(enriched), Path("page.html")).splitlines()
    assert lines[0] == "out.xosc" and lines[-1] == "report: page.html"
    assert "  Slow: as in the scenario (below 40 km/h throughout)" in lines
    assert "  warning: mind this" in lines
