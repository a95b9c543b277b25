"""One job of a batch on the real converter: its output, its row of the manifest, its page; and the index of pages."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from urllib.parse import quote

import numpy as np

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.atomic import make_own_folder, write_atomically
from xosc_lateral.files.pages.page import Html, KeyFigure, Page, Tone
from xosc_lateral.workflows.batch.jobs import Batch, Job, fingerprint
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.convert import convert_scenario


def convert_job(job: Job) -> ManifestRow:
    """Convert and describe.

    Raises `XoscLateralError`: when the input is at fault; `OSError`: when the output can't be written.
    """
    _refuse_changes(job)
    for path in filter(None, (job.output, job.page)):
        make_own_folder(path.parent, depth=job.name.count("/"))
    conversion = convert_scenario(job.source, job.output, job.settings, variant_index=job.variant)
    _refuse_changes(job)
    if job.page is not None:
        from xosc_lateral.workflows.conversion.page import conversion_page
        from xosc_lateral.workflows.playing.figures import thumbnail

        write_atomically(job.page.with_suffix(".svg"), thumbnail(conversion.movement))  # stands for it in the index
        write_atomically(job.page, conversion_page(conversion))
    return describe(job, conversion)


def _refuse_changes(job: Job) -> None:
    """The row states the profiles and the context table that the run was planned with."""
    if fingerprint(job.settings, job.variant) != job.fingerprint:
        raise FormatError("profile or context table changed during the run; run it again", path=job.source)


def describe(job: Job, conversion: Conversion) -> ManifestRow:
    """A conversion as a row: numbers and hashes, nothing that keeps its arrays alive."""
    enriched, provenance = conversion.movement, conversion.provenance
    before, after = (None if gap is None else _rounded(gap) for gap in conversion.smallest_gap)
    inputs = {
        Path(os.path.relpath(os.path.normpath(job.source.parent / name), job.base)).as_posix(): sha256
        for name, sha256 in sorted(provenance.inputs.items())
    }
    road = next((name for name in inputs if name.lower().endswith(".xodr")), "")
    offsets = [segment.offset for entity in enriched.entities for segment in entity.segments]
    return replace(
        job.row(),
        scenario_sha256=provenance.inputs.get(job.source.name, ""),
        output_sha256=conversion.sha256,
        road=road,
        road_sha256=inputs.get(road, ""),
        inputs=inputs,
        profiles={entity: name for entity, (name, _) in sorted(provenance.profiles.items())},
        profile_sha256=dict(sorted(provenance.profiles.values())),
        entities=len(enriched.entities),
        enriched=tuple(entity.name for entity in enriched.entities if entity.is_enriched),
        why_not={entity.name: entity.why for entity in enriched.entities if not entity.is_enriched},
        segment_seconds=_rounded(sum(entity.segment_seconds for entity in enriched.entities)),
        offset_spread=_rounded(np.std(np.concatenate(offsets))) if offsets else 0.0,
        gap_before=before,
        gap_after=after,
        warnings=conversion.warnings,
        version=provenance.version,
        mode=provenance.mode,
        modes=dict(provenance.modes),
        ego=provenance.ego,
        content_sha256=provenance.content_sha256,
        cut_off=enriched.motion.cut_off is not None,
    )


def _rounded(value: float | np.floating) -> float:
    """To a micrometre or microsecond: what a manifest is read for, and no noise of another machine's last bit."""
    return round(float(value), 6)


# ---- pages -----------------------------------------------------------------------------------------------------------
INDEX = "index.html"

GAPS = ("smallest gap, nominal [m]", "smallest gap, enriched [m]")


def write_batch_index(batch: Batch, folder: Path) -> Path:
    """Write ``index.html`` over the pages of a finished batch, what needs attention first."""
    pages = {job.name: job.page for job in batch.jobs if job.page is not None}
    rows = [row for row in read_manifest(batch.folder / MANIFEST) if row.output in pages]
    links = {row.output: quote(Path(os.path.relpath(pages[row.output], folder)).as_posix())
             for row in rows if not row.error}  # fmt: skip
    return write_atomically(folder / INDEX, batch_page(rows, links, batch.folder.name))


def batch_page(rows: Sequence[ManifestRow], links: Mapping[str, str], name: str) -> str:
    """HTML index of a batch; same rows, same bytes. `links`: output -> its page; `name`: of the output folder."""
    ranked = sorted(rows, key=_urgency)
    failed, contacts = sum(bool(row.error) for row in rows), sum(map(_has_new_contact, rows))
    page = Page(f"Batch {name}")
    page.lead(
        "All outputs of the batch: failures first, then scenarios in which vehicles collide that did not before, then "
        "the others by number of warnings. The pictures show the paths from above, with the scale across the road "
        "exaggerated."
    )
    page.key_figures(
        [
            KeyFigure(len(rows) - failed, "outputs"),
            KeyFigure(failed, "failed", tone="bad" if failed else ""),
            KeyFigure(contacts, "with collisions", "that the nominal motion does not have", "bad" if contacts else ""),
            KeyFigure(sum(bool(row.warnings) for row in rows), "with warnings"),
        ]
    )
    tones: dict[int, Tone] = {k: "bad" for k, row in enumerate(ranked) if row.error or _has_new_contact(row)}
    formats = dict.fromkeys(("std. deviation of offsets [m]", *GAPS), ".2f")
    page.table([_cells(row, links.get(row.output, "")) for row in ranked], "Outputs", formats=formats, tones=tones)
    return page.html({})


def _has_new_contact(row: ManifestRow) -> bool:
    """Whether vehicles touch that nominally don't."""
    before = float("inf") if row.gap_before is None else row.gap_before
    return row.gap_after is not None and row.gap_after <= 0.0 < before


def _urgency(row: ManifestRow) -> tuple[int, int, str]:
    return 0 if row.error else 1 if _has_new_contact(row) else 2, -len(row.warnings), row.output


def _cells(row: ManifestRow, link: str) -> dict[str, object]:
    name, done, anchor = escape(row.output), not row.error, f'<a href="{escape(link)}">'
    picture = escape(f"{link.removesuffix('.html')}.svg")
    image = f'<img loading="lazy" width="200" height="64" src="{picture}" alt="Paths in {name}">'
    return {
        "paths": Html(f"{anchor}{image}</a>" if link else ""),
        "output": Html(f"{anchor}{name}</a>" if link else name),
        "enriched": f"{len(row.enriched)} of {row.entities}" if done else None,
        "std. deviation of offsets [m]": row.offset_spread if done else None,
        GAPS[0]: row.gap_before if done else None,
        GAPS[1]: row.gap_after if done else None,
        "warnings": "; ".join(row.warnings) or "none" if done else f"failed: {row.error}",
    }
