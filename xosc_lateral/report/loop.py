"""A closed loop for a person: what was missing, how sure, how big, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from xosc_lateral.driver.effects import ColumnEffect
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.hashes import file_hash
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.loop.close import LoopResult
from xosc_lateral.loop.findings import Finding
from xosc_lateral.loop.leftover import GroupError, Leftover, leftover_of
from xosc_lateral.report.loop_json import loop_json
from xosc_lateral.report.loop_words import (
    LOOKS,
    chance_words,
    group_words,
    leftover_words,
    meaning,
    outcome,
    size_words,
)

if TYPE_CHECKING:
    from xosc_lateral.report.page import Page, Tone

NAMED_DRIVES = 3
"""So many drives are named in the title; more are counted."""

LEFT_ROWS = 8
"""Rows of the table of what is left."""

FAR, CLOSE = 2.0, 1.2
"""Ratios to the floor from which a number is marked bad, and up to which it is marked good. [-]"""


def write_loop(result: LoopResult, leftover: Leftover, tables: Sequence[Path], folder: Path) -> None:
    """Write `report.json` and `report.html` into a folder, which is made if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "report.json", loop_json(result, leftover, tables))
    write_atomically(folder / "report.html", loop_page(result, leftover, tables).html())


def loop_text(result: LoopResult, leftover: Leftover | None = None) -> str:
    """The outcome in a few lines; what is left is worked out unless it is given."""
    lines = [f"{finding_sentence(finding)} (p = {finding.p_value:.1e})" for finding in result.findings]
    lines = lines or ["nothing found that chance would not give"]
    for item in result.trace.consequences:
        lines.append(f"{item.column}: a consequence of the car's movement, not a cause")
    error = f"{result.error_before:.4f} m before, {result.error_after:.4f} m after (floor {result.floor:.4f} m)"
    lines.append(f"held-out error {error}")
    lines.append(leftover_words(result, leftover or leftover_of(result)))
    return "\n".join(lines)


def finding_sentence(finding: Finding) -> str:
    """One finding in a line."""
    when = ""
    if finding.lag_s is not None:
        early = f"{-finding.lag_s:.1f} s ahead" if finding.lag_s < 0 else f"{finding.lag_s:.1f} s behind"
        when = f", {early}, answered within {finding.response_s:.1f} s"
    alike = f"; {', '.join(finding.alike)} would explain it as well" if finding.alike else ""
    size = "" if finding.kind == "memory" else f", {size_words(finding)}"
    return f"{finding.effect}: {finding.shape}{size}{when}{alike}"


def loop_page(result: LoopResult, leftover: Leftover, tables: Sequence[Path]) -> Page:
    """The report."""
    from xosc_lateral.report.page import Page

    page = Page(f"Closed loop: {_title(result.names)}")
    _lead(page, result, leftover)
    _findings(page, result)
    _residual(page, result, leftover)
    _movement(page, result)
    _not_found(page, result)
    _guide(page)
    return page.provenance(
        {
            "base profile": f"{result.base.name} {profile_hash(result.base)[:12]}",
            "refined profile": f"{result.refined.name} {profile_hash(result.refined)[:12]}",
            "held out": result.held_out,
            "seed": result.seed,
            **{table.name: file_hash(table)[:16] for table in tables},
        }
    )


def _title(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= NAMED_DRIVES else f"{len(names)} drives"


def _lead(page: Page, result: LoopResult, leftover: Leftover) -> None:
    from xosc_lateral.report.page import KeyFigure

    before, after, floor = result.error_before, result.error_after, result.floor
    tone: Tone = "bad" if leftover.clear else "good" if result.findings else ""
    page.lead(
        outcome(result),
        [
            KeyFigure(f"{1000 * before:.1f} mm", "error before", "profile without the effects beside the drives"),
            KeyFigure(f"{1000 * after:.1f} mm", "error after", "the same with the effects", tone=tone),
            KeyFigure(f"{1000 * floor:.1f} mm", "floor", "the drives beside themselves"),
        ],
    )
    page.lead(leftover_words(result, leftover))


def _findings(page: Page, result: LoopResult) -> None:
    page.section("What the profile lacked")
    if not result.findings:
        page.text(
            "Every look at the drives is explained by chance: the profile stays as it was fitted to these drives."
        )
        return
    page.table(
        [_finding_row(finding, any(one.lag_s is not None for one in result.findings)) for finding in result.findings],
        "Size ± two standard errors: change between the 5 % and 95 % quantile of what drives it, or amplitude. "
        "Errors on held-out blocks, by the effect's own quantity.",
        formats={"lag [s]": "+.1f", "response [s]": ".1f", "error before [mm]": ".1f", "error after [mm]": ".1f"},
    )
    for finding in result.findings:
        page.subsection(_capital(finding.effect), meaning(finding, result))
        _picture(page, result, finding)
    hidden = not any(finding.columns for finding in result.findings)
    page.text(
        f"The refined profile `{result.refined.name}` holds all of it. "
        + (
            "Effects without a column are drawn anew for every simulated vehicle."
            if hidden
            else "`sample --context` and `convert` apply it wherever their context has the columns, and say which "
            "columns they lack."
        )
    )


def _finding_row(finding: Finding, timed: bool) -> dict[str, object]:
    """A row of the table of effects; lag and response only where one of them has any."""
    timing: dict[str, object] = {"lag [s]": finding.lag_s, "response [s]": finding.response_s} if timed else {}
    return {
        "effect": finding.effect,
        "shape": finding.shape,
        "size": size_words(finding),
        **timing,
        "chance gives as much": chance_words(finding.p_value),
        "error before [mm]": 1000.0 * finding.error_before,
        "error after [mm]": 1000.0 * finding.error_after,
    }


def _picture(page: Page, result: LoopResult, finding: Finding) -> None:
    from xosc_lateral.report.loop_figures import effect_figure
    from xosc_lateral.report.loop_hidden_figures import DRAWINGS, quantiles_figure

    effect = finding.effects[0] if finding.effects else None
    if isinstance(effect, ColumnEffect):
        if finding.cell in result.real:
            page.figure(
                effect_figure(result, finding),
                "Left: the fitted effect over the drives' own means with everything else taken out (bars and band: two "
                "standard errors). Right: what blocks that were not fitted on show, by fifths of the effect.",
                f"Curve of {finding.effect} over measured points, and measured against expected before and after.",
            )
        return
    draw, caption = DRAWINGS[effect.kind if effect is not None else finding.kind]
    page.figure(draw(result, finding), caption, f"{_capital(finding.effect)}: {caption}")
    if finding.kind in ("regime", "population"):
        page.figure(
            quantiles_figure(result),
            "How often the car moves how widely, on held-out blocks.",
            "Quantiles of the local spread, measured, before and after.",
        )


def _residual(page: Page, result: LoopResult, leftover: Leftover) -> None:
    from xosc_lateral.report.loop_figures import residual_figure

    page.section(
        "Residual by context",
        "Measured minus expected on held-out blocks, by fifths of every column (by sixths of the drive for time). "
        "Below a panel: the column's values. Within the band, which chance leaves 1 time in 20, nothing is missing.",
    )
    if not result.trace.columns:
        page.text("The table holds no column that varies.")
    for what, words in (("mean", "mean offset"), ("spread", "spread within 20 s")):
        if any(name.startswith(f"{what} by ") and " by effect: " not in name for name in result.real):
            page.figure(
                residual_figure(result, leftover, what),
                f"Residual of the {words}, before (grey) and after (orange). Columns of the effects come first.",
                f"Residual of the {words} by every context column.",
            )
    groups = sorted(leftover.groups, key=lambda group: -group.unexplained)[:LEFT_ROWS]
    page.table(
        [_group_row(group, result) for group in groups],
        f"The {len(groups)} of {len(leftover.groups)} groups with most left: root mean square of measured minus "
        "expected [mm]. The rest is in `report.json`.",
        formats={"before": ".1f", "after": ".1f", "floor": ".1f", "after / floor": ".2f"},
        tones={k: "bad" for k, group in enumerate(groups) if group.after > FAR * group.floor},
    )


def _group_row(group: GroupError, result: LoopResult) -> dict[str, object]:
    return {
        "group": group_words(group.name, result),
        "before": 1000.0 * group.before,
        "after": 1000.0 * group.after,
        "floor": 1000.0 * group.floor,
        "after / floor": group.after / group.floor if group.floor > 0 else None,
    }


def _movement(page: Page, result: LoopResult) -> None:
    from xosc_lateral.report.evaluation import LABELS
    from xosc_lateral.report.loop_figures import spectrum_figure, violins_figure

    page.section("Movement", "How large the movement is at which pace, and what 10 s of it look like.")
    page.figure(
        spectrum_figure(result),
        "Power density within held-out blocks. Where the profiles lie in the band, their movement can't be told from "
        "the measured one at that pace.",
        "Spectra, measured, before and after.",
    )
    scores = result.scores
    if scores.before is None or scores.after is None or scores.floor is None:
        page.text("The drives are too short for snippets of 10 s.")
        return
    before, after, floor = scores.before.by_metric, scores.after.by_metric, scores.floor.by_metric
    page.table(
        [
            {"metric": LABELS[name], "before": before[name], "after": after[name], "floor": floor[name]}
            for name in before
        ],
        "Ten metrics of 10 s snippets: distance to the measured ones, in their standard deviations",
        formats={"before": ".3f", "after": ".3f", "floor": ".3f"},
        tones={k: _tone(after[name], floor[name]) for k, name in enumerate(before)},
    )
    page.figure(
        violins_figure(result),
        "Ten metrics of 10 s snippets: measured (left, blue), profile after (right, orange), profile before (dashed); "
        "bars: means.",
        "Ten violins, measured beside the profile after and before.",
    )


def _not_found(page: Page, result: LoopResult) -> None:
    page.section(
        "Consequences of the car's own movement",
        "These columns go with the offset as they follow from it: a steering wheel angle is not why the car moved.",
    )
    if result.trace.consequences:
        page.table([{"column": item.column, "why": item.why} for item in result.trace.consequences])
    else:
        page.text("None.")
    page.section(
        "Looked at and rejected",
        "What was asked of the drives and answered by chance (after the effects above were added), with the strongest "
        "candidate of each question.",
    )
    page.table(
        [
            {
                "question": LOOKS.get(item.look, item.look),
                "strongest": ", ".join(item.columns) or None,
                "chance": f"{100 * item.p_value:.3g} %",
                "why rejected": item.why,
            }
            for item in result.trace.tried
        ],
    )
    if result.trace.unused:
        page.items(f"`{column}` was not looked at: {why}." for column, why in result.trace.unused.items())


def _guide(page: Page) -> None:
    page.section("How to read this page")
    page.items(
        [
            "Offset: of the rear axle from the middle of the lane, positive to the left of travel.",
            "Error: root mean square, over all groups of the table above, of what the measured drives do minus what "
            "the profile's own runs do under the same context, on blocks that the profile was not fitted on. Twelve "
            "runs stand for the profile's expectation.",
            "Floor: what the drives differ from themselves by, from random halves of their blocks. An error at the "
            "floor means that no mean, spread or frequency band tells the profile from the driver.",
            "Chance: how often a table without this effect would show one as strong, all columns, lags and shapes "
            "that were tried counted in. Below 1 in 10 000 it is extrapolated: read it as certain.",
            "Lag: negative means that the driver looks ahead. Response: time in which two thirds of the answer "
            "are there.",
        ]
    )


def _tone(value: float, floor: float) -> Tone:
    return "bad" if value > FAR * floor else "good" if value <= CLOSE * floor else ""


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
