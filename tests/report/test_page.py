"""Report pages: escaped, self-contained, the same bytes each time."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.report.figures import BLUE, LARGEST_SVG, figure_markup, figure_style, new_figure
from xosc_lateral.report.render import NOTHING, KeyFigure, environment, format_number, inline, render_page, table

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


@figure_style()
def waves(n_points: int = 200, rasterized: bool = False):
    figure, axes = new_figure(1, 1, height=2.0)
    time = np.linspace(0.0, 10.0, n_points)
    axes[0, 0].plot(time, np.random.default_rng(1).normal(size=n_points), rasterized=rasterized)
    axes[0, 0].set_xlabel("time [s]")
    return figure


def page(lead: str = "", main: str = "<p></p>", title: str = "p", provenance=None, **values) -> str:
    """A page like those in ``pages/``, with these two parts."""
    blocks = f"{{% block lead %}}{lead}{{% endblock %}}{{% block main %}}{main}{{% endblock %}}"
    template = environment().from_string("{% extends 'frame.html' %}" + blocks)
    return render_page(template, title=title, provenance=provenance or {}, **values)


def full_page() -> str:
    return page(
        "<p>Two cars.</p>{{ key_figures(numbers) }}",
        """{{ section("Paths") }}{{ figure(waves(), "Paths", alt="two paths") }}
        {{ section("Paths") }}{{ figure(waves(), "Again", alt="same") }}
        {{ table(rows, "Per entity", tones={0: "bad"}) }}""",
        waves=waves,
        numbers=[KeyFigure(0.2134, "spread [m]", "measured 0.2 m", "good")],
        rows=[{"entity": "Ego", "spread [m]": 0.2}],
        provenance={"seed": 7, "inputs": ["a.xosc", "b.xodr"]},
    )


def test_the_same_values_give_the_same_bytes():
    assert full_page() == full_page()


def test_tags_balance_and_ids_are_unique_though_a_figure_appears_twice():
    seen = Balance(full_page())
    assert seen.open == []
    assert len(seen.ids) == len(set(seen.ids)) > 10


def test_every_reference_inside_the_page_has_its_target_and_none_leads_outside():
    html = full_page()
    ids = set(Balance(html).ids)
    targets = set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', html))
    assert {first or second for first, second in targets} <= ids
    outside = re.findall(r'(?:src|href)="(?!#|data:)[^"]*"|@import|url\((?!#|data:)', html)
    assert outside == []
    assert re.findall(r"<script[^>]*>", html) == ["<script>"]  # inline: the one that zooms figures
    assert not re.search(r"\b(fetch|XMLHttpRequest|import|WebSocket)\b\s*\(", html)


@pytest.mark.parametrize("place", ["title", "text", "label", "section", "cell", "column", "caption", "alt", "fact"])
def test_text_from_outside_is_escaped_everywhere(place):
    evil = '<img src=x onerror="a()">&'

    def said(where: str) -> str:
        return evil if where == place else "plain"

    html = page(
        "<p>{{ said('text') }} {{ said('text')|inline }}</p>{{ key_figures(numbers) }}",
        """{{ section(said("section")) }}{{ table([{said("column"): said("cell")}], said("caption")) }}
        {{ figure(waves(), said("caption"), alt=said("alt")) }}""",
        title=said("title"),
        provenance={said("fact"): said("fact")},
        said=said,
        waves=waves,
        numbers=[KeyFigure(said("label"), said("label"), said("label"))],
    )
    assert "onerror" in html
    assert "<img src=x" not in html
    assert 'onerror="' not in html


def test_code_between_backticks_is_the_only_markup():
    assert inline("run `make <x>` **now**") == "run <code>make &lt;x&gt;</code> **now**"


def test_every_page_is_made_of_the_same_frame():
    """No page brings a document, a style or a script of its own."""
    pages = [path for path in files("xosc_lateral.report").joinpath("pages").iterdir() if path.name.endswith(".html")]
    assert len(pages) > 8
    for path in pages:
        text = path.read_text(encoding="utf-8")
        assert path.name in ("frame.html", "keys.html") or text.startswith('{% extends "frame.html" %}'), path.name
    package = Path(str(files("xosc_lateral")))
    made = [path for path in package.rglob("*.py") if re.search("<!doctype|<html", path.read_text("utf-8"), re.I)]
    assert made == []


def test_numbers_are_short_and_what_is_missing_is_a_dash():
    written = [
        format_number(value)
        for value in (0.2134, 1234.5, 3.0, 0.0, -0.00012345, 1.234e-9, float("nan"), 2.5e7, float("inf"))
    ]
    assert written == ["0.213", "1234", "3", "0", "-0.000123", "1.23e-09", NOTHING, "2.50e+07", "∞"]


def test_a_data_frame_and_a_list_of_rows_give_the_same_table():
    rows = [{"entity": "Ego", "p": 1e-12, "ok": True}, {"entity": "Van", "p": 0.5, "ok": False}]
    from_rows = table(rows, formats={"p": ".1e"})
    assert from_rows == table(pd.DataFrame(rows), formats={"p": ".1e"})
    assert '<td class="number">1.0e-12</td><td>yes</td>' in from_rows


def test_an_empty_table_says_so():
    assert "Findings: none." in table([], "Findings")
    assert "Findings: none." in table(pd.DataFrame({"a": []}), "Findings")


def test_lists_and_mappings_in_the_footer_are_written_out():
    html = page(provenance={"inputs": ["a", "b"], "parameters": {"speed": 30.0, "n": None}, "nothing": []})
    assert "<dd>a, b</dd>" in html
    assert f"<dd>speed: 30, n: {NOTHING}</dd>" in html
    assert f"<dt>nothing</dt><dd>{NOTHING}</dd>" in html


def test_figures_take_their_colours_from_the_page():
    markup = figure_markup(waves(), "waves", key="f1").markup
    assert BLUE not in markup
    assert "var(--series-1)" in markup
    assert ">time [s]</text>" in markup


def test_a_figure_too_large_for_svg_becomes_a_picture():
    with figure_style():
        figure, axes = new_figure(height=2.0)
        axes[0, 0].plot(np.random.default_rng(1).normal(size=30_000), "o")  # markers are not simplified, as lines are
    markup, plot = figure_markup(figure, "noise", key="f1")
    assert plot is None
    assert markup.startswith('<img alt="noise" src="data:image/png;base64,')
    assert len(markup) < LARGEST_SVG


def test_a_figure_is_described_in_the_units_of_its_picture():
    with figure_style():
        figure, axes = new_figure(height=2.0)
        axes[0, 0].plot([1.0, 10.0, 100.0], [0.0, 1.0, 0.5], label="power")
        axes[0, 0].axvline(10.0)
        axes[0, 0].set_xscale("log")
        axes[0, 0].set_xlim(1.0, 100.0)
        axes[0, 0].set_xlabel("frequency [Hz]")
    markup, plot = figure_markup(figure, "spectrum", key="f1")
    (described,) = plot["axes"]
    assert described["x"] == [1.0, 100.0] and described["xlog"] and described["xlabel"] == "frequency [Hz]"
    assert [(line["label"], line["color"]) for line in described["lines"]] == [("power", "var(--series-1)")]
    left, top, right, bottom = described["box"]
    drawn = re.search(f'id="{described["lines"][0]["id"]}">\\s*<path d="M ([^"]+)"', markup)[1]
    places = [float(value) for value in re.findall(r"-?[0-9.]+", drawn)]
    assert places[0::2] == pytest.approx([left, 0.5 * (left + right), right], abs=0.05)
    assert top < min(places[1::2]) < max(places[1::2]) < bottom


def test_what_the_script_is_told_of_is_in_the_picture_though_panels_are_hidden():
    """A grid of panels with an empty place once stopped the script on a whole page."""
    with figure_style():
        figure, axes = new_figure(1, 3, height=2.0, sharex=True)
        axes[0, 0].set_visible(False)
        axes[0, 2].plot([0.0, 1.0], [0.0, 1.0], label="a")
    markup, plot = figure_markup(figure, "grid", key="f1")
    assert [one["id"] for one in plot["axes"]] == ["f1-a1", "f1-a2"]
    assert all(f'id="{one["id"]}"' in markup for one in plot["axes"])
    assert [one["xgroup"] for one in plot["axes"]] == [0, 0]  # places in this list


def test_figure_style_leaves_the_callers_settings_alone():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    figure_markup(waves(rasterized=True), "waves", key="f1")
    assert dict(mpl.rcParams) == before
