"""Pictures of a page: each is a file that the page's commands write, or a figure of an HTML page that they write."""

from __future__ import annotations

import os
import re
from pathlib import Path

from xosc_lateral.files.pages.chart import PAPER
from xosc_lateral.files.pages.figure import CSS_VARIABLES, FONT

MADE = re.compile(r"!\[[^\]]+\]\((?:\.\./)*figures/made/([\w.-]+)\.svg\)")
FIGURE = re.compile(r'<div class="scroll">(<svg .*?</svg>)</div><figcaption>', flags=re.DOTALL)


def made(folder: Path, name: str) -> str:
    """The picture of that name: ``NAME.svg``, or for ``PAGE-2`` the second figure of ``PAGE.html``."""
    files = sorted(folder.rglob(f"{name}.svg"))
    if files:
        return files[0].read_text(encoding="utf-8")
    page, _, number = name.rpartition("-")
    figures = FIGURE.findall(next(folder.rglob(f"{page}.html")).read_text(encoding="utf-8"))
    svg = figures[int(number) - 1].replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    for color, variable in CSS_VARIABLES.items():
        svg = svg.replace(f"var({variable})", color)
    head, end, body = svg.replace("var(--sans)", FONT).partition(">")
    return f'{head}{end}<rect width="100%" height="100%" fill="{PAPER}"/>{body}'


def require_pictures(page: str, folder: Path, pictures: Path) -> None:
    """The page's pictures are those that its commands made in a folder; ``REMAKE_PICTURES=1`` writes them instead."""
    for name in MADE.findall(page):
        picture, shown = made(folder, name), pictures / f"{name}.svg"
        if os.environ.get("REMAKE_PICTURES"):
            shown.parent.mkdir(exist_ok=True)
            shown.write_text(picture, encoding="utf-8")
        assert shown.read_text(encoding="utf-8") == picture, f"{name}.svg: REMAKE_PICTURES=1 makes it anew"
