"""Pages from Jinja2 templates: one self-contained HTML file that opens offline, in light or dark, on paper or a phone.

Prose is in ``pages/*.html``, and every number in it comes from a result. Templates are given, besides their values:

=====================================  ===================================================================
``section(title)``                     a heading that appears in the table of contents
``figure(figure, caption, alt)``       a matplotlib figure that can be zoomed; ``over_time=True`` links it to the player
``table(rows, caption, formats=...)``  a table
``key_figures(figures)``               the numbers to take home
``player(scene, label)``               the player of ``static/player.js``
``| inline``                           text from outside, in which `backticks` mark code
=====================================  ===================================================================

All text is escaped. Equal values give equal bytes.
"""

from __future__ import annotations

import json
import math
import numbers
import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from xosc_lateral.report.figures import figure_markup
from xosc_lateral.version import __version__

if TYPE_CHECKING:
    import pandas as pd
    from jinja2 import Environment, Template
    from markupsafe import Markup
    from matplotlib.figure import Figure


NOTHING = "–"
"""Shown for a value that is not there (None or NaN)."""


def format_number(value: float, digits: int = 3) -> str:
    """Format to so many significant digits: ``0.2134 -> 0.213``, ``1234.5 -> 1234``, ``1.2e-09``, NaN as a dash."""
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value == 0 or float(value).is_integer():
        return f"{value + 0.0:.0f}" if abs(value) < 1e7 else f"{value:.{digits - 1}e}"
    rounded = f"{value:.{digits - 1}e}"
    magnitude = int(rounded.partition("e")[2])  # of what is shown: 9.996 is 10.0
    if not -4 <= magnitude < 6:
        return rounded
    return f"{value:.{max(0, digits - 1 - magnitude)}f}"


def format_value(value: object, spec: str = "") -> str:
    """Format anything: numbers by the format specification or to three digits, lists and mappings written out."""
    if value is None or value == "":
        return NOTHING
    if isinstance(value, bool) or type(value).__name__ == "bool":  # numpy's bool is no subclass of bool
        return "yes" if value else "no"
    if isinstance(value, numbers.Real):
        return NOTHING if math.isnan(value) else format(value, spec) if spec else format_number(float(value))
    if isinstance(value, Mapping):
        value = [f"{name}: {format_value(part)}" for name, part in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(format_value, value)) or NOTHING
    return str(value)


def is_number(value: object) -> bool:
    """Whether a cell is set like a number; what is missing goes with either."""
    return value is None or (isinstance(value, numbers.Real) and not isinstance(value, bool))


Tone = Literal["", "good", "bad", "accent"]


class KeyFigure(NamedTuple):
    """One number that a reader takes home."""

    value: object
    """Shown large, with its unit; a number alone is formatted like in tables."""
    label: str
    note: str = ""
    """A small line below, such as what to compare the number with."""
    tone: Tone = ""


def render_page(template: str | Template, *, title: str, provenance: Mapping[str, object], **values: Any) -> str:
    """Render a page.

    Parameters
    ----------
    template : str or Template
        Name in ``pages/``, or a template of `environment`; extends ``frame.html``.
    title : str
        Heading and window title.
    provenance : mapping
        For the footer, what is needed to make the page again: files, hashes, seed, versions.
    values
        What the template speaks of.
    """
    parts = Parts()
    text = (
        environment()
        .get_template(template)
        .render(
            version=__version__,
            style=_static("page.css"),
            title=title,
            provenance=provenance,
            parts=parts,
            section=parts.section,
            figure=parts.figure,
            table=table,
            key_figures=key_figures,
            player=parts.player,
            **values,
        )
    )
    return f"{_with_policy(text)}\n"


_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def _with_policy(page: str) -> str:
    """The page with a Content-Security-Policy: its own scripts by their hashes, nothing from elsewhere."""
    scripts = (sha256(text.encode("utf-8")).digest() for text in dict.fromkeys(_SCRIPT.findall(page)))
    hashes = " ".join(f"'sha256-{b64encode(one).decode()}'" for one in scripts) or "'none'"
    policy = (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: 'self' file:; "
        "base-uri 'none'; form-action 'none'"
    )
    meta = f'<meta charset="utf-8">\n<meta http-equiv="Content-Security-Policy" content="{policy}">'
    return page.replace('<meta charset="utf-8">', meta, 1)


class Parts:
    """What a page holds so far: its headings, its figures, the scripts that it needs."""

    def __init__(self) -> None:
        self.contents: list[tuple[str, str]] = []
        self._n_figures = 0
        self._scripts: set[str] = set()

    def section(self, title: str) -> Markup:
        """Begin a section; it appears in the table of contents."""
        anchor = _anchor(title, {anchor for anchor, _ in self.contents})
        self.contents.append((anchor, title))
        return _markup(f'<h2 id="{anchor}">{inline(title)}</h2>')

    def figure(self, figure: Figure, caption: str, alt: str, *, over_time: bool = False) -> Markup:
        """Add a matplotlib figure, drawn under `report.figures.figure_style`.

        Parameters
        ----------
        figure : Figure
            Turned into SVG at once, so that the caller may drop or change it afterwards.
        caption : str
            What to see in it, shown below.
        alt : str
            The same for those who can't see it.
        over_time : bool
            Its x axis is the scenario's time: zoomed together with the others, with a cursor at the player's time.
        """
        self._n_figures += 1
        made = figure_markup(figure, alt, key=f"fig{self._n_figures}", over_time=over_time)
        plot = ""
        if made.plot is not None:
            self._scripts.add("plots.js")
            plot = f' data-plot="{escape(json.dumps(made.plot, separators=(",", ":"), ensure_ascii=False))}"'
        scroll = f'<div class="scroll">{made.markup}</div>'
        return _markup(f"<figure{plot}>{scroll}<figcaption>{inline(' '.join(caption.split()))}</figcaption></figure>")

    def player(self, scene: str, label: str) -> Markup:
        """Add the player; `scene` is the JSON of `report.player.scene`."""
        self._scripts.add("player.js")
        return _markup(
            f'<div class="player" data-scene="scene" aria-label="{escape(label)}">'
            "<noscript>The player needs JavaScript; the figures below show the same.</noscript></div>\n"
            f'<script type="application/json" id="scene">{scene}</script>'
        )

    @property
    def scripts(self) -> Markup:
        """The scripts of all parts; the player comes first, for it has the clock."""
        wanted = sorted(self._scripts)
        return _markup("".join(f"<script>\n{_static(name)}</script>\n" for name in wanted))


def key_figures(figures: Iterable[KeyFigure]) -> Markup:
    """Numbers set large, side by side; nothing if there are none."""
    boxes = "".join(map(_key_figure, figures))
    return _markup(f'<dl class="figures">{boxes}</dl>' if boxes else "")


def table(
    rows: pd.DataFrame | Sequence[Mapping[str, object]],
    caption: str = "",
    *,
    formats: Mapping[str, str] | None = None,
    tones: Mapping[int, Tone] | None = None,
) -> Markup:
    """Make a table.

    Parameters
    ----------
    rows : DataFrame or sequence of mappings
        Column headings are the names of the columns, or the keys of the first row; put units there. A data
        frame's index is not shown.
    caption : str
        Shown above the table.
    formats : mapping, optional
        Format specification by column, such as ``{"p": ".1e"}``; the others get `format_number`.
    tones : mapping, optional
        Row number, from 0, to its background: ``good``, ``bad`` or ``accent``.
    """
    records: Sequence[Mapping[str, Any]] = rows if isinstance(rows, Sequence) else _records(rows)
    if not records:
        return _markup(f"<p>{inline(f'{caption}: none.' if caption else 'None.')}</p>")
    return _markup(_table(records, list(records[0]), caption, formats or {}, tones or {}))


def inline(text: object) -> Markup:
    """Escape text; the only markup in it is `code` between backticks."""
    return _markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(str(text))))


@cache
def environment() -> Environment:
    """Jinja2's environment of all pages: templates of ``pages/``, everything escaped, unknown names refused."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("xosc_lateral.report", "pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"inline": inline, "value": format_value, "number": format_number}
    return environment


@cache
def _static(name: str) -> Markup:
    return _markup(files("xosc_lateral.report").joinpath("static", name).read_text(encoding="utf-8"))


def _markup(text: str) -> Markup:
    from markupsafe import Markup

    return Markup(text)  # every part of it was escaped


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
) -> str:
    numeric = {column for column in columns if all(is_number(row.get(column)) for row in rows)}

    def cell(tag: str, column: str, text: str) -> str:
        return f"<{tag}{_class('number' if column in numeric else '')}>{inline(text)}</{tag}>"

    def line(number: int, row: Mapping[str, Any]) -> str:
        cells = (cell("td", column, format_value(row.get(column), formats.get(column, ""))) for column in columns)
        return f"<tr{_class(tones.get(number, ''))}>{''.join(cells)}</tr>"

    head = "".join(cell("th", column, column) for column in columns)
    title = f"<caption>{inline(caption)}</caption>" if caption else ""
    body = "\n".join(line(number, row) for number, row in enumerate(rows))
    return f'<div class="table"><table>{title}<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def _class(name: str) -> str:
    return f' class="{name}"' if name else ""


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    columns = [str(column) for column in frame.columns]
    return [dict(zip(columns, row, strict=True)) for row in frame.itertuples(index=False, name=None)]


def _anchor(title: str, taken: set[str]) -> str:
    base = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
    anchor, number = base, 1
    while anchor in taken:
        number += 1
        anchor = f"{base}-{number}"
    return anchor
