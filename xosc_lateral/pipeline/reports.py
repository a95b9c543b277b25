"""Report pages of a batch on disk: `report` makes them, here they are written."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from xosc_lateral.enrich.conversion import ConvertedScenario
from xosc_lateral.formats.atomic import write_atomically

if TYPE_CHECKING:
    from xosc_lateral.pipeline.jobs import Batch
    from xosc_lateral.pipeline.manifest import ManifestRow
    from xosc_lateral.report.batch import BatchEntry

INDEX = "index.html"


def write_page_and_thumbnail(conversion: ConvertedScenario, page: Path) -> None:
    """Write the page of one conversion of a batch, and the small picture that stands for it in the index."""
    from xosc_lateral.report.batch import thumbnail
    from xosc_lateral.report.scenario import conversion_page

    page.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(page.with_suffix(".svg"), thumbnail(conversion.enriched))
    write_atomically(page, conversion_page(conversion))


def write_batch_index(batch: Batch, folder: Path) -> Path:
    """Write ``index.html`` over the pages of a finished batch, what needs attention first.

    Returns
    -------
    Path
        Of the index.
    """
    from xosc_lateral.pipeline.manifest import MANIFEST, read_manifest
    from xosc_lateral.report.batch import batch_page

    pages = {job.name: job.page for job in batch.jobs}
    rows = (row for row in read_manifest(batch.folder / MANIFEST) if row.output in pages)
    entries = [_entry(row, pages[row.output], folder) for row in rows]
    folder.mkdir(parents=True, exist_ok=True)
    return write_atomically(folder / INDEX, batch_page(entries, batch.folder.name))


def _entry(row: ManifestRow, page: Path | None, folder: Path) -> BatchEntry:
    from xosc_lateral.report.batch import BatchEntry

    link = "" if page is None or row.error else quote(Path(os.path.relpath(page, folder)).as_posix())
    return BatchEntry(
        output=row.output,
        scenario=row.scenario,
        page=link,
        thumbnail=link and f"{link.removesuffix('.html')}.svg",
        enriched=len(row.enriched),
        entities=row.entities,
        segment_seconds=row.segment_seconds,
        offset_spread=row.offset_spread,
        gap_before=row.gap_before,
        gap_after=row.gap_after,
        warnings=row.warnings,
        error=row.error,
    )
