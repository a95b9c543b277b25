"""One job of a batch on the real converter, and what it gave as a row of the manifest."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import numpy as np

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.workflows.batch.jobs import Batch, Job, fingerprint
from xosc_lateral.workflows.batch.manifest import MANIFEST, ManifestRow, read_manifest
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.convert import convert_scenario

INDEX = "index.html"


def write_page_and_thumbnail(conversion: Conversion, page: Path) -> None:
    """Write the page of one conversion of a batch, and the small picture that stands for it in the index."""
    from xosc_lateral.workflows.conversion.page import conversion_page
    from xosc_lateral.workflows.playing.figures import thumbnail

    page.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(page.with_suffix(".svg"), thumbnail(conversion.movement))
    write_atomically(page, conversion_page(conversion))


def write_batch_index(batch: Batch, folder: Path) -> Path:
    """Write ``index.html`` over the pages of a finished batch, what needs attention first."""
    from xosc_lateral.workflows.batch.page import BatchEntry, batch_page

    same = [name for name in BatchEntry.__slots__ if name not in ("page", "thumbnail", "enriched")]
    pages = {job.name: job.page for job in batch.jobs}
    entries = []
    for row in read_manifest(batch.folder / MANIFEST):
        if row.output in pages:
            page = None if row.error else pages[row.output]
            link = "" if page is None else quote(Path(os.path.relpath(page, folder)).as_posix())
            values = {name: getattr(row, name) for name in same}
            picture = link and f"{link.removesuffix('.html')}.svg"
            entries.append(BatchEntry(page=link, thumbnail=picture, enriched=len(row.enriched), **values))
    folder.mkdir(parents=True, exist_ok=True)
    return write_atomically(folder / INDEX, batch_page(entries, batch.folder.name))


def convert_job(job: Job) -> ManifestRow:
    """Convert and describe.

    Raises `XoscLateralError`: when the input is at fault; `OSError`: when the output can't be written.
    """
    _refuse_changes(job)
    job.output.parent.mkdir(parents=True, exist_ok=True)
    conversion = convert_scenario(job.source, job.output, job.settings, variant=job.variant)
    _refuse_changes(job)
    if job.page is not None:
        write_page_and_thumbnail(conversion, job.page)
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
