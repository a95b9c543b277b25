"""A conversion as text, JSON and HTML."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xosc_lateral.formats.atomic import write_atomically

if TYPE_CHECKING:
    from xosc_lateral.pipeline.convert import Conversion


def as_text(conversion: Conversion, report: Path | None = None) -> str:
    """What was done, what was not, what to know."""
    lines = [f"{conversion.output}"]
    for entity in conversion.enriched.entities:
        if entity.is_enriched and entity.profile is not None:
            lines.append(
                f"  {entity.name}: {len(entity.segments)} segments, {entity.segment_seconds:.1f} s, "
                f"offsets {entity.offset_spread:.2f} m (standard deviation), profile {entity.profile.name}"
            )
        else:
            lines.append(f"  {entity.name}: as in the scenario ({entity.why})")
    lines += [f"  note: {note.what}" for note in conversion.enriched.motion.notes]
    lines += [f"  warning: {warning}" for warning in conversion.warnings]
    if report is not None:
        lines.append(f"report: {report}")
    return "\n".join(lines)


def to_json(conversion: Conversion, report: Path | None = None) -> str:
    """The same as one JSON object on one line."""
    return json.dumps(facts(conversion) | ({"report": str(report)} if report is not None else {}))


def facts(conversion: Conversion) -> dict[str, Any]:
    """Plain values about a conversion."""
    enriched = conversion.enriched
    return {
        "source": str(conversion.source),
        "output": str(conversion.output),
        "sha256": conversion.output_hash,
        "end_time": enriched.motion.end_time,
        "ended_by": enriched.motion.ended_by,
        "entities": [
            {
                "name": entity.name,
                "profile": entity.profile.name if entity.is_enriched and entity.profile is not None else None,
                "why_not": entity.why,
                "segments": [[segment.stretch.start, segment.stretch.end] for segment in entity.segments],
                "offset_spread": entity.offset_spread,
                "neutral_context": list(entity.neutral),
            }
            for entity in enriched.entities
        ],
        "smallest_gap_before": min((gap.distance for gap in enriched.gaps_before), default=None),
        "smallest_gap_after": min((gap.distance for gap in enriched.gaps_after), default=None),
        "notes": [asdict(note) for note in enriched.motion.notes],
        "warnings": list(conversion.warnings),
        "provenance": asdict(conversion.provenance),
    }


def write_report(conversion: Conversion, path: Path, *, variants: int = 1) -> Path:
    """Write the HTML page; of several variants each gets its own."""
    from xosc_lateral.pipeline.convert import numbered
    from xosc_lateral.report.scenario import conversion_page

    return write_atomically(numbered(path, conversion.provenance.variant, variants), conversion_page(conversion))
