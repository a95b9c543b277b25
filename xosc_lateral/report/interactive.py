"""What a page's script has to know about a matplotlib figure to zoom it and to read values from it.

The script works on the SVG of the figure itself: parts of it are named here before it is drawn, and the axes are
described afterwards, in the units of the SVG (points, from the top left).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

POINTS_PER_INCH = 72.0


def name_parts(figure: Figure) -> None:
    """Give axes, lines and texts the ids by which `describe_axes` speaks of them."""
    for number, axes in enumerate(figure.axes):
        axes.set_gid(f"a{number}")
        for k, line in enumerate(axes.lines):
            line.set_gid(f"a{number}l{k}")
        for k, text in enumerate(axes.texts):
            text.set_gid(f"a{number}t{k}")


def describe_axes(figure: Figure, key: str, color: Callable[[str], str]) -> dict[str, Any]:
    """Describe a figure that has been drawn.

    Parameters
    ----------
    figure : Figure
        After `name_parts`, and after it was saved: its layout is final then.
    key : str
        Ids in the page start with it and a dash.
    color : callable
        Hex colour -> what the page calls it.

    Returns
    -------
    dict
        ``axes``: per axes its id, box (left, top, right, bottom), limits, scales, labels, lines and texts.
    """
    # axes that are not visible, such as the empty places of a grid of panels, are not in the SVG
    drawn = [(number, axes) for number, axes in enumerate(figure.axes) if axes.get_visible()]
    return {"axes": [_axes(axes, number, key, color) for number, axes in drawn]}


def _box(axes: Axes, width: float, height: float) -> list[float]:
    """Left, top, right and bottom of a panel, from the figure's upper left. [pt]"""
    place = axes.get_position()
    return [
        round(place.x0 * width, 2),
        round((1.0 - place.y1) * height, 2),
        round(place.x1 * width, 2),
        round((1.0 - place.y0) * height, 2),
    ]


def _axes(axes: Axes, number: int, key: str, color: Callable[[str], str]) -> dict[str, Any]:
    width, height = (POINTS_PER_INCH * part for part in axes.figure.get_size_inches())  # type: ignore[union-attr]
    return {
        "id": f"{key}-a{number}",
        "box": _box(axes, width, height),
        **_axis(axes, "x"),
        **_axis(axes, "y"),
        "lines": [
            {"id": f"{key}-a{number}l{k}", "label": label, "color": color(_hex(line))}
            for k, line in enumerate(axes.lines)
            if (label := _label(axes, line))
        ],
        "texts": [
            {"id": f"{key}-a{number}t{k}", "at": _anchor(text, axes, height)} for k, text in enumerate(axes.texts)
        ],
    }


def _axis(axes: Axes, name: str) -> dict[str, Any]:
    axis = axes.xaxis if name == "x" else axes.yaxis
    shared = axes.get_shared_x_axes() if name == "x" else axes.get_shared_y_axes()
    all_axes = [other for other in axes.figure.axes if other.get_visible()]
    low, high = axis.get_view_interval()
    limits = axes.get_xlim() if name == "x" else axes.get_ylim()  # may run from high to low
    values: dict[str, Any] = {
        name: [float(limits[0]), float(limits[1])],
        f"{name}log": axis.get_scale() == "log",
        f"{name}labels": any(tick.label1.get_visible() and tick.label1.get_text() for tick in axis.get_major_ticks()),
        f"{name}label": axis.get_label_text(),
        f"{name}group": min(k for k, other in enumerate(all_axes) if other is axes or shared.joined(axes, other)),
    }
    names = _names(axis, low, high)
    return values | ({f"{name}names": names} if names else {})


def _names(axis: Any, low: float, high: float) -> list[tuple[float, str]]:
    """Places and names of an axis of names instead of numbers."""
    from matplotlib.ticker import FixedFormatter, FuncFormatter

    formatter = axis.get_major_formatter()
    if not isinstance(formatter, FixedFormatter | FuncFormatter):
        return []
    places = [float(place) for place in axis.get_majorticklocs()]
    texts = formatter.format_ticks(places)
    return [(place, text) for place, text in zip(places, texts, strict=True) if low <= place <= high and text]


def _label(axes: Axes, line: Line2D) -> str:
    """Name of a line for the reader; none for lines that only help the eye."""
    label = str(line.get_label())
    if not label.startswith("_"):
        return label
    n_points = len(line.get_xdata())  # type: ignore[arg-type]
    return (axes.get_ylabel() or axes.get_title(loc="left")) if n_points > 2 else ""


def _hex(line: Line2D) -> str:
    from matplotlib.colors import to_hex

    return to_hex(line.get_color())


def _anchor(text: Any, axes: Axes, height: float) -> list[float]:
    """Where a text is tied to, in the SVG."""
    place = getattr(text, "xy", None) or text.get_position()
    x, y = axes.transData.transform(place) * POINTS_PER_INCH / axes.figure.dpi
    return [round(float(x), 2), round(height - float(y), 2)]
