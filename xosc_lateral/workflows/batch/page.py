"""The page of a batch: what went wrong, by cause, then every output in one table."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote

from xosc_lateral.base.texts import counted
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.pages.page import Html, KeyFigure, Page, Tone
from xosc_lateral.workflows.batch.jobs import Batch
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest

INDEX_PAGE = "index.html"

GAP_COLUMNS = ("smallest gap, nominal [m]", "smallest gap, enriched [m]")

_PLACE = re.compile(r"^(\S+\.\w+(:\d+)?: )+")
"""Begins a message: files, with or without a line."""
_VALUE = re.compile(r"(?<=[\s(])(?:[a-zA-Z][\w+.-]*:)?[/\\][^\s)]+|'[^']*'|\"[^\"]*\"|(?<![\w.])-?\d+(\.\d+)?")
_ANY = "…"


def write_batch_index(batch: Batch, folder: Path) -> Path:
    """Write ``index.html`` over the pages of a finished batch, what needs attention first."""
    pages = {job.name: job.page for job in batch.jobs if job.page is not None}
    rows = [row for row in read_manifest(batch.folder / MANIFEST) if row.output in pages]
    links = {row.output: quote(Path(os.path.relpath(pages[row.output], folder)).as_posix())
             for row in rows if not row.error}  # fmt: skip
    return write_atomically(folder / INDEX_PAGE, batch_page(rows, links, batch.folder.name))


def batch_page(rows: Sequence[ManifestRow], links: Mapping[str, str], name: str) -> str:
    """HTML index of a batch; same rows, same bytes. `links`: output -> its page; `name`: of the output folder."""
    failed = by_cause((row, row.error) for row in rows if row.error)
    contacts = [row for row in rows if has_new_contact(row)]
    in_trials = [row for row in rows if row.trial_contacts and not row.error and row not in contacts]
    warned = by_cause((row, warning) for row in rows if not row.error for warning in row.warnings)
    lost = sum(bool(row.error) for row in rows)
    page = Page(f"Batch {name}")
    page.lead(
        f"{lost} of {len(rows)} outputs could not be made, for {counted(len(failed), 'cause')}."
        if lost
        else f"All {len(rows)} outputs are made.",
    )
    page.key_figures(
        [
            KeyFigure(len(rows) - lost, "outputs"),
            KeyFigure(lost, "failed", tone="bad" if lost else ""),
            KeyFigure(
                len(contacts), "with new contacts", "in the nominal run, where the maneuvers alone have none"
                + (f"; {len(in_trials)} more only with an ego that drives otherwise" if in_trials else ""),
                "bad" if contacts else "",
            ),
            KeyFigure(sum(bool(row.warnings) for row in rows), "with warnings"),
        ]
    )  # fmt: skip
    if failed:
        page.section("What failed")
        for cause, some in failed:
            page.group(len(some), cause, [_linked(row, links) for row in some], "bad")
    if contacts:
        page.section("New contacts", "Vehicles touch in the nominal run, and do not with the maneuvers alone.")
        page.items(_linked(row, links) for row in contacts)
    if warned:
        page.section("Warnings")
        for cause, some in warned:
            page.group(len(some), cause, [_linked(row, links) for row in some])
    ranked = sorted(rows, key=lambda row: (not row.error, not has_new_contact(row), -len(row.warnings), row.output))
    tones: dict[int, Tone] = {k: "bad" for k, row in enumerate(ranked) if row.error or has_new_contact(row)}
    formats = dict.fromkeys(("std. deviation of offsets [m]", *GAP_COLUMNS), ".2f")
    page.section("Outputs", "Pictures show the paths from above, with the scale across the road exaggerated.")
    page.table([_cells(row, links) for row in ranked], "", formats=formats, tones=tones, long=True)
    return page.html({})


def by_cause(remarks: Iterable[tuple[ManifestRow, str]]) -> list[tuple[str, list[ManifestRow]]]:
    """Rows by what was said of them, the most frequent cause first: files, names and numbers in it count as alike."""
    causes: dict[str, tuple[set[str], dict[str, ManifestRow]]] = {}
    for row, text in remarks:
        bare = _PLACE.sub("", text)
        texts, rows = causes.setdefault(_VALUE.sub(_ANY, bare), (set(), {}))
        texts.add(bare)
        rows[row.output] = row
    named = [
        (next(iter(texts)) if len(texts) == 1 else cause, [*rows.values()]) for cause, (texts, rows) in causes.items()
    ]
    return sorted(named, key=lambda item: (-len(item[1]), item[0]))


def _linked(row: ManifestRow, links: Mapping[str, str]) -> Html:
    name, why = escape(row.output), f": {escape(row.error)}" if row.error else ""
    link = links.get(row.output)
    return Html(f'<a href="{escape(link)}">{name}</a>{why}' if link else f"{name}{why}")


def has_new_contact(row: ManifestRow) -> bool:
    """Whether vehicles touch that nominally don't."""
    before = float("inf") if row.gap_before is None else row.gap_before
    return row.gap_after is not None and row.gap_after <= 0.0 < before


def _cells(row: ManifestRow, links: Mapping[str, str]) -> dict[str, object]:
    name, done, link = escape(row.output), not row.error, links.get(row.output, "")
    anchor, picture = f'<a href="{escape(link)}">', escape(f"{link.removesuffix('.html')}.svg")
    image = f'<img loading="lazy" width="100" height="32" src="{picture}" alt="Paths in {name}">'
    status = "failed" if row.error else "new contact" if has_new_contact(row) else "made"
    return {
        "output": Html(f"{anchor}{name}</a>" if link else name),
        "status": status,
        "under test": ", ".join(row.ego) or ("nobody" if done else None),
        "enriched": f"{len(row.enriched)} of {row.entities}" if done else None,
        "std. deviation of offsets [m]": row.offset_spread if done else None,
        GAP_COLUMNS[0]: row.gap_before if done else None,
        GAP_COLUMNS[1]: row.gap_after if done else None,
        "warnings": len(row.warnings) if done else None,
        "paths": Html(f"{anchor}{image}</a>" if link else ""),
    }
