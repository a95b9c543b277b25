"""Report pages: one self-contained HTML file that opens offline, in light or dark, on paper or on a phone.

A page is built from top to bottom; every call returns the page::

    page = Page("Drive 7").lead("Two effects found.", [KeyFigure("0.21 m", "curve cutting")])
    page.section("Residual").text("What the profile misses.").figure(figure, "Mean offset by curvature", alt="...")
    text = page.provenance({"seed": 7}).html()

All text is escaped; the only markup in it is `code` between backticks. Equal calls give equal bytes.
"""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from xosc_lateral import __version__
from xosc_lateral.report.figures import figure_markup

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Tone = Literal["", "good", "bad", "accent"]

NOTHING = "–"
"""Shown for a value that is not there (None or NaN)."""


class KeyFigure(NamedTuple):
    """One number that a reader takes home."""

    value: object
    """Shown large, with its unit; a bare number is formatted like in tables."""
    label: str
    note: str = ""
    """A small line below, such as what to compare the number with."""
    tone: Tone = ""


class Page:
    """A report page under construction.

    Parameters
    ----------
    title : str
        Heading and window title.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._lead: list[str] = []
        self._contents: list[tuple[str, str]] = []
        self._body: list[str] = []
        self._provenance: dict[str, object] = {}
        self._n_figures = 0

    def lead(self, text: str, key_figures: Sequence[KeyFigure] = ()) -> Page:
        """Summary above everything else: a sentence or two, and the numbers to take home."""
        self._lead.append(f"<p>{_inline(text)}</p>")
        if key_figures:
            self._lead.append(f'<dl class="figures">{"".join(map(_key_figure, key_figures))}</dl>')
        return self

    def section(self, title: str, text: str = "") -> Page:
        """Begin a section; it appears in the table of contents."""
        anchor = _anchor(title, {anchor for anchor, _ in self._contents})
        self._contents.append((anchor, title))
        self._body.append(f'<h2 id="{anchor}">{_inline(title)}</h2>')
        return self.text(text) if text else self

    def subsection(self, title: str, text: str = "") -> Page:
        """Begin a part of the section."""
        self._body.append(f"<h3>{_inline(title)}</h3>")
        return self.text(text) if text else self

    def text(self, text: str) -> Page:
        """One paragraph; empty lines part several."""
        self._body += [f"<p>{_inline(part)}</p>" for part in re.split(r"\n\s*\n", text.strip()) if part]
        return self

    def items(self, items: Iterable[str]) -> Page:
        """Add a bullet list."""
        self._body.append(f"<ul>{''.join(f'<li>{_inline(item)}</li>' for item in items)}</ul>")
        return self

    def note(self, text: str) -> Page:
        """Set a remark apart from the text."""
        self._body.append(f'<div class="aside" role="note">{_inline(text)}</div>')
        return self

    def warning(self, text: str) -> Page:
        """Set apart what the reader must not miss."""
        self._body.append(f'<div class="aside warning" role="note"><strong>Mind</strong>{_inline(text)}</div>')
        return self

    def figure(self, figure: Figure, caption: str, alt: str) -> Page:
        """Add a matplotlib figure, drawn under `report.figures.figure_style`.

        Parameters
        ----------
        figure : Figure
            Turned into SVG at once, so that the caller may drop or change it afterwards.
        caption : str
            What to see in it, shown below.
        alt : str
            The same for those who can't see it.
        """
        self._n_figures += 1
        markup = figure_markup(figure, alt, key=f"fig{self._n_figures}")
        self._body.append(f"<figure>{markup}<figcaption>{_inline(caption)}</figcaption></figure>")
        return self

    def table(
        self,
        rows: pd.DataFrame | Sequence[Mapping[str, object]],
        caption: str = "",
        *,
        formats: Mapping[str, str] | None = None,
        tones: Mapping[int, Tone] | None = None,
    ) -> Page:
        """Add a table.

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
            return self.text(f"{caption}: none." if caption else "None.")
        self._body.append(_table(records, list(records[0]), caption, formats or {}, tones or {}))
        return self

    def provenance(self, facts: Mapping[str, object]) -> Page:
        """Add to the footer what is needed to make the page again: files, hashes, seed, versions."""
        self._provenance.update(facts)
        return self

    def html(self) -> str:
        """Return the whole page as one document."""
        style = files("xosc_lateral.report").joinpath("page.css").read_text(encoding="utf-8")
        links = "".join(f'<li><a href="#{anchor}">{_inline(title)}</a></li>' for anchor, title in self._contents)
        contents = f'<nav aria-label="Contents"><ol>{links}</ol></nav>' if len(self._contents) > 1 else ""
        facts = "".join(f"<dt>{escape(str(k))}</dt><dd>{_inline(_value(v))}</dd>" for k, v in self._provenance.items())
        return "\n".join(
            [
                '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
                '<meta name="viewport" content="width=device-width, initial-scale=1">',
                f'<meta name="generator" content="xosc-lateral {__version__}">',
                f'<title>{escape(self._title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<div class="frame">',
                f'<header class="lead"><h1>{_inline(self._title)}</h1>{"".join(self._lead)}</header>',
                contents,
                "<main>",
                *self._body,
                "</main>",
                f"<footer>Made by xosc-lateral {__version__}.{f'<dl>{facts}</dl>' if facts else ''}</footer>",
                "</div>\n</body>\n</html>\n",
            ]
        )


def format_number(value: float, digits: int = 3) -> str:
    """Format to so many significant digits: ``0.2134 -> 0.213``, ``1234.5 -> 1234``, ``1.2e-09``, NaN as a dash."""
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value == 0 or float(value).is_integer():
        return f"{value:.0f}" if abs(value) < 1e7 else f"{value:.{digits - 1}e}"
    magnitude = math.floor(math.log10(abs(value)))
    if not -4 <= magnitude < 6:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(0, digits - 1 - magnitude)}f}"


def _value(value: object, spec: str = "") -> str:
    if value is None or value == "":
        return NOTHING
    if isinstance(value, bool) or type(value).__name__ == "bool":  # numpy's bool is no subclass of bool
        return "yes" if value else "no"
    if isinstance(value, numbers.Real):
        return NOTHING if math.isnan(value) else format(value, spec) if spec else format_number(float(value))
    if isinstance(value, Mapping):
        value = [f"{name}: {_value(part)}" for name, part in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(_value, value)) or NOTHING
    return str(value)


def _key_figure(figure: KeyFigure) -> str:
    note = f'<dd class="note">{_inline(figure.note)}</dd>' if figure.note else ""
    value = f"<dt>{_inline(figure.label)}</dt><dd>{escape(_value(figure.value))}</dd>"
    return f"<div{_class(figure.tone)}>{value}{note}</div>"


def _table(
    rows: Sequence[Mapping[str, Any]],
    columns: Sequence[str],
    caption: str,
    formats: Mapping[str, str],
    tones: Mapping[int, Tone],
) -> str:
    numeric = {column for column in columns if all(_is_number(row.get(column)) for row in rows)}

    def cell(tag: str, column: str, text: str) -> str:
        return f"<{tag}{_class('number' if column in numeric else '')}>{_inline(text)}</{tag}>"

    lines = []
    for number, row in enumerate(rows):
        cells = "".join(cell("td", column, _value(row.get(column), formats.get(column, ""))) for column in columns)
        lines.append(f"<tr{_class(tones.get(number, ''))}>{cells}</tr>")
    head = "".join(cell("th", column, column) for column in columns)
    title = f"<caption>{_inline(caption)}</caption>" if caption else ""
    body = "\n".join(lines)
    return f'<div class="table"><table>{title}<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def _class(name: str) -> str:
    return f' class="{name}"' if name else ""


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    columns = [str(column) for column in frame.columns]
    return [dict(zip(columns, row, strict=True)) for row in frame.itertuples(index=False, name=None)]


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, numbers.Real) and not isinstance(value, bool))


def _inline(text: object) -> str:
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(str(text)))


def _anchor(title: str, taken: set[str]) -> str:
    base = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
    anchor, number = base, 1
    while anchor in taken:
        number += 1
        anchor = f"{base}-{number}"
    return anchor
