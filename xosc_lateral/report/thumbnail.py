"""A small picture of a scenario: its paths from above, stretched to fill it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.enrich.result import Enriched
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.report.figures import MUTED, PALETTE
from xosc_lateral.report.road_drawing import view_along

FloatArray = NDArray[np.float64]

WIDTH, HEIGHT, BORDER = 200, 64, 5
"""[pixel]"""

POINTS = 60
"""Per path."""


def thumbnail(enriched: Enriched) -> str:
    """SVG document."""
    paths = [(number, path) for number, path in enumerate(_paths(enriched)) if len(path)]
    lines = []
    if paths:
        longest = max((path for _, path in paths), key=lambda path: float(np.ptp(path, axis=0).sum()))
        view = view_along(longest[:, 0], longest[:, 1])
        turned = [(number, np.column_stack(view.turn(*path.T))) for number, path in paths]
        points = np.concatenate([path for _, path in turned])
        low, spread = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1.0)
        for number, path in turned:
            color = PALETTE[number % len(PALETTE)] if enriched.entities[number].is_enriched else MUTED
            lines += _track((path - low) / spread, color)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">'
    return "\n".join([head, *lines, "</svg>\n"])


def _track(share: FloatArray, color: str) -> list[str]:
    """A path, shape (n, 2), in shares of the picture from its lower left corner, and a dot where it starts. [-]"""
    x = BORDER + share[:, 0] * (WIDTH - 2 * BORDER)
    y = HEIGHT - BORDER - share[:, 1] * (HEIGHT - 2 * BORDER)
    track = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return [
        f'<circle cx="{x[0]:.1f}" cy="{y[0]:.1f}" r="2.5" fill="{color}"/>',
        f'<polyline points="{track}" fill="none" stroke="{color}" stroke-width="1.5"/>',
    ]


def _paths(enriched: Enriched) -> list[FloatArray]:
    paths = []
    for entity in enriched.entities:
        rows = np.flatnonzero((entity.motion.activity & Activity.ACTIVE) != 0)
        rows = rows[np.linspace(0, len(rows) - 1, min(POINTS, len(rows))).astype(int)] if len(rows) else rows
        paths.append(np.column_stack([entity.trajectory.x[rows], entity.trajectory.y[rows]]))
    return paths
