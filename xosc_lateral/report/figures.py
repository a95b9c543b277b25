"""How figures look in every report: palette and matplotlib style, and figures into SVG with the same bytes each time.

Colours here are for the light theme. `figure_markup` replaces them by CSS variables of `page.css`, so that a figure
follows the reader's light or dark theme; any other colour stays as it is.
"""

from __future__ import annotations

import base64
import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from xosc_lateral.report.interactive import describe_axes, name_parts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito, "Color universal design" (2008), and six more. Each of these was chosen as the colour farthest from all
# before it (CIEDE2000, the smallest over normal vision and the three kinds of colour blindness as simulated by Machado,
# Oliveira and Fernandes, IEEE TVCG 15(6), 2009). `tests/report/test_palette.py` measures all twelve, in both themes.
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"
PALETTE = (
    *(BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY),
    *("#781e4b", "#a50000", "#2d1ec3", "#5a694b", "#846078", "#b4b4a8"),
)
INK, MUTED, GRID, SHADE, PAPER = "#1b2126", "#6a737b", "#dde1e4", "#eef1f3", "#ffffff"

# The same thing has the same colour in every report.
MEASURED, SAMPLED = BLUE, VERMILLION
BEFORE, AFTER = MUTED, BLUE
NOMINAL, ENRICHED = MUTED, BLUE

CSS_VARIABLES = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    SHADE: "--shade",
    PAPER: "--paper",
    **{color: f"--series-{number}" for number, color in enumerate(PALETTE, start=1)},
}

FULL_WIDTH = 9.2
"""Width of a figure that fills the text column. [inch]"""

LARGEST_SVG = 1_500_000
"""A figure beyond this is embedded as a picture: browsers get slow on larger SVG. [byte]"""

LONGEST_NAME = 40
"""Longer names are cut in figures, which they would leave no room for; the page's tables have them whole."""

_RASTER_DPI = 160
_STYLE: dict[Any, Any] = {
    "figure.facecolor": "none",
    "figure.constrained_layout.use": True,
    "savefig.facecolor": "none",
    "font.family": "sans-serif",
    "font.size": 10.0,
    "text.color": INK,
    "axes.facecolor": "none",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.labelsize": 10.0,
    "axes.titlecolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "lines.linewidth": 1.5,
    "legend.facecolor": PAPER,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.8,
    "legend.fontsize": 9.0,
    "path.simplify_threshold": 0.2,
    "svg.fonttype": "none",  # text stays text: searchable, read aloud, a tenth of the size
}


def label_of(name: str) -> str:
    """An entity's name as figures have it."""
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


@contextmanager
def figure_style() -> Iterator[None]:
    """Matplotlib's settings while a figure is drawn: ``with figure_style():``, or the decorator ``@figure_style()``."""
    import matplotlib as mpl
    from cycler import cycler

    with mpl.rc_context({**_STYLE, "axes.prop_cycle": cycler(color=PALETTE)}):
        yield


def new_figure(
    rows: int = 1, columns: int = 1, *, height: float = 3.0, width: float = FULL_WIDTH, **options: Any
) -> tuple[Figure, Any]:
    """Figure and array of axes, shape (rows, columns), in the reports' style; no pyplot, so nothing stays in memory.

    Parameters
    ----------
    rows, columns : int
        Grid of axes.
    height, width : float
        Size of the whole figure. [inch]
    options
        Passed to `matplotlib.figure.Figure.subplots`, such as ``sharex=True``.
    """
    from matplotlib.figure import Figure

    with figure_style():
        figure = Figure(figsize=(width, height))
        axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, axes


def new_panels(
    rows: int,
    columns: int = 1,
    *,
    panel_height: float = 0.75,
    between: float = 0.36,
    width: float = FULL_WIDTH,
    **options: Any,
) -> tuple[Figure, Any]:
    """Like `new_figure` for many panels with titles above one another: laid out by hand, four times as fast.

    Parameters
    ----------
    panel_height : float
        Of one panel without its title. [inch]
    between : float
        Height for the title, and for tick labels where the panels don't share them. [inch]
    """
    from matplotlib.figure import Figure

    left, right, below, above, beside = 0.75, 0.12, 0.5, 0.3, 0.55  # [inch]
    height = above + rows * panel_height + (rows - 1) * between + below
    panel_width = (width - left - right - (columns - 1) * beside) / columns
    with figure_style():
        figure = Figure(figsize=(width, height))
        figure.set_layout_engine("none")
        grid = {
            "left": left / width,
            "right": 1.0 - right / width,
            "bottom": below / height,
            "top": 1.0 - above / height,
            "hspace": between / panel_height,
            "wspace": beside / panel_width,
        }
        axes = figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid, **options)
    return figure, axes


class FigureMarkup(NamedTuple):
    """A figure for a page."""

    markup: str
    """An inline ``<svg>``, or a PNG in an ``<img>`` where the SVG would be larger than `LARGEST_SVG`."""
    plot: dict[str, Any] | None
    """What ``static/plots.js`` has to know to zoom it and to read values from it; None for a PNG."""


def figure_markup(figure: Figure, alt: str, *, key: str, over_time: bool = False) -> FigureMarkup:
    """Turn a figure into markup.

    Parameters
    ----------
    figure : Figure
        Drawn under `figure_style`.
    alt : str
        What the figure shows, for those who can't see it.
    key : str
        Unique in the page; element ids start with it.
    over_time : bool
        Every x axis is the scenario's time: zoomed together with the others, with a cursor at the player's time.
    """
    name_parts(figure)
    svg = _svg(figure, key)
    if len(svg) > LARGEST_SVG:
        return FigureMarkup(_picture(figure, alt), None)
    return FigureMarkup(_inline(svg, alt, key), describe_axes(figure, key, _variable) | {"time": over_time})


def _variable(color: str) -> str:
    """A colour as the page's variable, where there is one."""
    return f"var({CSS_VARIABLES[color]})" if color in CSS_VARIABLES else color


def _svg(figure: Figure, key: str) -> str:
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    # Ids in the SVG are salted hashes and its metadata hold the date: both are fixed, for the same bytes each time.
    with mpl.rc_context({**_STYLE, "svg.hashsalt": key}), _names_as_they_are(figure):
        figure.set_dpi(_RASTER_DPI)  # of what is a picture in it
        # `savefig` would draw everything twice, the first time for nothing but the layout, which drawing does itself.
        canvas = FigureCanvasSVG(figure)
        canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    return buffer.getvalue()


@contextmanager
def _names_as_they_are(figure: Figure) -> Iterator[None]:
    """Names of entities and columns are text: a ``$`` in them begins no formula, and any script may be used.

    Only what matplotlib itself writes as a formula, powers of ten at logarithmic axes, is one.
    """
    from matplotlib.text import Text

    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            axis.get_ticklabels(which="both")  # gives the labels their text
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if text.get_text() and not text.get_text().startswith("$\\mathdefault"):
            text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # the browser has fonts for it, and the size is a guess
        yield


def _inline(svg: str, alt: str, key: str) -> str:
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{key}-", svg)
    svg = re.sub(r'\b(d|points)="([^"]*)"', lambda m: f'{m[1]}="{_rounded(m[2])}"', svg)
    svg = re.sub(r"#[0-9a-f]{6}\b", lambda m: f"var({CSS_VARIABLES[m[0]]})" if m[0] in CSS_VARIABLES else m[0], svg)
    svg = re.sub(r"font: ([^;]*?)(\d+(?:\.\d+)?)px [^;\"]*", r"font: \1\2px var(--sans)", svg)
    head = re.search(r'viewBox="[^"]*"', svg)
    assert head is not None, "matplotlib writes a viewBox"
    body = svg[svg.index(">") + 1 :].strip()
    return (
        f'<svg {head[0]} xmlns:xlink="http://www.w3.org/1999/xlink" role="img" aria-label="{escape(alt)}">'
        f"<title>{escape(alt)}</title>{body}"
    )


def _rounded(path: str) -> str:
    """Coordinates to a hundredth of a point, well below what a screen can show."""
    return re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}".rstrip("0").rstrip("."), " ".join(path.split()))


def _picture(figure: Figure, alt: str) -> str:
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context(_STYLE), _names_as_they_are(figure):
        figure.savefig(buffer, format="png", dpi=_RASTER_DPI, facecolor=PAPER, metadata={"Software": None})
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'<img alt="{escape(alt)}" src="data:image/png;base64,{data}">'
