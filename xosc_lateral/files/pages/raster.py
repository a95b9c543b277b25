"""Figures without axes as pixels, by Pillow (extra `pictures`): for PNG and GIF. Same figure, same pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.rows import true_slices
from xosc_lateral.files.pages.chart import INK, PAPER, Mark
from xosc_lateral.files.pages.figure import LEGEND_HEIGHT, TEXT_SIZE, Figure, text_width

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

PIXELS = 1.5
"""To a point. [-]"""
FINE = 2
"""Times as large as it is shown a picture is drawn, so that edges become smooth. [-]"""
EDGE = 4.0
"""Free space around the panel. [pt]"""


def raster(figure: Figure) -> Image:
    """Pixels of a figure of one panel without axes.

    Raises
    ------
    XoscLateralError
        Pillow is not installed.
    """
    try:
        from PIL import Image, ImageDraw
    except ImportError as error:
        raise XoscLateralError(
            "PNG and GIF need Pillow: pip install 'xosc-lateral[pictures]'; .svg does not"
        ) from error
    figure.settle()
    (panel,) = figure.panels
    scale = PIXELS * FINE
    rows = _legend_rows(figure)
    top = EDGE + LEGEND_HEIGHT * (max((row for *_, row in rows), default=-1) + 1)
    width, height = figure.width - 2.0 * EDGE, figure.height
    size = round(figure.width * scale), round((top + height + EDGE) * scale)
    image = Image.new("RGB", size, PAPER)
    inner = Image.new("RGB", (round(width * scale), round(height * scale)), PAPER)
    draw = ImageDraw.Draw(inner)
    for mark in panel.marks:
        x, y = inner.width * panel.x.share(mark.x), inner.height * (1.0 - panel.y.share(mark.y))
        _draw(draw, mark, np.column_stack([x, y]), scale)
    image.paste(inner, (round(EDGE * scale), round(top * scale)))
    _draw_legend(ImageDraw.Draw(image), rows, scale)
    return image.resize((size[0] // FINE, size[1] // FINE), Image.Resampling.LANCZOS)


def _draw(draw: ImageDraw, mark: Mark, places: FloatArray, scale: float) -> None:
    if mark.kind == "area":
        draw.polygon([*map(tuple, places.tolist())], fill=mark.color)
        return
    for part in true_slices(np.asarray(np.isfinite(places).all(axis=1))):
        points = places[part]
        if mark.kind == "dots":
            for x, y in points.tolist():
                draw.circle((x, y), 0.5 * mark.width * scale, fill=mark.color)
        elif len(points) > 1:
            stroke = max(1, round(mark.width * scale))
            for piece in _dashed(points, [scale * float(one) for one in mark.dashes.split()]):
                draw.line([*map(tuple, piece.tolist())], fill=mark.color, width=stroke, joint="curve")


def _dashed(points: FloatArray, lengths: list[float]) -> list[FloatArray]:
    """Strokes of a line; `lengths`: of a stroke and of a gap. [px]"""
    if not lengths:
        return [points]
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    strokes = []
    for start in np.arange(0.0, way[-1], sum(lengths)).tolist():
        end = min(start + lengths[0], way[-1])
        at = np.r_[start, way[(way > start) & (way < end)], end]
        strokes.append(np.column_stack([np.interp(at, way, points[:, 0]), np.interp(at, way, points[:, 1])]))
    return strokes


def _legend_rows(figure: Figure) -> list[tuple[Mark, str, float, int]]:
    """Key, label, place [pt] and row of each line of the legend, as `figure` lays them out."""
    if not figure.legend:
        return []
    keys = {mark.label: mark for panel in figure.panels for mark in panel.marks if mark.label}
    placed, x, row = list[tuple[Mark, str, float, int]](), EDGE, 0
    for label, mark in keys.items():
        needed = text_width(label) + 34.0
        if x + needed > figure.width and x > EDGE:
            x, row = EDGE, row + 1
        placed.append((mark, label, x, row))
        x += needed
    return placed


def _draw_legend(draw: ImageDraw, rows: list[tuple[Mark, str, float, int]], scale: float) -> None:
    from PIL import ImageFont

    font = ImageFont.load_default(TEXT_SIZE * scale)
    for mark, label, x, row in rows:
        y = EDGE + LEGEND_HEIGHT * (row + 0.5)
        if mark.kind == "area":
            draw.rectangle((x * scale, (y - 4.0) * scale, (x + 16.0) * scale, (y + 4.0) * scale), fill=mark.color)
        else:
            _draw(draw, mark, scale * np.array([[x, y], [x + 16.0, y]]), scale)
        draw.text(((x + 20.0) * scale, y * scale), label, fill=INK, font=font, anchor="lm")
