"""Pages: one self-contained HTML file that opens offline, in light or dark, on paper or a phone.

A `Page` is built from the top down: title, lead, sections with text, tables and figures, and at the end what is needed
to make it again. All text is escaped; the only markup in it is `code` between backticks. Equal values give equal bytes.
"""

from __future__ import annotations

import math
import numbers
import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from html import escape
from importlib.resources import files
from typing import Any, Literal, NamedTuple

from xosc_lateral.base.version import __version__
from xosc_lateral.files.pages.figure import Figure, svg_of

MISSING_TEXT = "–"  # Shown for a value that is not there (None or NaN).


def format_number(value: float, digits: int = 3) -> str:
    """Format to so many significant digits: ``0.2134 -> 0.213``, ``1234.5 -> 1234``, ``1.2e-09``, NaN as a dash."""
    if math.isnan(value):
        return MISSING_TEXT
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value == 0 or float(value).is_integer():
        return f"{value + 0.0:.0f}" if abs(value) < 1e7 else f"{value:.{digits - 1}e}"
    rounded = f"{value:.{digits - 1}e}"
    magnitude = int(rounded.partition("e")[2])  # of what is shown: 9.996 is 10.0
    return rounded if not -4 <= magnitude < 6 else f"{value:.{max(0, digits - 1 - magnitude)}f}"


def format_value(value: object, spec: str = "") -> str:
    """Format anything: numbers by the format specification or to three digits, lists and mappings written out."""
    if value is None or value == "":
        return MISSING_TEXT
    if isinstance(value, bool) or type(value).__name__ == "bool":  # numpy's bool is no subclass of bool
        return "yes" if value else "no"
    if isinstance(value, numbers.Real):
        return MISSING_TEXT if math.isnan(value) else format(value, spec) if spec else format_number(float(value))
    if isinstance(value, Mapping):
        value = [f"{name}: {format_value(part)}" for name, part in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(format_value, value)) or MISSING_TEXT
    return str(value)


Tone = Literal["", "good", "bad"]


class KeyFigure(NamedTuple):
    """One number that a reader takes home."""

    value: object  # Shown large, with its unit; a number alone is formatted like in tables.
    label: str
    note: str = ""  # A small line below, such as what to compare the number with.
    tone: Tone = ""


class Html(str):
    """A cell of a table that is markup already: a picture, a link."""

    __slots__ = ()


class Page:
    """A page in the making."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._lead: list[str] = []
        self._main: list[str] = []
        self._contents: list[tuple[str, str]] = []
        self._scripts: list[str] = []
        self._end = ""  # of a section that is folded

    def lead(self, *paragraphs: str) -> None:
        """Add to what stands above everything."""
        self._lead += [f"<p>{inline(text)}</p>" for text in paragraphs if text]

    def key_figures(self, figures: Iterable[KeyFigure]) -> None:
        """Set numbers large, side by side, in the lead; nothing if there are none."""
        boxes = "".join(map(_key_figure, figures))
        self._lead += [f'<dl class="figures">{boxes}</dl>'] if boxes else []

    def warning(self, text: str) -> None:
        """Add a warning to the lead."""
        self._lead.append(f'<div class="warning" role="note"><strong>Warning</strong>{inline(text)}</div>')

    def section(self, title: str, *paragraphs: str, folded: bool = False) -> None:
        """Begin a section; it appears in the table of contents. `folded`: away, until somebody asks for it."""
        anchor = f"s{len(self._contents) + 1}"
        self._contents.append((anchor, title))
        begin, end = ("<details><summary>", "</summary>") if folded else ("", "")
        self._main.append(f'{self._end}{begin}<h2 id="{anchor}">{inline(title)}</h2>{end}')
        self._end = "</details>" if folded else ""
        self.text(*paragraphs)

    def heading(self, title: str, *, anchor: str = "") -> None:
        """Begin a part of a section; `anchor`: what a link on the page leads to it by."""
        place = f' id="{anchor}"' if anchor else ""
        self._main.append(f"<h3{place}>{inline(title)}</h3>")

    def text(self, *paragraphs: str) -> None:
        """Add paragraphs."""
        self._main += [f"<p>{inline(text)}</p>" for text in paragraphs if text]

    def code(self, text: str) -> None:
        """Add a text to copy, as it is."""
        self._main.append(f"<pre>{escape(text)}</pre>")

    def items(self, lines: Iterable[str]) -> None:
        """Add a list; nothing if it is empty."""
        points = _points(lines)
        self._main += [f"<ul>{points}</ul>"] if points else []

    def group(self, number: int, what: str, members: Iterable[str], tone: Tone = "") -> None:
        """Add what so many have in common: a line that unfolds into them."""
        self._main.append(
            f'<details class="{" ".join(filter(None, ("group", tone)))}"><summary><b>{number}</b> '
            f"{inline(what)}</summary><ul>{_points(members)}</ul></details>"
        )

    def figure(self, figure: Figure, caption: str, alt: str = "", *, over_time: bool = False) -> None:
        """Add a figure with a caption; `alt`: for those who can't see it; `over_time`: x is the player's time."""
        self._need("plots.js")
        time = ' class="time"' if over_time else ""
        picture = svg_of(figure, alt or caption.replace("`", ""), themed=True)
        caption = f"<figcaption>{inline(caption)}</figcaption>"
        self._main.append(f'<figure{time}><div class="scroll">{picture}</div>{caption}</figure>')

    def table(
        self,
        rows: Sequence[Mapping[str, Any]],
        caption: str = "",
        *,
        formats: Mapping[str, str] | None = None,
        tones: Mapping[int, Tone] | None = None,
        long: bool = False,
    ) -> None:
        """Add a table, headed by the keys of the first row, or say that there are no rows.

        `formats`: format specification by column, such as ``{"p": ".1e"}``; `tones`: row number, from 0, to its
        background; `long`: it scrolls in a window of its own, can be filtered, and sorted by its headings.
        """
        if not rows:
            self._main.append(f"<p>{inline(f'{caption}: none.' if caption else 'None.')}</p>")
            return
        if long:
            self._need("tables.js")
        self._main.append(_table(rows, list(rows[0]), caption, formats or {}, tones or {}, long=long))

    def player(self, scene: str, label: str, *, anchor: str = "scene") -> None:
        """Add the player; `scene` is the JSON of `playing.scene`, `anchor` what a link on the page leads to it by."""
        self._need("player.js")
        self._main.append(
            f'<div class="player" aria-label="{escape(label)}">'
            "<noscript>The player needs JavaScript; the figures below show the same.</noscript></div>\n"
            f'<script type="application/json" id="{anchor}">{scene}</script>{PLAYER_KEYS}'
        )

    def html(self, provenance: Mapping[str, object]) -> str:
        """The page; `provenance` is shown in the footer: files, hashes, seed, versions."""
        facts = "".join(
            f"<dt>{escape(name)}</dt><dd>{inline(format_value(one))}</dd>" for name, one in provenance.items()
        )
        facts = f"<dl>{facts}</dl>" if facts else ""
        links = "".join(f'<li><a href="#{anchor}">{inline(title)}</a></li>' for anchor, title in self._contents)
        nav = f'<nav aria-label="Contents"><ol>{links}</ol></nav>' if len(self._contents) > 1 else ""
        scripts = [_static(name) for name in sorted(self._scripts)]  # the player comes first, for it has the clock
        hashes = (
            " ".join(f"'sha256-{b64encode(sha256(one.encode()).digest()).decode()}'" for one in scripts) or "'none'"
        )
        policy = (
            f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: 'self' file:; "
            "base-uri 'none'; form-action 'none'"
        )
        return "\n".join(
            [
                '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
                f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
                '<meta name="viewport" content="width=device-width, initial-scale=1">',
                f'<meta name="generator" content="xosc-lateral {__version__}">',
                f"<title>{escape(self._title)}</title>\n<style>\n{_static('page.css')}</style>\n</head>\n<body>",
                f'<div class="frame">\n<header class="lead"><h1>{inline(self._title)}</h1>',
                *self._lead,
                f"</header>\n{nav}\n<main>",
                *self._main,
                f"{self._end}</main>\n<footer>Made by xosc-lateral {__version__}.{facts}</footer>\n</div>",
                *(f"<script>{script}</script>" for script in scripts),
                "</body>\n</html>\n",
            ]
        )

    def _need(self, script: str) -> None:
        if script not in self._scripts:
            self._scripts.append(script)


PLAYER_KEYS = (
    '<details class="keys"><summary>Keys</summary><p>Space: play or pause. ← →: 0.1 s back or on, with Shift 1 s. '
    "↑ ↓: lateral stretch; 1: true proportions. &lt; &gt;: slower, faster. + −: zoom. F: follow the next vehicle. "
    "0: show everything. Home, End: start and end. In a "
    "figure over time: click to take the player to that time.</p></details>"
)


def inline(text: object) -> str:
    """Escape text; the only markup in it is `code` between backticks."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(str(text)))


def _points(lines: Iterable[str]) -> str:
    return "".join(f"<li>{line if isinstance(line, Html) else inline(line)}</li>" for line in lines)


def _key_figure(figure: KeyFigure) -> str:
    note = f'<dd class="note">{inline(figure.note)}</dd>' if figure.note else ""
    value = f"<dt>{inline(figure.label)}</dt><dd>{escape(format_value(figure.value))}</dd>"
    return f"<div{_class(figure.tone)}>{value}{note}</div>"


def _table(
    rows: Sequence[Mapping[str, Any]],
    columns: Sequence[str],
    caption: str,
    formats: Mapping[str, str],
    tones: Mapping[int, Tone],
    *,
    long: bool,
) -> str:
    numeric = {column for column in columns if all(_is_number(row.get(column)) for row in rows)}

    def cell(tag: str, column: str, value: str) -> str:
        return f"<{tag}{_class('number' if column in numeric else '')}>{value}</{tag}>"

    def shown(column: str, value: object) -> str:
        return value if isinstance(value, Html) else inline(format_value(value, formats.get(column, "")))

    def line(number: int, row: Mapping[str, Any]) -> str:
        cells = (cell("td", column, shown(column, row.get(column))) for column in columns)
        return f"<tr{_class(tones.get(number, ''))}>{''.join(cells)}</tr>"

    head = "".join(cell("th", column, inline(column)) for column in columns)
    title = f"<caption>{inline(caption)}</caption>" if caption else ""
    body = "\n".join(line(number, row) for number, row in enumerate(rows))
    kind = "table long" if long else "table"
    return f'<div class="{kind}"><table>{title}<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def _is_number(value: object) -> bool:
    """Whether a cell is set like a number; what is missing goes with either."""
    return value is None or (isinstance(value, numbers.Real) and not isinstance(value, bool))


def _class(name: str) -> str:
    return f' class="{name}"' if name else ""


@cache
def _static(name: str) -> str:
    return files("xosc_lateral.files.pages").joinpath("static", name).read_text(encoding="utf-8")
