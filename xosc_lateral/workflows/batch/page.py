"""The index of a batch: every output with its picture and numbers, what needs attention first."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape

from xosc_lateral.files.pages.page import Html, KeyFigure, Page, Tone

GAPS = ("smallest gap, nominal [m]", "smallest gap, enriched [m]")


@dataclass(frozen=True, slots=True)
class BatchEntry:
    """One output of a batch."""

    output: str  # output, scenario: paths below the batch's folders
    scenario: str
    page: str  # page, thumbnail: relative links; empty if there is none
    thumbnail: str
    enriched: int  # entities that got offsets
    entities: int  # all
    segment_seconds: float  # road-following time of the enriched entities together [s]
    offset_spread: float  # standard deviation of all sampled offsets [m]
    gap_before: float | None  # smallest gap between vehicles, nominal and enriched [m]
    gap_after: float | None
    warnings: tuple[str, ...]
    error: str  # why there is no output; empty if there is one

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
    page = Page(f"Batch {name}")
    page.lead(
        "All outputs of the batch: failures first, then scenarios in which vehicles collide that did not before, then "
        "the others by number of warnings. The pictures show the paths from above, with the scale across the road "
        "exaggerated."
    )
    page.key_figures(
        [
            KeyFigure(len(ranked) - failed, "outputs"),
            KeyFigure(failed, "failed", tone="bad" if failed else ""),
            KeyFigure(contacts, "with collisions", "that the nominal motion does not have", "bad" if contacts else ""),
            KeyFigure(sum(bool(entry.warnings) for entry in ranked), "with warnings"),
        ]
    )
    tones: dict[int, Tone] = {k: "bad" for k, one in enumerate(ranked) if one.error or one.has_new_contact}
    formats = dict.fromkeys(("std. deviation of offsets [m]", *GAPS), ".2f")
    page.table([_row(entry) for entry in ranked], "Outputs", formats=formats, tones=tones)
    return page.html({})


def _row(entry: BatchEntry) -> dict[str, object]:
    link, picture = escape(entry.page), escape(entry.thumbnail)
    image = f'<img loading="lazy" width="200" height="64" src="{picture}" alt="Paths in {escape(entry.output)}">'
    name = escape(entry.output)
    done = not entry.error
    return {
        "paths": Html(f'<a href="{link}">{image}</a>' if picture else ""),
        "output": Html(f'<a href="{link}">{name}</a>' if link else name),
        "enriched": f"{entry.enriched} of {entry.entities}" if done else None,
        "std. deviation of offsets [m]": entry.offset_spread if done else None,
        GAPS[0]: entry.gap_before if done else None,
        GAPS[1]: entry.gap_after if done else None,
        "warnings": "; ".join(entry.warnings) or "none" if done else f"failed: {entry.error}",
    }
