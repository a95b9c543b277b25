"""A closed loop for machines and for a person: as strict JSON, and as a page that says the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

from xosc_lateral.base.arrays import NORMAL_95
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.effects import ColumnEffect
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.loop import loop_figures, loop_words
from xosc_lateral.extras.loop.close import Finding, LoopResult
from xosc_lateral.extras.loop.held_out import SNIPPET_ROWS
from xosc_lateral.extras.loop.identify import held_out_words
from xosc_lateral.extras.loop.loop_words import feedback_words, meaning, verdict
from xosc_lateral.extras.loop.selection import Gain
from xosc_lateral.extras.loop.shown import Shown, between_drives_of
from xosc_lateral.files.pages.page import KeyFigure, Page
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.profiles.violins import violin_figure

MEASURE = (
    "root mean square of measured minus expected over cells (mean and spread by fifths of every column, spread by "
    "time, movement by frequency band, quantiles of local spread) on held-out blocks, m"
)

FINDING_FIELDS = (
    *("effect", "kind", "columns", "lag_s", "response_s", "shape", "size_m", "size_error"),
    *("p_value", "error_before", "error_after"),
)


def loop_record(result: LoopResult, tables: Sequence[Path]) -> dict[str, Any]:
    """`report.json` as plain values: what people and machines ask of a closed loop, and the provenance."""
    own_errors = result.own_errors
    scores = result.scores
    return {
        "drives": list(result.coarse.timeline.names),
        "base_profile": _profile(result.base) | {"given": result.base_given, "in_sample": result.in_sample},
        "refined_profile": _profile(result.refined),
        "held_out": held_out_words(result.coarse.timeline),
        "columns": [column_record(column, result) for column in sorted(result.identified.usable.roles)],
        "findings": [finding_record(finding) | {"meaning": meaning(finding)} for finding in result.findings],
        "consequences": [
            {"column": item.column, "why": feedback_words(item), "doubtful": item.doubtful}
            | {"coherence": item.coherence, "predicted_share": item.predicted_share}
            | {"function_of_offset": item.function}
            for item in result.identified.usable.feedback
        ],
        "rejected": [
            {"columns": list(item.columns), "look": item.component, "p_value": item.p_value, "why": item.why}
            | {"taken_back": item.was_found}
            for item in result.identified.selection.rejected
        ],
        "unused": [{"column": column, "why": why} for column, why in result.identified.usable.unused.items()],
        "shown": shown_records(result.shown),
        "own_error": own_errors and {"before": own_errors[0], "after": own_errors[1]},
        "error": {
            **{"measure": MEASURE, "before": result.error_before, "after": result.error_after},
            "floor": result.floor,
        },
        "held_out_gain": _gain(result.identified.total),
        "returned_base": result.identified.returned_base or None,
        "unexplained": {
            "sentence": verdict(result),
            "omnibus": result.remainder and asdict(result.remainder) | {"within_chance": result.remainder.silent},
        },
        "residual": [
            {"group": group.name, "before": group.before, "after": group.after, "floor": group.floor}
            for group in result.lack_of_fit.groups
        ],
        "metrics": {
            when: {} if distances is None else dict(distances.by_metric)
            for when, distances in (("before", scores.before), ("after", scores.after), ("floor", scores.floor))
        },
        "provenance": {"package_version": __version__, "seed": result.seed, "inputs": parsed_hashes(tables)},
    }


def shown_records(shown: Sequence[Shown]) -> list[dict[str, Any]]:
    """What drives can show, one record per look; sizes in m for the mean, factors for the spread."""
    return [asdict(one) for one in shown]


def column_record(column: str, result: LoopResult) -> dict[str, Any]:
    """What a column was taken for, by whom, and what was done with it."""
    usable = result.identified.usable
    assigned = usable.roles[column]
    follows = any(item.column == column for item in usable.feedback)
    too_few = (one.why for one in result.shown if one.what == between_drives_of(column) and not one.tested)
    used = "consequence" if follows else usable.unused.get(column) or next(too_few, "tested as a cause")
    return {"column": column, "role": assigned.role.value, "by": assigned.source or None, "use": used}


def finding_record(finding: Finding) -> dict[str, Any]:
    """One finding of the JSON result, with its uncertainty and what the profile got."""
    passage, about = finding.passage, NORMAL_95 * finding.size_error
    return {name: getattr(finding, name) for name in FINDING_FIELDS} | {
        "columns": list(finding.columns),
        "between": finding.ends and {"from": dict(finding.ends.low), "to": dict(finding.ends.high)},
        "drives": finding.own_slopes and list(finding.own_slopes.there),
        "measure": f"{finding.measure}, m",
        "alike": sorted({name for columns in finding.alike for name in columns} - set(finding.columns)),
        "instead": [list(columns) for columns in finding.alike],
        "interval": [finding.size_m - about, finding.size_m + about],
        "held_out_gain": _gain(finding.gain),
        "passage": passage
        and {
            **{"from": passage.usual, "to": passage.high, "lasts_s": passage.lasts_s},
            **{"time_s": list(passage.time), "path_m": list(passage.path), "path_error_m": list(passage.error)},
        },
        "added": [effect.to_dict() for effect in finding.effects],
    }


def finite(value: Any) -> Any:
    """The same with plain floats, and None for what is not finite."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, bool | int | str) or value is None:
        return value
    number = float(value)
    return number if isfinite(number) else None


def _gain(gain: Gain | None) -> dict[str, Any] | None:
    if gain is None:
        return None
    return {"mean_nat_per_block": gain.mean, "interval": list(gain.interval), "chosen_in_folds": gain.folds}


def _profile(profile: DriverProfile) -> dict[str, Any]:
    return {
        "name": profile.name,
        "model": profile.model.kind,
        "sha256": profile_hash(profile),
        "effects": len(profile.effects),
    }


# ---- for a person: what was missing, how sure, how big, and what is left ----
NAMED_DRIVES = 3  # So many drives are named in the title; more are counted.


def loop_page(result: LoopResult, tables: Sequence[Path], proofs: Sequence[str] = ()) -> str:
    """HTML page; same result, same bytes. `proofs`: what findings do in a scenario, in words."""
    timeline = result.coarse.timeline
    drives = timeline.names if len(timeline.names) <= NAMED_DRIVES else (f"{len(timeline.names)} drives",)
    page = Page(f"Closed loop: {', '.join(drives)}")
    page.lead(loop_words.outcome(result))
    figures = [
        KeyFigure(f"{one:.1f} → {two:.1f} mm", f"held-out error {what}")
        for what, one, two in loop_words.errors_of(result)
    ]
    page.key_figures([*figures, KeyFigure(f"{1e3 * result.floor:.1f} mm", "between halves of these drives")])
    page.lead(loop_words.verdict(result))
    _add_findings(page, result, proofs)
    _add_residuals(page, result)
    _add_movement(page, result)
    page.section("What these drives can show", loop_words.SHOWN_NOTE, folded=True)
    page.table(loop_words.shown_rows(result.shown))
    reasons = {item.column: loop_words.feedback_words(item) for item in result.identified.usable.feedback}
    page.section("Columns, and what they are taken for", folded=True)
    page.table(
        [
            column_record(column, result) | {"why": reasons.get(column)}
            for column in sorted(result.identified.usable.roles)
        ],
        "What a column is, who said so, and its use. What follows from the car's own movement, as the angle of a "
        "steering wheel does, is no cause, nor is time. Say what a column is with `--role COLUMN=ROLE`: road, weather "
        "and traffic are always tested as causes.",
    )
    page.section("What was looked for and not added", folded=True)
    page.table(
        [
            {"not added": loop_words.taken_back_words(item), "p-value": item.p_value}
            for item in result.identified.selection.rejected
        ],
        "Of every question the strongest candidate that is not significant; and what was found and taken back.",
        formats={"p-value": ".2g"},
    )
    page.section("How to read this page", folded=True)
    runs = len(result.scored.runs_after)
    page.items(line.format(n_runs=runs, certain=f"{loop_words.CERTAIN_P_VALUE:g}") for line in HOW_TO_READ)
    return page.html(
        {
            "base profile": f"{result.base.name} {profile_hash(result.base)[:12]}",
            "refined profile": f"{result.refined.name} {profile_hash(result.refined)[:12]}",
            "held out": held_out_words(timeline),
            "seed": result.seed,
            **{name: value[:16] for name, value in parsed_hashes(tables).items()},
        }
    )


HOW_TO_READ = (
    "Offset: distance of the rear axle from the lane centre, positive to the left of travel.",
    "Error (before → after): the root mean square of measured minus expected over all groups of statistics, on blocks "
    "that were used neither to choose nor to fit the base, the effects or their sizes. The expectation is the mean of "
    "{n_runs} simulated runs of the profile under the same context.",
    "Between halves: the same difference between random halves of the measured blocks and all of them. At that size, "
    "no mean, spread or frequency band distinguishes the profile from the driver.",
    "p-value: how often a table without this effect would show one as strong. It is family-wise: all columns, lags "
    "and shapes that were tested count. Below {certain} it is extrapolated; read it as certain.",
    "Lag: negative if the driver looks ahead. Response: time constant of a first-order lag, after which about two "
    "thirds of the response have happened.",
)


def _add_findings(page: Page, result: LoopResult, proofs: Sequence[str]) -> None:
    page.section("What the profile lacked")
    if not result.findings:
        stays = "stays as it was given" if result.base_given else "is the base that was fitted to these drives"
        page.text(f"Nothing was added: the profile {stays}.")
        return
    for finding in result.findings:
        page.heading(_capital(finding.effect))
        page.text(loop_words.meaning(finding))
        effect = finding.effects[0] if finding.effects else None
        if not isinstance(effect, ColumnEffect):
            draw, caption = loop_figures.DRAWINGS[effect.kind if effect is not None else finding.kind]
            page.figure(draw(result, finding), caption, f"{_capital(finding.effect)}: {caption}")
        elif finding.statistic in result.scored.real:
            page.figure(
                loop_figures.effect_figure(result, finding),
                (
                    "Left: the effect as fitted, and what was measured less all else that is known."
                    if finding.passage is None
                    else "Left: where the effect puts the car while its column goes from its usual value to a high one "
                    "and back."
                )
                + " Bars and bands: two standard errors. Right: measured, and both profiles, on stretches "
                "that nothing was fitted to.",
                f"Curve of {finding.effect} over measured points, and measured against expected before and after.",
            )
    if proofs:
        page.text("In a scenario: the same stretch converted with an effect and without it, with four seeds.")
        page.items(proofs)
    applied = (
        "`sample --context` and `convert` apply it where the context has the columns, and name the columns that are "
        "missing."
        if any(finding.columns for finding in result.findings)
        else "Effects without a column are drawn anew for every simulated vehicle."
    )
    page.text(f"The refined profile `{result.refined.name}` contains what was found. {applied}")


def _add_residuals(page: Page, result: LoopResult) -> None:
    page.section(
        "What is left, by every column",
        "Measured minus expected offset where nothing was fitted, over fifths of every column and over time; the "
        "column's values stand below each panel. Within the grey band is what chance leaves (95 %).",
        folded=True,
    )
    page.text("" if result.identified.usable.columns else "The table has no column that varies.")
    for what, words in (("mean", "mean offset"), ("spread", loop_words.SPREAD)):
        if any(name.startswith(f"{what} by ") and " by effect: " not in name for name in result.scored.real):
            page.heading(_capital(words))
            page.figure(
                loop_figures.residual_figure(result, what),
                f"Residual of the {words}, before (grey) and after (orange). Columns of the effects come first.",
                f"Residual of the {words} by every context column.",
            )


def _add_movement(page: Page, result: LoopResult) -> None:
    page.section("How the profile moves beside the driver", folded=True)
    page.figure(
        loop_figures.spectrum_figure(result),
        "Power spectral density within held-out blocks. Where a profile's curve lies in the band, its movement is "
        "like the measured one at that frequency.",
        "Spectra, measured, before and after.",
    )
    scores, seconds = result.scores, (SNIPPET_ROWS - 1) * result.coarse.timeline.step
    if scores.before is None or scores.after is None or scores.floor is None:
        page.text(f"There are too few snippets of {seconds:g} s to compare metrics.")
        return
    before, after, floor = scores.before.mean, scores.after.mean, scores.floor.mean
    page.figure(
        violin_figure(scores.real, scores.sampled_after, scores.sampled_before, ("measured", "profile")),
        f"Ten metrics of stretches of {seconds:g} s: measured (left, blue), profile after (right, orange), profile "
        "before (dashed). Bars: minimum, mean, maximum. Their mean distance from the measured ones is "
        f"{before:.2f} standard deviations before and {after:.2f} after; {floor:.2f} between halves of the drives. "
        "Each is in report.json.",
        "Ten violins, measured beside the profile after and before.",
    )


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
