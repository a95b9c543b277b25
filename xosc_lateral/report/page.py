"""A report page built from top to bottom, for pages whose order follows from their result.

Every call returns the page::

    page = Page("Drive 7").lead("Two effects found.", [KeyFigure("0.21 m", "curve cutting")])
    page.section("Residual").text("What the profile misses.").figure(figure, "Mean offset by curvature", alt="...")
    text = page.provenance({"seed": 7}).html()

Pages of fixed order are templates (see `report.render`), which this shares its parts with.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from xosc_lateral.report.render import KeyFigure, Parts, Tone, inline, key_figures, render_built, table
from xosc_lateral.report.values import NOTHING, format_number

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Page:
    """A report page under construction.

    Parameters
    ----------
    title : str
        Heading and window title.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._parts = Parts()
        self._lead: list[str] = []
        self._body: list[str] = []
        self._provenance: dict[str, object] = {}

    def lead(self, text: str, figures: Sequence[KeyFigure] = ()) -> Page:
        """Summary above everything else: a sentence or two, and the numbers to take home."""
        self._lead += [f"<p>{inline(text)}</p>", key_figures(figures)]
        return self

    def section(self, title: str, text: str = "") -> Page:
        """Begin a section; it appears in the table of contents."""
        self._body.append(self._parts.section(title))
        return self.text(text) if text else self

    def subsection(self, title: str, text: str = "") -> Page:
        """Begin a part of the section."""
        self._body.append(f"<h3>{inline(title)}</h3>")
        return self.text(text) if text else self

    def text(self, text: str) -> Page:
        """One paragraph; empty lines part several."""
        self._body += [f"<p>{inline(part)}</p>" for part in re.split(r"\n\s*\n", text.strip()) if part]
        return self

    def items(self, items: Iterable[str]) -> Page:
        """Add a bullet list."""
        self._body.append(f"<ul>{''.join(f'<li>{inline(item)}</li>' for item in items)}</ul>")
        return self

    def note(self, text: str) -> Page:
        """Set a remark apart from the text."""
        self._body.append(f'<div class="aside" role="note">{inline(text)}</div>')
        return self

    def warning(self, text: str) -> Page:
        """Set apart what the reader must not miss."""
        self._body.append(f'<div class="aside warning" role="note"><strong>Warning</strong>{inline(text)}</div>')
        return self

    def figure(self, figure: Figure, caption: str, alt: str) -> Page:
        """Add a matplotlib figure, see `report.render.Parts.figure`."""
        self._body.append(self._parts.figure(figure, caption, alt))
        return self

    def table(
        self,
        rows: pd.DataFrame | Sequence[Mapping[str, object]],
        caption: str = "",
        *,
        formats: Mapping[str, str] | None = None,
        tones: Mapping[int, Tone] | None = None,
    ) -> Page:
        """Add a table, see `report.render.table`."""
        self._body.append(table(rows, caption, formats=formats, tones=tones))
        return self

    def provenance(self, facts: Mapping[str, object]) -> Page:
        """Add to the footer what is needed to make the page again: files, hashes, seed, versions."""
        self._provenance.update(facts)
        return self

    def html(self) -> str:
        """Return the whole page as one document."""
        return render_built(
            self._parts,
            title=self._title,
            provenance=self._provenance,
            lead="\n".join(self._lead),
            body="\n".join(self._body),
        )


__all__ = ["NOTHING", "KeyFigure", "Page", "Tone", "format_number"]
