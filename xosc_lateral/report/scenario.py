"""The convert report: what enriching a scenario changed, for a person to judge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.enrich.result import Enriched, EntityResult
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.motion.nominal import Note
from xosc_lateral.report import scenario_figures as figures
from xosc_lateral.report.page import KeyFigure, Page, Tone
from xosc_lateral.report.path_dynamics import COMFORTABLE

if TYPE_CHECKING:
    from xosc_lateral.pipeline.convert import Conversion

MOST_PANELS, MOST_DYNAMICS = 12, 6
"""Entities with panels of their own, for offsets and for dynamics; those with the largest offsets come first."""

SELDOM = 0.01
"""Share of the time beyond which lateral acceleration is rougher than people's. [-]"""

MOST_PAIRS = 20
"""Pairs of vehicles that the gap figure shows, the closest first."""

GAP_TIMES = ("at [s]", "at [s] ")
"""Headings of the times of the nominal and the enriched gap: a table's headings differ, if only by a blank."""


def conversion_page(conversion: Conversion) -> str:
    """`scenario_page` of a conversion, with all its provenance."""
    made = conversion.provenance
    return scenario_page(
        conversion.enriched,
        source=conversion.source.name,
        output=conversion.output.name,
        warnings=conversion.warnings,
        provenance={
            "seed": made.seed,
            "variant": made.variant,
            "parameters set": [f"{name} = {value}" for name, value in made.parameters.items()],
            "profiles": [f"{entity}: {name} ({sha[:12]})" for entity, (name, sha) in made.profiles.items()],
            "inputs": [f"{name} ({sha[:12]})" for name, sha in made.inputs.items()],
            "output hash": conversion.output_hash,
        },
    )


def scenario_page(
    enriched: Enriched,
    *,
    source: str,
    output: str,
    provenance: Mapping[str, object],
    warnings: Sequence[str] = (),
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
    """
    page = Page(f"{Path(source).name}, made lifelike")
    page.lead(_summary(enriched, output), _key_figures(enriched))
    for warning in warnings:
        page.warning(warning)
    _paths(page, enriched)
    _offsets(page, enriched)
    _motion(page, enriched)
    _gaps(page, enriched)
    _timeline(page, enriched)
    _not_played(page, enriched.motion.notes)
    return page.provenance({"scenario": source, "output": output, **provenance}).html()


def _summary(enriched: Enriched, output: str) -> str:
    done = [entity for entity in enriched.entities if entity.is_enriched]
    text = (
        f"{len(done)} of {len(enriched.entities)} entities move inside their lanes as the chosen drivers do; "
        f"their maneuvers are those of the scenario. It runs for {enriched.motion.end_time:.1f} s "
        f"(ended by: {enriched.motion.ended_by}). Written to `{output}`."
    )
    return text if done else text + " Nothing was changed: see below why."


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
            "largest lateral acceleration added",
            f"over {COMFORTABLE} m/s² in {100.0 * rough:.1f} % of the time; real drivers seldom are, in their lane",
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


def _paths(page: Page, enriched: Enriched) -> None:
    page.section("Paths")
    stretched = figures.paths_stretched(enriched)
    above = figures.paths_from_above(enriched)
    if stretched is None or above is None:
        page.text("No entity is on a road.")
        return
    page.figure(
        stretched,
        "Stretched: position across the road over position along it. Coloured: enriched; dashed: nominal; "
        "dots: where each entity starts. Where the road's own lanes bend, they are drawn straight.",
        alt="Lateral position of every vehicle along the road, nominal and enriched, with lane markings",
    )
    page.figure(
        above,
        "The same from above and true to scale: offsets of decimetres are hardly visible on hundreds of metres.",
        alt="Plan view of the road with nominal and enriched paths",
    )


def _offsets(page: Page, enriched: Enriched) -> None:
    page.section("Offsets", "What was added to the nominal place in the lane, positive to the left of travel.")
    done = [entity for entity in enriched.entities if entity.is_enriched]
    if done:
        shown = _largest(done, MOST_PANELS)
        page.figure(
            figures.offsets_over_time(enriched, shown),
            "Shaded: road-following segments, where offsets are sampled; in between they lead over. Left is up."
            + _left_out(done, MOST_PANELS),
            alt="Offset over time of each enriched entity",
        )
        page.table(
            [_entity_row(entity) for entity in done],
            "Entities that were enriched. Acceleration and jerk: what was added to those of the nominal path.",
            formats={"time [s]": ".1f", "> 0.5 m/s² [%]": ".1f"},
        )
    others = [entity for entity in enriched.entities if not entity.is_enriched]
    if others:
        page.table([{"entity": entity.name, "why": entity.why} for entity in others], "Entities that were not")


def _entity_row(entity: EntityResult) -> dict[str, object]:
    added, jerk = np.abs(entity.lateral_acceleration()), np.abs(entity.lateral_jerk())
    return {
        "entity": entity.name,
        "profile": "" if entity.profile is None else entity.profile.name,
        "segments": len(entity.segments),
        "time [s]": entity.segment_seconds,
        "spread [m]": entity.offset_spread,
        "max. [m]": float(np.abs(entity.deviation).max()),
        "acc. rms [m/s²]": float(np.sqrt(np.mean(added**2))),
        "max. [m/s²]": float(added.max()),
        f"> {COMFORTABLE} m/s² [%]": 100.0 * float(np.mean(added > COMFORTABLE)),
        "jerk rms [m/s³]": float(np.sqrt(np.mean(jerk**2))),
    }


def _motion(page: Page, enriched: Enriched) -> None:
    page.section("Speed and lateral dynamics")
    page.figure(
        figures.speeds_over_time(enriched),
        "Speed: coloured enriched, dashed nominal. Swerving adds next to nothing to the way, hence to the speed.",
        alt="Speed over time of every entity",
    )
    done = [entity for entity in enriched.entities if entity.is_enriched]
    if not done:
        return
    page.figure(
        figures.dynamics_over_time(_largest(done, MOST_DYNAMICS)),
        f"Blue: enriched; dashed: nominal, which holds what curves and lane changes ask. The band reaches "
        f"{COMFORTABLE} m/s² to both sides of nominal: real drivers seldom leave it while they keep their "
        f"lane.{_left_out(done, MOST_DYNAMICS)}",
        alt="Lateral acceleration and jerk over time, nominal and enriched",
    )


def _gaps(page: Page, enriched: Enriched) -> None:
    page.section("Gaps", "Smallest free space between the boxes of two vehicles that come near each other.")
    before = {gap.names: gap for gap in enriched.gaps_before}
    after = {gap.names: gap for gap in enriched.gaps_after}
    pairs = [(before.get(names), after.get(names)) for names in sorted(before | after)]
    pairs.sort(key=lambda pair: min(gap.distance for gap in pair if gap is not None))
    if not pairs:
        page.text("No two vehicles come near each other.")
        return
    page.figure(
        figures.gaps_before_and_after(pairs[:MOST_PAIRS]),
        "Nominal and enriched; the closest pairs first.",
        alt="Smallest gap of each pair of vehicles, nominal and enriched",
    )
    touching = {gap.names for gap in enriched.new_contacts}
    tones: dict[int, Tone] = {
        number: "bad" for number, pair in enumerate(pairs) if any(gap and gap.names in touching for gap in pair)
    }
    page.table(
        [_gap_row(*pair) for pair in pairs],
        "Pairs of vehicles; marked: they touch and nominally don't",
        formats=dict.fromkeys(("nominal [m]", "enriched [m]", "change [m]"), ".2f") | dict.fromkeys(GAP_TIMES, ".1f"),
        tones=tones,
    )


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


def _timeline(page: Page, enriched: Enriched) -> None:
    page.section("Segments", "Offsets are sampled where a vehicle follows its road; for the rest the reason is given.")
    page.figure(
        figures.timeline(enriched),
        "Coloured: road-following; grey: not.",
        alt="Time line of road-following segments per entity",
    )
    rows = [
        {
            "entity": entity.name,
            "from [s]": stretch.start,
            "to [s]": stretch.end,
            "what": stretch.kind.value,
        }
        for entity in enriched.entities
        for stretch in entity.stretches
    ]
    page.table(rows, "Stretches", formats={"from [s]": ".2f", "to [s]": ".2f"})


def _not_played(page: Page, notes: Sequence[Note]) -> None:
    page.section("Not played as written")
    if not notes:
        page.text("Nothing: every action and condition was played as the scenario states it.")
        return
    rows = [
        {"what": note.what, "element": note.element, "file": Path(note.path).name, "line": str(note.line or "")}
        for note in notes
    ]
    page.table(rows, "Left out or changed while playing")


def _largest(entities: Sequence[EntityResult], most: int) -> list[EntityResult]:
    """At most so many of them, those with the largest offsets, in their own order."""
    ranked = sorted(entities, key=lambda entity: -float(np.abs(entity.deviation).max()))[:most]
    return [entity for entity in entities if entity in ranked]


def _left_out(entities: Sequence[EntityResult], most: int) -> str:
    more = len(entities) - most
    return f" {more} more with smaller offsets are left out." if more > 0 else ""
