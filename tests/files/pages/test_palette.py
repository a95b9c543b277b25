"""Twelve vehicles keep distinct colours, for colour-blind readers too, in both themes."""

from __future__ import annotations

import re
from importlib.resources import files
from itertools import combinations

import numpy as np
import pytest

from xosc_lateral.files.pages.chart import PALETTE

# Machado, Oliveira, Fernandes, IEEE TVCG 15(6), 2009, table for severity 1.0 (linear RGB).
VISION = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.119192, 0.9503041]]
)


def linear(color: str) -> np.ndarray:
    value = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    xyz = TO_XYZ @ np.clip(rgb, 0.0, 1.0) / np.array([0.95047, 1.0, 1.08883])
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def ciede2000(one: np.ndarray, other: np.ndarray) -> float:
    """Colour difference, CIE 142-2001; formulas as in Sharma, Wu and Dalal, Color Res. Appl. 30(1), 2005."""
    chroma = 0.5 * (np.hypot(*one[1:]) + np.hypot(*other[1:]))
    stretch = 1.0 + 0.5 * (1.0 - np.sqrt(chroma**7 / (chroma**7 + 25.0**7)))
    (l1, a1, b1), (l2, a2, b2) = one * [1, stretch, 1], other * [1, stretch, 1]
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360.0, np.degrees(np.arctan2(b2, a2)) % 360.0
    turn = (h2 - h1 + 180.0) % 360.0 - 180.0
    dh = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(0.5 * turn))
    lm, cm, hm = 0.5 * (l1 + l2), 0.5 * (c1 + c2), (h1 + 0.5 * turn) % 360.0
    waves = ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.20, 4, -63))
    t = 1.0 + sum(size * np.cos(np.radians(n * hm + shift)) for size, n, shift in waves)
    sl = 1.0 + 0.015 * (lm - 50) ** 2 / np.sqrt(20 + (lm - 50) ** 2)
    sc, sh = 1.0 + 0.045 * cm, 1.0 + 0.015 * cm * t
    rotation = -2.0 * np.sqrt(cm**7 / (cm**7 + 25.0**7)) * np.sin(np.radians(60.0 * np.exp(-(((hm - 275) / 25) ** 2))))
    parts = (l2 - l1) / sl, (c2 - c1) / sc, dh / sh
    return float(np.sqrt(sum(part**2 for part in parts) + rotation * parts[1] * parts[2]))


def themes() -> dict[str, list[str]]:
    css = files("xosc_lateral.files.pages").joinpath("static/page.css").read_text(encoding="utf-8")
    colors = re.findall(r"--series-(\d+): (#[0-9a-f]{6})", css)
    assert [int(number) for number, _ in colors] == [*range(1, 13), *range(1, 13)]
    return {"light": [color for _, color in colors[:12]], "dark": [color for _, color in colors[12:]]}


def test_ciede2000_agrees_with_a_published_pair():
    """The first pair of the test data of Sharma, Wu and Dalal."""
    found = ciede2000(np.array([50.0, 2.6772, -79.7751]), np.array([50.0, 0.0, -82.7485]))
    assert found == pytest.approx(2.0425, abs=1e-4)


def test_the_style_sheet_has_the_palette_of_the_figures():
    assert tuple(themes()["light"]) == PALETTE


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize(("theme", "least"), [("light", 10.0), ("dark", 7.0)])
def test_all_twelve_colours_differ(theme, least, vision):
    """About 2 is just noticeable side by side; Okabe and Ito's own six colours have 10.9 at the least."""
    seen = [lab(np.asarray(VISION[vision]) @ linear(color)) for color in themes()[theme]]
    assert min(ciede2000(one, other) for one, other in combinations(seen, 2)) >= least


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("back", ["paper", "shade", "good-back", "bad-back"])
@pytest.mark.parametrize("text", ["ink", "muted", "accent", "good", "bad"])
def test_every_text_can_be_read_on_every_background(scheme, back, text):
    """WCAG 2.2, 1.4.3: 4.5 to 1, from relative luminances."""
    css = files("xosc_lateral.files.pages").joinpath("static/page.css").read_text().split("@media")
    colors = [dict(re.findall(r"--([a-z0-9-]+): (#[0-9a-f]{6})", part)) for part in css[:2]]
    theme = colors[0] | (colors[1] if scheme == "dark" else {})
    dim, bright = sorted(float(linear(theme[name]) @ TO_XYZ[1]) for name in (back, text))
    assert (bright + 0.05) / (dim + 0.05) >= 4.5
