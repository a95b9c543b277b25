"""Figures as pixels, by resvg and Pillow (extra `pictures`): for PNG and GIF. Same figure, same pixels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.files.pages.chart import PAPER
from xosc_lateral.files.pages.figure import TEXT_SIZE, Figure

if TYPE_CHECKING:
    from PIL.Image import Image

DPI = 108.0
"""1.5 pixels to a point of a figure."""


def rasters(figures: Iterable[Figure]) -> Iterator[Image]:
    """Pixels of each figure.

    Raises
    ------
    XoscLateralError
        Pillow or resvg is not installed.
    """
    try:
        from PIL import Image, ImageFont
        from resvg_py import svg_to_bytes
    except ImportError as error:
        raise XoscLateralError(
            "PNG and GIF need Pillow and resvg: pip install 'xosc-lateral[pictures]'; .svg does not"
        ) from error
    font = ImageFont.load_default(TEXT_SIZE)
    assert isinstance(font, ImageFont.FreeTypeFont)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "font.ttf"
        file.write_bytes(font.font_bytes)  # Pillow's own is the same everywhere; others are for letters that it lacks
        family = f"svg, text {{ font-family: {font.getname()[0]} }}"
        for svg in (figure.svg() for figure in figures):
            pixels = svg_to_bytes(
                svg_string=svg, dpi=DPI, background=PAPER, style_sheet=family, font_files=[str(file)],
                skip_system_fonts=svg.isascii(),
            )  # fmt: skip
            yield Image.open(BytesIO(pixels)).convert("RGB")
