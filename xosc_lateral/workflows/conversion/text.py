"""What a conversion did, as text and as plain values."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from msgspec import structs

from xosc_lateral.drivers.fitting.neighbours import basis_of, borrows, responses_in_words
from xosc_lateral.drivers.model.profile import SIDES, DriverProfile
from xosc_lateral.workflows.conversion.result import ConversionProvenance, ConvertedScenario, Neighbours

WRITTEN_AS = {"trajectory": "a trajectory", "lane-offset": "lane offsets"}


def as_text(conversion: ConvertedScenario) -> str:
    """What was done, what was not, what to know."""
    lines = [f"{conversion.output or conversion.source}"]
    lines.append(f"  {under_test(conversion)}")
    for entity in conversion.movement.entities:
        if entity.is_enriched and entity.profile is not None:
            mode = conversion.provenance.modes.get(entity.name, "")
            lines.append(
                f"  {entity.name}: {len(entity.segments)} segments, {entity.segment_seconds:.1f} s, "
                f"offsets {entity.offset_spread:.2f} m (standard deviation), profile {entity.profile.name}, "
                f"as {WRITTEN_AS.get(mode, mode)}"
            )
        else:
            lines.append(f"  {entity.name}: as in the scenario ({entity.why})")
    lines += _responses(conversion)
    if conversion.provenance.options["with_sensor"]:
        lines.append("  offsets include the sensor error of the drives that the profiles were fitted to")
    lines += [f"  note: {note.what}" for note in conversion.movement.motion.notes]
    lines += [f"  warning: {warning}" for warning in conversion.warnings]
    if conversion.report is not None:
        lines.append(f"report: {conversion.report}")
    return "\n".join(lines)


def beside_text(profile: DriverProfile, neighbours: str) -> str:
    """How a driver responds to vehicles beside him, in a line."""
    if neighbours == Neighbours.NONE:
        return "beside vehicles: does not move (--neighbours none)"
    may_borrow = neighbours == Neighbours.BORROW
    return responses_in_words(profile, [side for side in SIDES if may_borrow and borrows(profile, side)])


def _responses(conversion: ConvertedScenario) -> list[str]:
    """How drivers respond to vehicles beside them: a line for all who do so alike."""
    alike: dict[str, list[str]] = {}
    for entity in conversion.movement.entities:
        if entity.is_enriched and entity.profile is not None:
            words = beside_text(entity.profile, conversion.provenance.options["neighbours"])
            alike.setdefault(words, []).append(entity.name)
    return [f"  {', '.join(names)} {words}" for words, names in alike.items()]


def under_test(conversion: ConvertedScenario) -> str:
    """Vehicles that are not the storyboard's: under test, or driven by controllers, in a line."""
    egos, controllers = conversion.provenance.ego, conversion.controllers
    lines = [f"under test, left as written: {', '.join(egos)}"] if egos else []
    lines += [f"'{name}' is left to controller {control}" for name, control in controllers.items()]
    if lines:
        return "; ".join(lines)
    return "no vehicle under test: " + (
        "everything is replayed" if conversion.is_replay else "maneuvers that stay react to the run"
    )


def facts(conversion: ConvertedScenario) -> dict[str, Any]:
    """Plain values about a conversion, rounded to what they are read for: a micrometre, a microsecond."""
    enriched = conversion.movement
    before, after = (None if gap is None else round(gap, 6) for gap in conversion.smallest_gap)
    return {
        "source": str(conversion.source),
        "output": None if conversion.output is None else str(conversion.output),
        "report": None if conversion.report is None else str(conversion.report),
        "sha256": conversion.sha256,
        "end_time": round(enriched.motion.end_time, 6),
        "ended_by": enriched.motion.ended_by,
        "ego": list(conversion.provenance.ego),
        "controllers": {
            name: {"controllers": list(control.controllers), "drives": control.domains.words()}
            for name, control in conversion.controllers.items()
        },
        "entities": [
            {
                "name": entity.name,
                "profile": entity.profile.name if entity.is_enriched and entity.profile is not None else None,
                "why_not": entity.why,
                "neighbours": _beside_facts(entity.profile) if entity.is_enriched else None,
                "mode": conversion.provenance.modes.get(entity.name),
                "segments": [[round(segment.span.start, 6), round(segment.span.end, 6)] for segment in entity.segments],
                "offset_spread": round(entity.offset_spread, 6),
                "neutral_context": list(entity.neutral),
            }
            for entity in enriched.entities
        ],
        "gap_before": before,
        "gap_after": after,
        "shifts": [
            {
                name: round(value, 6) if isinstance(value, float) else value
                for name, value in structs.asdict(one).items()
            }
            for one in conversion.shifts
        ],
        "notes": [asdict(note) for note in enriched.motion.notes],
        "warnings": list(conversion.warnings),
        "provenance": provenance_record(conversion.provenance),
    }


def _beside_facts(profile: DriverProfile | None) -> dict[str, str] | None:
    return None if profile is None else {side: basis_of(profile, side).value for side in SIDES}


def provenance_record(provenance: ConversionProvenance) -> dict[str, Any]:
    """Provenance of a conversion as plain values."""
    profiles = {name: {"name": profile, "sha256": sha} for name, (profile, sha) in provenance.profiles.items()}
    return asdict(provenance) | {"profiles": profiles}
