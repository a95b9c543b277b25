"""Report pages: escaped, self-contained, the same bytes each time."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral
from xosc_lateral.files.pages.chart import BLUE
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import MISSING_TEXT, Html, KeyFigure, Page, format_number, inline

VOID = {"meta", "img", "br", "link", "input"}


class Balance(HTMLParser):
    """Collects ids, and fails on a closing tag that does not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def waves(n_points: int = 200) -> Figure:
    figure = Figure(height=100.0)
    time = np.linspace(0.0, 10.0, n_points)
    figure.panels[0].line(time, np.random.default_rng(1).normal(size=n_points), BLUE, label="wave")
    figure.panels[0].x.label = "time [s]"
    return figure


def full_page() -> str:
    page = Page("p")
    page.lead("Two cars.")
    page.key_figures([KeyFigure(0.2134, "spread [m]", "measured 0.2 m", "good")])
    page.section("Paths")
    page.figure(waves(), "Paths", "two paths")
    page.section("Paths")
    page.figure(waves(), "Again", "same")
    page.table([{"entity": "Ego", "spread [m]": 0.2}], "Per entity", tones={0: "bad"})
    return page.html({"seed": 7, "inputs": ["a.xosc", "b.xodr"]})


def test_the_same_values_give_the_same_bytes():
    assert full_page() == full_page()


def test_tags_balance_and_ids_are_unique_though_a_figure_appears_twice():
    seen = Balance(full_page())
    assert seen.open == []
    assert len(seen.ids) == len(set(seen.ids)) > 1


def test_a_folded_section_ends_where_the_next_one_begins_and_keeps_its_heading_in_sight():
    page = Page("Report")
    page.section("Open", "first")
    page.section("Folded", "second", folded=True)
    page.section("Folded, too", "third", folded=True)
    main = re.search(r"<main>(.*)</main>", page.html({}), re.S)[1].replace("\n", "")
    details = re.findall(r"<details><summary>(.*?)</summary>(.*?)</details>", main)
    assert [re.sub("<[^>]+>", "", head) for head, _ in details] == ["Folded", "Folded, too"]
    assert [body for _, body in details] == ["<p>second</p>", "<p>third</p>"]
    assert main.index("first") < main.index("<details")


def test_every_reference_inside_the_page_has_its_target_and_none_leads_outside():
    html = full_page()
    ids = set(Balance(html).ids)
    targets = set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', html))
    assert {first or second for first, second in targets} <= ids
    outside = re.findall(r'(?:src|href)="(?!#|data:)[^"]*"|@import|url\((?!#|data:)', html)
    assert outside == []
    assert re.findall(r"<script[^>]*>", html) == ["<script>"]  # inline: the one that zooms figures
    assert not re.search(r"\b(fetch|XMLHttpRequest|import|WebSocket)\b\s*\(", html)


@pytest.mark.parametrize(
    "place", ["title", "text", "warning", "label", "section", "item", "cell", "column", "caption", "alt", "fact"]
)
def test_text_from_outside_is_escaped_everywhere(place):
    evil = '<img src=x onerror="a()">&'

    def said(where: str) -> str:
        return evil if where == place else "plain"

    page = Page(said("title"))
    page.lead(said("text"))
    page.warning(said("warning"))
    page.key_figures([KeyFigure(said("label"), said("label"), said("label"))])
    page.section(said("section"), said("text"))
    page.items([said("item")])
    page.table([{said("column"): said("cell")}], said("caption"))
    page.figure(waves(), said("caption"), said("alt"))
    html = page.html({said("fact"): said("fact")})
    assert "onerror" in html
    assert "<img src=x" not in html
    assert 'onerror="' not in html


def test_names_in_a_figure_are_escaped():
    figure, evil = waves(), '"><script>a()</script>'
    panel = figure.panels[0]
    panel.title = panel.x.label = panel.y.label = evil
    panel.dots(1.0, 1.0, BLUE, label=evil)
    panel.y.ticks, figure.legend = [(0.0, evil)], True
    assert "<script" not in figure.svg()


def test_code_between_backticks_is_the_only_markup():
    assert inline("run `make <x>` **now**") == "run <code>make &lt;x&gt;</code> **now**"


def test_every_page_is_made_by_the_same_builder():
    """No module writes a document, a style or a script of its own."""
    package = Path(xosc_lateral.__file__).parent
    made = [path.name for path in package.rglob("*.py") if re.search("<!doctype|<html", path.read_text("utf-8"), re.I)]
    assert made == ["page.py"]


def test_numbers_are_short_and_what_is_missing_is_a_dash():
    written = [
        format_number(value)
        for value in (0.2134, 1234.5, 3.0, 0.0, -0.00012345, 1.234e-9, float("nan"), 2.5e7, float("inf"))
    ]
    assert written == ["0.213", "1234", "3", "0", "-0.000123", "1.23e-09", MISSING_TEXT, "2.50e+07", "∞"]


def table(rows, caption="", **more) -> str:
    page = Page("p")
    page.table(rows, caption, **more)
    return page.html({}).split("<main>")[1]


def test_cells_are_formatted_by_column_and_markup_is_left_alone():
    rows = [
        {"entity": "Ego", "p": 1e-12, "ok": True, "link": Html("<a>x</a>")},
        {"entity": "Van", "p": 0.5, "ok": False},
    ]
    made = table(rows, formats={"p": ".1e"})
    assert '<td class="number">1.0e-12</td><td>yes</td><td><a>x</a></td>' in made


def test_cells_are_set_like_numbers_when_they_are_or_when_they_are_missing():
    made = table([{"a": 1, "b": True, "c": "4", "d": np.float64(2.5)}, {"a": None, "b": None, "c": None, "d": 3}])
    assert re.findall(r"<th( class=\"number\")?>(.)", made) == [
        (' class="number"', "a"), ("", "b"), ("", "c"), (' class="number"', "d")]  # fmt: skip


def test_an_empty_table_says_so():
    assert "Findings: none." in table([], "Findings")


def test_lists_and_mappings_in_the_footer_are_written_out():
    html = Page("p").html({"inputs": ["a", "b"], "parameters": {"speed": 30.0, "n": None}, "nothing": []})
    assert "<dd>a, b</dd>" in html
    assert f"<dd>speed: 30, n: {MISSING_TEXT}</dd>" in html
    assert f"<dt>nothing</dt><dd>{MISSING_TEXT}</dd>" in html


def test_figures_take_their_colours_from_the_page():
    html = full_page()
    figure = html.split("<figure")[1].split("</figure>")[0]
    assert BLUE not in figure
    assert "var(--series-1)" in figure
    assert ">time [s]</text>" in figure
