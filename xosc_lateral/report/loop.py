"""A closed loop for a person: what was missing, how sure, how big, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from xosc_lateral.driver.effects import ColumnEffect
from xosc_lateral.formats.hashes import parsed_hashes
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.identification.close import Finding, LoopResult
from xosc_lateral.identification.held_out import SNIPPET_ROWS
from xosc_lateral.identification.residual import GroupError
from xosc_lateral.identification.selection import Rejected
from xosc_lateral.report.loop_words import (
    CERTAIN,
    COMPONENT_WORDS,
    SPREAD,
    feedback_words,
    group_words,
    lack_of_fit_words,
    meaning,
    others_words,
    outcome,
    size_words,
    taken_back_words,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from xosc_lateral.report.render import KeyFigure, Tone

NAMED_DRIVES = 3
"""So many drives are named in the title; more are counted."""

LEFT_ROWS = 8
"""Rows of the table of what is left."""

FAR, CLOSE = 2.0, 1.2
"""Ratios to the floor from which a number is marked bad, and up to which it is marked good. [-]"""


def loop_text(result: LoopResult) -> str:
    """The outcome in a few lines; what is left is worked out unless it is given."""
    lines = [f"{finding_sentence(finding)} (p = {finding.p_value:.1e})" for finding in result.findings]
    lines = lines or ["no effect added"]
    lines += [f"{taken_back_words(item)}: {item.why}" for item in result.identified.taken_back]
    for item in result.identified.usable.feedback:
        sure = "possibly a" if item.doubtful else "a"
        lines.append(f"{item.column}: {sure} consequence of the car's movement, not used as a cause")
    error = f"{result.error_before:.4f} m before, {result.error_after:.4f} m after (floor {result.floor:.4f} m)"
    lines.append(f"held-out error {error}")
    lines.append(lack_of_fit_words(result))
    return "\n".join(lines)


def finding_sentence(finding: Finding) -> str:
    """One finding in a line."""
    when = ""
    if finding.lag_s is not None:
        early = f"{-finding.lag_s:.1f} s ahead" if finding.lag_s < 0 else f"lag {finding.lag_s:.1f} s"
        when = f", {early}, response time {finding.response_s:.1f} s"
    alike = f"; {others_words(finding)} would explain it about as well" if finding.alike else ""
    size = "" if finding.kind == "memory" else f", {size_words(finding)}"
    return f"{finding.effect}: {finding.shape}{size}{when}{alike}"


def loop_page(result: LoopResult, tables: Sequence[Path], proofs: Sequence[str] = ()) -> str:
    """HTML page; same result, same bytes. `proofs`: what findings do in a scenario, in words."""
    from xosc_lateral.report.loop_json import column_record
    from xosc_lateral.report.loop_traces import traces_figure
    from xosc_lateral.report.render import render_page

    groups = sorted(result.lack_of_fit.groups, key=lambda group: -group.unexplained)[:LEFT_ROWS]
    timed = any(finding.lag_s is not None for finding in result.findings)
    return render_page(
        "loop.html",
        title=f"Closed loop: {_title(result.names)}",
        provenance=_provenance(result, tables),
        result=result,
        outcome=outcome(result),
        certain=CERTAIN,
        trace=traces_figure(result),
        snippet_s=(SNIPPET_ROWS - 1) * result.coarse.timeline.step,
        unexplained=lack_of_fit_words(result),
        numbers=_numbers(result),
        capital=_capital,
        finding_rows=[_finding_row(finding, timed) for finding in result.findings],
        proof_rows=[{"in a scenario": one} for one in proofs],
        findings=[(finding, meaning(finding, result), _pictures(result, finding)) for finding in result.findings],
        only_hidden=not any(finding.columns for finding in result.findings),
        residuals=_residuals(result),
        group_rows=[_group_row(group, result) for group in groups],
        group_tones={k: "bad" for k, group in enumerate(groups) if group.after > FAR * group.floor},
        n_groups=len(result.lack_of_fit.groups),
        n_runs=len(result.scored.runs_after),
        role_rows=[column_record(column, result) for column in sorted(result.identified.usable.roles)],
        feedback_rows=[
            {"column": item.column, "reason": feedback_words(item)} for item in result.identified.usable.feedback
        ],
        rejected_rows=[_rejected_row(item) for item in result.identified.selection.rejected],
        **_movement(result),
    )


def _provenance(result: LoopResult, tables: Sequence[Path]) -> dict[str, Any]:
    return {
        "base profile": f"{result.base.name} {profile_hash(result.base)[:12]}",
        "refined profile": f"{result.refined.name} {profile_hash(result.refined)[:12]}",
        "held out": result.held_out,
        "seed": result.seed,
        **{name: value[:16] for name, value in parsed_hashes(tables).items()},
    }


def _rejected_row(item: Rejected) -> dict[str, Any]:
    return {
        "component": COMPONENT_WORDS.get(item.component, item.component),
        "strongest candidate": ", ".join(item.columns) or None,
        "p-value": item.p_value,
        "reason": item.why,
    }


def _title(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= NAMED_DRIVES else f"{len(names)} drives"


def _numbers(result: LoopResult) -> list[KeyFigure]:
    from xosc_lateral.report.render import KeyFigure

    tone: Tone = "bad" if result.lack_of_fit.clear else "good" if result.findings else ""
    errors = (result.error_before, result.error_after, result.floor)
    before, after, floor = (f"{1000 * value:.1f} mm" for value in errors)
    return [
        KeyFigure(before, "error before", "of the base profile"),
        KeyFigure(after, "error after", "of the refined profile", tone=tone),
        KeyFigure(floor, "floor", "of random halves of the drives against all of them"),
    ]


def _finding_row(finding: Finding, timed: bool) -> dict[str, object]:
    """A row of the table of effects; lag and response only where one of them has any."""
    timing: dict[str, object] = {"lag [s]": finding.lag_s, "response [s]": finding.response_s} if timed else {}
    return {
        "effect": finding.effect,
        "shape": finding.shape,
        "size": size_words(finding),
        **timing,
        "p-value": finding.p_value,
        "error before [mm]": 1000.0 * finding.error_before,
        "error after [mm]": 1000.0 * finding.error_after,
    }


class _Picture(NamedTuple):
    figure: Figure
    caption: str
    alt: str


def _pictures(result: LoopResult, finding: Finding) -> list[_Picture]:
    from xosc_lateral.report.loop_figures import effect_figure
    from xosc_lateral.report.loop_hidden_figures import DRAWINGS, QUANTILES_CAPTION, quantiles_figure

    effect = finding.effects[0] if finding.effects else None
    if isinstance(effect, ColumnEffect):
        caption = (
            "Left: the fitted effect and the measured offsets, less the drives' own means and all other effects (bars "
            "and band: two standard errors). Right: means of held-out blocks, by fifths of the effect."
        )
        alt = f"Curve of {finding.effect} over measured points, and measured against expected before and after."
        return (
            [_Picture(effect_figure(result, finding), caption, alt)] if finding.statistic in result.scored.real else []
        )
    draw, caption = DRAWINGS[effect.kind if effect is not None else finding.kind]
    pictures = [_Picture(draw(result, finding), caption, f"{_capital(finding.effect)}: {caption}")]
    if finding.kind == "regime":
        alt = "Quantiles of the local spread, measured, before and after."
        pictures.append(_Picture(quantiles_figure(result), QUANTILES_CAPTION, alt))
    return pictures


def _residuals(result: LoopResult) -> list[tuple[str, Figure]]:
    """What is drawn, in words, and its figure."""
    from xosc_lateral.report.loop_figures import residual_figure

    return [
        (words, residual_figure(result, what))
        for what, words in (("mean", "mean offset"), ("spread", SPREAD))
        if any(name.startswith(f"{what} by ") and " by effect: " not in name for name in result.scored.real)
    ]


def _group_row(group: GroupError, result: LoopResult) -> dict[str, object]:
    return {
        "group": group_words(group.name, result),
        "before": 1000.0 * group.before,
        "after": 1000.0 * group.after,
        "floor": 1000.0 * group.floor,
        "after / floor": group.after / group.floor if group.floor > 0 else None,
    }


def _movement(result: LoopResult) -> dict[str, Any]:
    from xosc_lateral.report.loop_figures import spectrum_figure, violins_figure
    from xosc_lateral.report.violins import LABELS

    scores, values = result.scores, {"spectrum": spectrum_figure(result), "metric_rows": []}
    if scores.before is None or scores.after is None or scores.floor is None:
        return values
    before, after, floor = scores.before.by_metric, scores.after.by_metric, scores.floor.by_metric
    rows = [
        {"metric": LABELS[name], "before": before[name], "after": after[name], "floor": floor[name]} for name in before
    ]
    tones = {k: _tone(after[name], floor[name]) for k, name in enumerate(before)}
    return values | {"metric_rows": rows, "metric_tones": tones, "violins": violins_figure(result)}


def _tone(value: float, floor: float) -> Tone:
    return "bad" if value > FAR * floor else "good" if value <= CLOSE * floor else ""


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
