"""The convert report: what enriching a scenario changed, for a person to judge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.driver.answers import basis_of, beside_line, borrows
from xosc_lateral.driver.profile import SIDES, DriverProfile
from xosc_lateral.enrich.result import ConversionProvenance, ConvertedScenario, Enriched, EntityResult, Neighbours
from xosc_lateral.motion.gaps import REACH, Gap
from xosc_lateral.motion.nominal import Note
from xosc_lateral.report import scenario_figures as figures
from xosc_lateral.report import scenario_time_figures as over_time
from xosc_lateral.report.path_dynamics import COMFORTABLE
from xosc_lateral.report.player.scene import enriched_scene
from xosc_lateral.report.render import KeyFigure, Tone, render_page

WRITTEN_AS = {"trajectory": "a trajectory", "lane-offset": "lane offsets"}


def as_text(conversion: ConvertedScenario, report: Path | None = None) -> str:
    """What was done, what was not, what to know."""
    lines = [f"{conversion.source if conversion.data else conversion.output}"]
    lines.append(f"  {under_test(conversion)}")
    for entity in conversion.enriched.entities:
        if entity.is_enriched and entity.profile is not None:
            mode = conversion.provenance.modes.get(entity.name, "")
            lines.append(
                f"  {entity.name}: {len(entity.segments)} segments, {entity.segment_seconds:.1f} s, "
                f"offsets {entity.offset_spread:.2f} m (standard deviation), profile {entity.profile.name}, "
                f"as {WRITTEN_AS.get(mode, mode)}"
            )
            lines.append(f"    neighbours: {beside_text(entity.profile, conversion.provenance.options['neighbours'])}")
        else:
            lines.append(f"  {entity.name}: as in the scenario ({entity.why})")
    if conversion.provenance.options["with_sensor"]:
        lines.append("  offsets include the sensor error of the drives that the profiles were fitted to")
    lines += [f"  note: {note.what}" for note in conversion.enriched.motion.notes]
    lines += [f"  warning: {warning}" for warning in conversion.warnings]
    if report is not None:
        lines.append(f"report: {report}")
    return "\n".join(lines)


def beside_text(profile: DriverProfile, neighbours: str) -> str:
    """How a driver answers to vehicles beside him, and where that is known from, in a line."""
    if neighbours == Neighbours.NONE:
        return "no answer (--neighbours none)"
    may_borrow = neighbours == Neighbours.BORROW
    lines = []
    for side in SIDES:
        borrowed = ": borrowed from the population" if may_borrow and borrows(profile, side) else ""
        lines.append(beside_line(profile, side) + borrowed)
    return "; ".join(lines)


def under_test(conversion: ConvertedScenario) -> str:
    """Who is under test, in a line."""
    egos = conversion.provenance.ego
    if egos:
        return f"under test, left as written: {', '.join(egos)}"
    return "no vehicle under test: " + (
        "everything is replayed" if conversion.is_replay else "maneuvers that stay react to the run"
    )


def facts(conversion: ConvertedScenario, report: Path | None = None) -> dict[str, Any]:
    """Plain values about a conversion, rounded to what they are read for: a micrometre, a microsecond."""
    enriched = conversion.enriched
    return {
        "source": str(conversion.source),
        "output": None if conversion.data else str(conversion.output),
        "report": None if report is None else str(report),
        "sha256": conversion.output_sha256,
        "end_time": round(enriched.motion.end_time, 6),
        "ended_by": enriched.motion.ended_by,
        "ego": list(conversion.provenance.ego),
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
        "gap_before": _smallest(enriched.gaps_before),
        "gap_after": _smallest(enriched.gaps_after),
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


def _smallest(gaps: tuple[Gap, ...]) -> float | None:
    return min((round(gap.distance, 6) for gap in gaps), default=None)


MOST_PANELS, MOST_DYNAMICS = 12, 6
"""Entities with panels of their own, for offsets and for dynamics; those with the largest offsets come first."""

SELDOM = 0.01
"""Share of the time beyond which lateral acceleration is rougher than people's. [-]"""

MOST_PAIRS = 20
"""Pairs of vehicles that the gap figure shows, the closest first."""

GAP_TIMES = ("at [s]", "at [s] ")
"""Headings of the times of the nominal and the enriched gap: a table's headings differ, if only by a blank."""


def conversion_page(conversion: ConvertedScenario) -> str:
    """`scenario_page` of a conversion, with all its provenance."""
    made = conversion.provenance
    return scenario_page(
        conversion.enriched,
        source=conversion.source.name,
        output=conversion.output.name,
        warnings=conversion.warnings,
        under_test=under_test(conversion),
        provenance={
            "under test": list(made.ego) or "none",
            "written as": [f"{name}: {WRITTEN_AS[mode]}" for name, mode in made.modes.items()],
            "neighbours": [
                f"{one.name}: {beside_text(one.profile, made.options['neighbours'])}"
                for one in conversion.enriched.entities
                if one.is_enriched and one.profile is not None
            ],
            "seed": made.options["seed"],
            "variant": made.variant,
            "parameters set": [f"{name} = {value}" for name, value in made.options["parameters"].items()],
            "profiles": [f"{entity}: {name} ({sha[:12]})" for entity, (name, sha) in made.profiles.items()],
            "inputs": [f"{name} ({sha[:12]})" for name, sha in made.inputs.items()],
            "output hash": conversion.output_sha256,
        },
    )


def scenario_page(
    enriched: Enriched,
    *,
    source: str,
    output: str,
    provenance: Mapping[str, object],
    warnings: Sequence[str] = (),
    under_test: str = "",
) -> str:
    """HTML page on one converted scenario, self-contained; same input, same bytes.

    Parameters
    ----------
    enriched : Enriched
    source, output : str
        File names, for the reader.
    provenance : mapping
        Shown in the footer: hashes, seed, profiles, version.
    warnings : sequence of str
        What the user has to know; shown on top.
    under_test : str
        Who is, in a line.
    """
    done = [entity for entity in enriched.entities if entity.is_enriched]
    others = [entity for entity in enriched.entities if not entity.is_enriched]
    return render_page(
        "conversion.html",
        title=f"{Path(source).name}: lateral movement added",
        provenance={"scenario": source, "output": output, **provenance},
        enriched=enriched,
        output=output,
        warnings=warnings,
        under_test=under_test,
        done=done,
        numbers=_key_figures(enriched),
        scene=enriched_scene(enriched),
        stretched=figures.paths_stretched(enriched),
        above=figures.paths_from_above(enriched),
        others=[{"entity": entity.name, "reason": entity.why} for entity in others],
        speeds=over_time.speeds_over_time(enriched),
        timeline=over_time.timeline(enriched),
        segment_rows=_segment_rows(enriched),
        notes=_note_rows(enriched.motion.notes),
        comfortable=COMFORTABLE,
        reach=f"{REACH:g}",
        left_out=lambda most: _left_out(done, most),
        **_enriched_entities(enriched, done),
        **_gaps(enriched),
    )


def _enriched_entities(enriched: Enriched, done: Sequence[EntityResult]) -> dict[str, Any]:
    if not done:
        return {}
    return {
        "offsets": over_time.offsets_over_time(enriched, _largest(done, MOST_PANELS)),
        "dynamics": over_time.dynamics_over_time(_largest(done, MOST_DYNAMICS)),
        "entity_rows": [_entity_row(entity) for entity in done],
        "entity_formats": {"time [s]": ".1f", f"> {COMFORTABLE} m/s² [%]": ".1f"},
        "most_panels": MOST_PANELS,
        "most_dynamics": MOST_DYNAMICS,
    }


def _gaps(enriched: Enriched) -> dict[str, Any]:
    before = {gap.names: gap for gap in enriched.gaps_before}
    after = {gap.names: gap for gap in enriched.gaps_after}
    pairs = [(before.get(names), after.get(names)) for names in sorted(before | after)]
    pairs.sort(key=lambda pair: min(gap.distance for gap in pair if gap is not None))
    if not pairs:
        return {"pairs": pairs}
    tones = _tones(enriched, pairs)
    return {
        "pairs": pairs,
        "shown_pairs": MOST_PAIRS,
        "gaps": over_time.gaps_before_and_after(pairs[:MOST_PAIRS]),
        "gap_rows": [_gap_row(*pair) for pair in pairs],
        "gap_formats": dict.fromkeys(("nominal [m]", "enriched [m]", "change [m]"), ".2f")
        | dict.fromkeys(GAP_TIMES, ".1f"),
        "gap_tones": tones,
    }


def _tones(enriched: Enriched, pairs: Sequence[tuple[Gap | None, Gap | None]]) -> dict[int, Tone]:
    """Rows of pairs that touch only since they were enriched."""
    touching = {gap.names for gap in enriched.new_contacts}
    return {number: "bad" for number, pair in enumerate(pairs) if any(gap and gap.names in touching for gap in pair)}


def _key_figures(enriched: Enriched) -> list[KeyFigure]:
    done = [entity for entity in enriched.entities if entity.is_enriched]
    if not done:
        return []
    offsets = np.concatenate([segment.offset for entity in done for segment in entity.segments])
    added = np.concatenate([np.abs(entity.lateral_acceleration()) for entity in done])
    rough = float(np.mean(added > COMFORTABLE))
    figures_ = [
        KeyFigure(f"{sum(entity.segment_seconds for entity in done):.0f} s", "road-following, all entities together"),
        KeyFigure(
            f"{offsets.std():.2f} m", "standard deviation of the offsets", f"largest {np.abs(offsets).max():.2f} m"
        ),
        KeyFigure(
            f"{added.max():.2f} m/s²",
            "largest added lateral acceleration",
            f"above {COMFORTABLE} m/s² for {100.0 * rough:.1f} % of the time; real drivers rarely are, in their lane",
            "bad" if rough > SELDOM else "",
        ),
    ]
    if enriched.gaps_after:
        after = min(enriched.gaps_after, key=lambda gap: gap.distance)
        before = min(enriched.gaps_before, key=lambda gap: gap.distance, default=None)
        nominal = "" if before is None else f"; nominally {before.distance:.2f} m"
        if before is not None and before.names != after.names:
            nominal += f", of {' and '.join(before.names)}"
        tone: Tone = "bad" if enriched.new_contacts else ""
        figures_.append(KeyFigure(f"{after.distance:.2f} m", "smallest gap", " and ".join(after.names) + nominal, tone))
    return figures_


def _entity_row(entity: EntityResult) -> dict[str, object]:
    added, jerk = np.abs(entity.lateral_acceleration()), np.abs(entity.lateral_jerk())
    return {
        "entity": entity.name,
        "profile": "" if entity.profile is None else entity.profile.name,
        "segments": len(entity.segments),
        "time [s]": entity.segment_seconds,
        "std. deviation [m]": entity.offset_spread,
        "max. offset [m]": float(np.abs(entity.deviation).max()),
        "acc. rms [m/s²]": float(np.sqrt(np.mean(added**2))),
        "acc. max. [m/s²]": float(added.max()),
        f"> {COMFORTABLE} m/s² [%]": 100.0 * float(np.mean(added > COMFORTABLE)),
        "jerk rms [m/s³]": float(np.sqrt(np.mean(jerk**2))),
    }


def _gap_row(before: Gap | None, after: Gap | None) -> dict[str, object]:
    names = (before or after).names  # type: ignore[union-attr]
    return {
        "pair": " and ".join(names),
        "nominal [m]": None if before is None else before.distance,
        GAP_TIMES[0]: None if before is None else before.time,
        "enriched [m]": None if after is None else after.distance,
        GAP_TIMES[1]: None if after is None else after.time,
        "change [m]": None if before is None or after is None else after.distance - before.distance,
    }


def _segment_rows(enriched: Enriched) -> list[dict[str, object]]:
    return [
        {"entity": entity.name, "from [s]": span.start, "to [s]": span.end, "what": span.kind.value}
        for entity in enriched.entities
        for span in entity.spans
    ]


def _note_rows(notes: Sequence[Note]) -> list[dict[str, object]]:
    return [
        {"what": note.what, "element": note.element, "file": Path(note.path).name, "line": str(note.line or "")}
        for note in notes
    ]


def _largest(entities: Sequence[EntityResult], most: int) -> list[EntityResult]:
    """At most so many of them, those with the largest offsets, in their own order."""
    ranked = sorted(entities, key=lambda entity: -float(np.abs(entity.deviation).max()))[:most]
    return [entity for entity in entities if entity in ranked]


def _left_out(entities: Sequence[EntityResult], most: int) -> str:
    more = len(entities) - most
    return f" {more} more with smaller offsets are left out." if more > 0 else ""
