"""The index of a batch: every output with its picture and numbers, what needs attention first."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.enrich.result import Enriched
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.report.figures import MUTED, PALETTE
from xosc_lateral.report.render import KeyFigure, render_page
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


@dataclass(frozen=True, slots=True)
class BatchEntry:
    """One output of a batch.

    Parameters
    ----------
    output, scenario : str
        Paths below the batch's folders.
    page, thumbnail : str
        Relative links; empty if there is none.
    enriched, entities : int
        Entities that got offsets, and all.
    segment_seconds : float
        Road-following time of the enriched entities together. [s]
    offset_spread : float
        Standard deviation of all sampled offsets. [m]
    gap_before, gap_after : float or None
        Smallest gap between vehicles, nominal and enriched. [m]
    warnings : tuple of str
    error : str
        Why there is no output; empty if there is one.
    """

    output: str
    scenario: str
    page: str
    thumbnail: str
    enriched: int
    entities: int
    segment_seconds: float
    offset_spread: float
    gap_before: float | None
    gap_after: float | None
    warnings: tuple[str, ...]
    error: str

    @property
    def has_new_contact(self) -> bool:
        """Whether vehicles touch that nominally don't."""
        before = float("inf") if self.gap_before is None else self.gap_before
        return self.gap_after is not None and self.gap_after <= 0.0 < before

    @property
    def urgency(self) -> tuple[int, int, str]:
        """Sorts failures first, then contacts, then by the number of warnings."""
        rank = 0 if self.error else 1 if self.has_new_contact else 2
        return rank, -len(self.warnings), self.output


def batch_page(entries: Iterable[BatchEntry], name: str) -> str:
    """HTML index of a batch; same entries, same bytes.

    Parameters
    ----------
    entries : iterable of BatchEntry
    name : str
        Of the output folder.
    """
    ranked = sorted(entries, key=lambda entry: entry.urgency)
    failed = sum(bool(entry.error) for entry in ranked)
    contacts = sum(entry.has_new_contact for entry in ranked)
    warned = sum(bool(entry.warnings) for entry in ranked)
    return render_page(
        "batch.html",
        title=f"Batch {name}",
        provenance={},
        entries=ranked,
        numbers=[
            KeyFigure(len(ranked) - failed, "outputs"),
            KeyFigure(failed, "failed", tone="bad" if failed else ""),
            KeyFigure(contacts, "with collisions", "that the nominal motion does not have", "bad" if contacts else ""),
            KeyFigure(warned, "with warnings"),
        ],
    )
