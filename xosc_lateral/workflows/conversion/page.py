"""The convert report: what enriching a scenario changed, for a person to judge."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from xosc_lateral.files.pages.page import KeyFigure, Page, Tone
from xosc_lateral.workflows.conversion.result import (
    MODE_WORDS,
    NOMINAL_RUN,
    ConvertedScenario,
    Enriched,
    EntityResult,
)
from xosc_lateral.workflows.conversion.shifts import EVENT_TOLERANCE
from xosc_lateral.workflows.playing import figures as figures
from xosc_lateral.workflows.playing.figures import PLAYER_WORDS, USUAL_ACCELERATION, add_notes
from xosc_lateral.workflows.playing.scene import scene_of
from xosc_lateral.world.motion.gaps import MAXIMUM_GAP, Following, closest_following, road_path

MOST_PANELS, MOST_DYNAMICS = 12, 6
"""Entities with panels of their own, for offsets and for dynamics; those with the largest offsets come first."""

ROUGH_SHARE = 0.01
"""Share of the time beyond which lateral acceleration is rougher than people's. [-]"""

LONGEST_HEADWAY = 5.0
"""Pairs that stay farther apart do not follow one another: UN R157 and ALKS scenarios look at 2 s and less. [s]"""

MOST_LANE_CHANGES = 4
"""Lane changes that are drawn. [-]"""

MOST_FOLLOWINGS = 20
"""Pairs in the table of headways."""

FOLLOWING_COLUMNS = ("headway nominal [s]", "headway enriched [s]", "TTC nominal [s]", "TTC enriched [s]")

GAP_TIMES = ("at [s]", "at [s] ")
"""Headings of the times of the nominal and the enriched gap: a table's headings differ, if only by a blank."""


def conversion_page(conversion: ConvertedScenario) -> str:
    """HTML page on one converted scenario, self-contained; same input, same bytes."""
    enriched = conversion.movement
    done = [entity for entity in enriched.entities if entity.is_enriched]
    page = Page(f"{conversion.source.name}: {'lateral movement added' if done else 'no movement added'}")
    page.lead(
        (
            f"{len(done)} of {len(enriched.entities)} entities now move inside their lanes as the chosen drivers do; "
            "their maneuvers are unchanged."
            if done
            else "No entity was enriched; the reasons are listed below."
        )
        + f" The scenario runs for {enriched.motion.end_time:.1f} s (ended by the {enriched.motion.ended_by})."
        + ("" if conversion.output is None else f" The result is in `{conversion.output.name}`.")
    )
    page.key_figures(key_figures(enriched, done))
    page.lead(conversion.under_test[:1].upper() + conversion.under_test[1:])
    for warning in conversion.warnings:
        page.warning(warning)
    page.section(
        "Player",
        "The scenario from above: as written, and below it lifelike, with written places as dashed outlines. "
        + PLAYER_WORDS,
    )
    page.player(
        scene_of(enriched.motion, enriched.network, enriched.entities), "Scenario from above, nominal and enriched"
    )
    _add_paths(page, enriched)
    _add_offsets(page, enriched, done)
    _add_dynamics(page, enriched, done)
    _add_lane_changes(page, enriched, done)
    _add_gaps(page, enriched)
    _add_shifts(page, conversion)
    page.section(
        "Segments",
        "Offsets are sampled where a vehicle simply follows its road. Everywhere else the table gives the reason why "
        "not.",
        folded=True,
    )
    rows = [
        {"entity": entity.name, "from [s]": span.start, "to [s]": span.end, "what": span.kind.value}
        for entity in enriched.entities
        for span in entity.spans
    ]
    page.table(rows, "Segments of every entity", formats={"from [s]": ".2f", "to [s]": ".2f"})
    add_notes(page, enriched.motion.notes)
    return page.html(_provenance(conversion))


def _provenance(conversion: ConvertedScenario) -> dict[str, object]:
    made = conversion.provenance
    driven = {one: one.profile for one in conversion.movement.entities if one.is_enriched and one.profile is not None}
    return {
        "scenario": conversion.source.name,
        "output": (conversion.output or conversion.source).name,
        "under test": list(made.ego) or "none",
        "written as": [f"{name}: {MODE_WORDS[mode]}" for name, mode in made.modes.items()],
        "neighbours": [
            f"{', '.join(names)}, {words}"
            for words, names in conversion.movement.responses(made.options["neighbours"]).items()
        ],
        "seed": made.options["seed"],
        "variant": made.variant,
        "parameters set": [f"{name} = {value}" for name, value in made.options["parameters"].items()],
        "profiles": [f"{entity}: {name} ({sha[:12]})" for entity, (name, sha) in made.profiles.items()],
        "profiles are valid for": sorted(
            {f"{profile.name}: {profile.validity.in_words() or 'not stated'}" for profile in driven.values()}
        ),
        "inputs": [f"{name} ({sha[:12]})" for name, sha in made.inputs.items()],
        "output hash": conversion.sha256,
    }


def _add_paths(page: Page, enriched: Enriched) -> None:
    page.section("Paths")
    paths = figures.paths_stretched(enriched)
    if paths is None:
        page.text("No entity is on a road.")
        return
    page.figure(
        paths,
        "Position across the road (t) over position along it (s), with the scale across the road exaggerated. "
        "Coloured: enriched. Dashed: nominal. Dots: where each entity starts. Bends of the road are drawn straight.",
        "Lateral position of every vehicle along the road, nominal and enriched, with lane markings",
    )


def _add_offsets(page: Page, enriched: Enriched, done: Sequence[EntityResult]) -> None:
    page.section("Offsets", "The distance between the enriched and the nominal path, positive to the left of travel.")
    if done:
        page.figure(
            figures.offsets_over_time(enriched, _with_largest_offsets(done, MOST_PANELS)),
            "Grey: not road-following. In lane changes and offsets of a trajectory the movement goes on; elsewhere it "
            "leads smoothly from one segment to the next."
            f"{_left_out(done, MOST_PANELS)}",
            "Offset over time of each enriched entity",
            over_time=True,
        )
        page.table(
            [_entity_row(entity) for entity in done],
            "Enriched entities. Acceleration and jerk are lateral, and what enriching adds to the nominal path.",
            formats=dict.fromkeys(("time [s]", f"> {USUAL_ACCELERATION} m/s² [%]"), ".1f")
            | dict.fromkeys(("max. offset [m]", "acc. max. [m/s²]"), ".2f"),
        )
    others = [{"entity": one.name, "reason": one.why} for one in enriched.entities if not one.is_enriched]
    if others:
        page.table(others, "Entities that keep their nominal motion")


def _add_dynamics(page: Page, enriched: Enriched, done: Sequence[EntityResult]) -> None:
    page.section("Speed and lateral dynamics")
    page.figure(
        figures.speeds_over_time(enriched.motion, enriched.entities),
        "Coloured: enriched. Dashed: nominal. Lateral movement hardly changes the distance driven, and therefore "
        "hardly changes the speed.",
        "Speed over time of every entity",
        over_time=True,
    )
    if done:
        page.figure(
            figures.accelerations_over_time(enriched, _with_largest_offsets(done, MOST_DYNAMICS)),
            "Lateral acceleration beyond what curves and lane changes require. Dashed: "
            f"{USUAL_ACCELERATION} m/s² to either side, which real drivers rarely exceed while they keep their lane. "
            "Grey: not road-following."
            f"{_left_out(done, MOST_DYNAMICS)}",
            "Added lateral acceleration over time",
            over_time=True,
        )


def _add_lane_changes(page: Page, enriched: Enriched, done: Sequence[EntityResult]) -> None:
    """Those of vehicles on trajectories: the player draws the others."""
    changes = [(entity, one) for entity in done for one in entity.crossings if one.is_lane_change]
    if not changes:
        return
    page.section("Lane changes")
    more = f" The first {MOST_LANE_CHANGES} of {len(changes)}." if len(changes) > MOST_LANE_CHANGES else ""
    page.figure(
        figures.lane_changes_over_time(enriched, changes[:MOST_LANE_CHANGES]),
        "Speed towards the new lane. Coloured: enriched, with the movement in the lane. Dashed: as written. Band: the "
        f"largest speed of 90 % of 323 lane changes of 6 to 13 s on one motorway.{more}",
        "Lateral speed over time of each lane change",
    )


def _add_gaps(page: Page, enriched: Enriched) -> None:
    page.section(
        "Gaps",
        "The smallest free space in the nominal run between the bounding boxes of two vehicles that come within "
        f"{MAXIMUM_GAP:g} m of each other.",
    )
    before = {gap.names: gap for gap in enriched.gaps_before}
    after = {gap.names: gap for gap in enriched.gaps_after}
    pairs = [(before.get(names), after.get(names)) for names in sorted(before | after)]
    pairs.sort(key=lambda pair: min(gap.distance for gap in pair if gap is not None))
    rows = [
        {
            "pair": next(" and ".join(gap.names) for gap in (nominal, made) if gap),
            "nominal [m]": None if nominal is None else nominal.distance,
            GAP_TIMES[0]: None if nominal is None else nominal.time,
            "enriched [m]": None if made is None else made.distance,
            GAP_TIMES[1]: None if made is None else made.time,
            "change [m]": None if nominal is None or made is None else made.distance - nominal.distance,
        }
        for nominal, made in pairs
    ]
    if not pairs:
        page.text("No two vehicles come that close to each other there.")
    else:
        page.table(
            rows,
            "Pairs of vehicles, the closest first. Marked: pairs that touch in the enriched scenario only.",
            formats=dict.fromkeys(("nominal [m]", "enriched [m]", "change [m]"), ".2f")
            | dict.fromkeys(GAP_TIMES, ".1f"),
            tones={
                k: "bad" for k, pair in enumerate(pairs) if any(gap in enriched.new_contacts for gap in pair if gap)
            },
        )
    _add_followings(page, enriched)


def _add_followings(page: Page, enriched: Enriched) -> None:
    """Smallest headway and time to collision of each pair, as written and as converted."""
    network, vehicles = enriched.network, [one for one in enriched.entities if one.motion.entity.is_vehicle]
    before = closest_following([road_path(one.motion, network, one.motion, 0.0) for one in vehicles])
    after = closest_following([road_path(one.motion, network, one.trajectory, one.deviation) for one in vehicles])
    names = [
        pair
        for pair in sorted(before | after)
        if min(side[pair].headway if pair in side else math.inf for side in (before, after)) <= LONGEST_HEADWAY
    ]
    rows = []
    for pair in names:
        nominal, made = before.get(pair, Following(*pair)), after.get(pair, Following(*pair))
        values = (nominal.headway, made.headway, nominal.time_to_collision, made.time_to_collision)
        shown = (value if math.isfinite(value) else None for value in values)
        rows.append({"pair": " behind ".join(pair), **dict(zip(FOLLOWING_COLUMNS, shown, strict=True))})
    page.heading("Time headway and time to collision")
    page.table(
        rows[:MOST_FOLLOWINGS],
        "Smallest of each pair while one is behind the other on a road, their widths overlapping: free space over the "
        f"speed of the vehicle behind, and over the closing speed. Pairs within {LONGEST_HEADWAY:g} s."
        + (f" {len(rows) - MOST_FOLLOWINGS} more pairs are left out." if len(rows) > MOST_FOLLOWINGS else ""),
        formats=dict.fromkeys(FOLLOWING_COLUMNS, ".2f"),
    )


def _add_shifts(page: Page, conversion: ConvertedScenario) -> None:
    """Events that come at other times with the offsets than without them."""
    shifts = [
        one
        for one in conversion.shifts
        if one.run == NOMINAL_RUN or max(abs(one.start), abs(one.end)) > EVENT_TOLERANCE
    ]
    if not shifts:
        return
    rows = [
        {
            "run": shift.run,
            "event": shift.event,
            "of": shift.entity or "",
            "at [s]": shift.time,
            "lasts [s]": shift.duration,
            "starts later by [s]": shift.start,
            "ends later by [s]": shift.end,
            "lateral speed [m/s]": shift.lateral_speed,
        }
        for shift in shifts
    ]
    page.heading("Events")
    page.table(
        rows,
        "How much later events start and end with the offsets than without them (negative: earlier): all of the "
        f"nominal run, which the page is about, and those of trial runs that move by more than {EVENT_TOLERANCE} s. An "
        "action by an acceleration or a rate takes longer or shorter from beside the middle; it begins without the "
        "lateral speed that a vehicle comes with.",
        formats=dict.fromkeys(("at [s]", "lasts [s]", "starts later by [s]", "ends later by [s]"), ".2f")
        | {"lateral speed [m/s]": ".3f"},
    )


def key_figures(enriched: Enriched, done: Sequence[EntityResult]) -> list[KeyFigure]:
    """Numbers that a reader takes home, of the nominal run."""
    if not done:
        return []
    offsets = np.concatenate([segment.offset for entity in done for segment in entity.segments])
    added = np.concatenate([np.abs(entity.lateral_acceleration()) for entity in done])
    rough = float(np.mean(added > USUAL_ACCELERATION))
    largest = max(float(np.abs(entity.deviation).max()) for entity in done)
    figures_ = [
        KeyFigure(f"{sum(entity.segment_seconds for entity in done):.0f} s", "road-following, all entities together"),
        KeyFigure(f"{offsets.std():.2f} m", "standard deviation of the offsets", f"largest {largest:.2f} m"),
        KeyFigure(
            f"{added.max():.2f} m/s²",
            "largest added lateral acceleration",
            f"above {USUAL_ACCELERATION} m/s² for {100.0 * rough:.1f} % of the time; real drivers rarely are, in "
            "their lane",
            "bad" if rough > ROUGH_SHARE else "",
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
        f"> {USUAL_ACCELERATION} m/s² [%]": 100.0 * float(np.mean(added > USUAL_ACCELERATION)),
        "jerk rms [m/s³]": float(np.sqrt(np.mean(jerk**2))),
    }


def _with_largest_offsets(entities: Sequence[EntityResult], most: int) -> list[EntityResult]:
    """At most so many of them, those with the largest offsets, in their own order."""
    ranked = sorted(entities, key=lambda entity: -float(np.abs(entity.deviation).max()))[:most]
    return [entity for entity in entities if entity in ranked]


def _left_out(entities: Sequence[EntityResult], most: int) -> str:
    more = len(entities) - most
    return f" {more} more with smaller offsets are left out." if more > 0 else ""
