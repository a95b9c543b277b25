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
from xosc_lateral.report.loop_json import loop_json

if TYPE_CHECKING:
    from xosc_lateral.report.page import Page


def write_loop(result: LoopResult, tables: Sequence[Path], folder: Path) -> None:
    """Write `report.json` and `report.html` into a folder, which is made if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "report.json", loop_json(result, tables))
    write_atomically(folder / "report.html", loop_page(result, tables).html())


def loop_text(result: LoopResult) -> str:
    """The outcome in a few lines."""
    lines = [f"{finding_sentence(finding)} (p = {finding.p_value:.1e})" for finding in result.findings]
    lines = lines or ["nothing found that chance would not give"]
    for item in result.trace.consequences:
        lines.append(f"{item.column}: a consequence of the car's movement, not a cause")
    error = f"{result.error_before:.4f} m before, {result.error_after:.4f} m after (floor {result.floor:.4f} m)"
    lines.append(f"held-out error {error}")
    return "\n".join(lines)


def finding_sentence(finding: Finding) -> str:
    """One finding in words."""
    about = f" +- {2 * finding.size_error:.2g}" if finding.size_error else ""
    size = {
        "location": f"{finding.size_m:+.2f}{about} m between the 5 % and 95 % quantile",
        "scale": f"spread changes by a factor of {finding.size_m:.2f}{about}",
        "dynamics": f"restoring strength changes by a factor of {finding.size_m:.2f}{about}",
        "regime": f"spread is {finding.size_m:.2f}{about} times larger while it is on",
        "periodic": f"amplitude {finding.size_m:.2f}{about} m",
        "drift": f"{finding.size_m:.2f}{about} m (standard deviation)",
        "step": f"{finding.size_m:+.2f}{about} m",
        "population": f"their means by {finding.size_m:.2f}{about} m (standard deviations)",
    }.get(finding.kind, "")
    when = ""
    if finding.lag_s is not None:
        early = f"{-finding.lag_s:.1f} s ahead" if finding.lag_s < 0 else f"{finding.lag_s:.1f} s behind"
        when = f", {early}, answered within {finding.response_s:.1f} s"
    alike = f"; {', '.join(finding.alike)} would explain it as well" if finding.alike else ""
    return ", ".join(part for part in (f"{finding.effect}: {finding.shape}", size) if part) + when + alike


def loop_page(result: LoopResult, tables: Sequence[Path]) -> Page:
    """The report."""
    from xosc_lateral.report.page import Page

    page = Page(f"Closed loop: {', '.join(result.names[:3])}{' …' if len(result.names) > 3 else ''}")
    _lead(page, result)
    _findings(page, result)
    _residual(page, result)
    _movement(page, result)
    _not_found(page, result)
    return page.provenance(
        {
            "base profile": f"{result.base.name} {profile_hash(result.base)[:12]}",
            "refined profile": f"{result.refined.name} {profile_hash(result.refined)[:12]}",
            "held out": result.held_out,
            "seed": result.seed,
            **{table.name: file_hash(table)[:16] for table in tables},
        }
    )


def _lead(page: Page, result: LoopResult) -> None:
    from xosc_lateral.report.page import KeyFigure

    number = len(result.findings)
    words = (
        "Nothing was found that chance would not give." if not number else f"{number} effect{'s' * (number > 1)} found."
    )
    page.lead(
        f"{words} The error is what differs between the measured drives and the profile's own runs under the same "
        "context, on stretches that the profile was not fitted on; the floor is what the measured drives differ from "
        "themselves.",
        [
            KeyFigure(f"{100 * result.error_before:.2f} cm", "error before"),
            KeyFigure(f"{100 * result.error_after:.2f} cm", "error after", tone="good" if number else ""),
            KeyFigure(f"{100 * result.floor:.2f} cm", "floor"),
        ],
    )


def _findings(page: Page, result: LoopResult) -> None:
    from xosc_lateral.report.loop_figures import cells_figure, effect_figure

    page.section("What the profile lacked")
    if not result.findings:
        page.text(
            "Every look at the drives is explained by chance: the profile stays as it is, fitted to these drives."
        )
        return
    page.table(
        [
            {
                "effect": finding.effect,
                "kind": finding.kind,
                "size": finding.size_m,
                "standard error": finding.size_error,
                "lag [s]": finding.lag_s,
                "response [s]": finding.response_s,
                "chance of error": finding.p_value,
                "error before [m]": finding.error_before,
                "error after [m]": finding.error_after,
            }
            for finding in result.findings
        ],
        "Size: change between the 5 % and 95 % quantile of what drives it, or amplitude [m]; a factor for spread.",
        formats={"chance of error": ".1e", "error before [m]": ".4f", "error after [m]": ".4f"},
    )
    for finding in result.findings:
        page.subsection(finding.effect, finding_sentence(finding) + ".")
        if finding.effects and isinstance(finding.effects[0], ColumnEffect) and finding.cell in result.real:
            page.figure(
                effect_figure(result, finding),
                "Left: the effect with its uncertainty. Right: held-out blocks, by fifths of the effect.",
                f"Curve of {finding.effect}, and measured against expected before and after.",
            )
        elif finding.cell in result.real:
            page.figure(cells_figure(result, finding.cell), f"Held-out blocks: {finding.measure}.", finding.measure)


def _residual(page: Page, result: LoopResult) -> None:
    from xosc_lateral.report.loop_figures import residual_figure

    page.section(
        "Residual by context",
        "Measured minus expected on held-out blocks, by fifths of every column. Flat at zero: nothing is missing.",
    )
    if not result.trace.columns:
        page.text("The table holds no column that varies.")
        return
    for what in ("mean", "spread"):
        page.figure(
            residual_figure(result, what),
            f"Residual of the {what} before (grey) and after (blue).",
            f"Residual of the {what} of the offset by every context column.",
        )


def _movement(page: Page, result: LoopResult) -> None:
    from xosc_lateral.report.loop_figures import spectrum_figure

    page.section("Movement")
    page.figure(spectrum_figure(result), "Power density on held-out blocks.", "Spectra, measured, before and after.")
    scores = result.scores
    if scores.before is None or scores.after is None or scores.floor is None:
        page.text("The drives are too short for snippets of 10 s.")
        return
    rows = [
        {
            "metric": name,
            "before": scores.before.by_metric[name],
            "after": scores.after.by_metric[name],
            "floor": scores.floor.by_metric[name],
        }
        for name in scores.before.by_metric
    ]
    page.table(
        rows,
        "Ten metrics of 10 s snippets: distance to the measured ones, in their standard deviations",
        formats={"before": ".3f", "after": ".3f", "floor": ".3f"},
    )
    _violins(page, result)


def _violins(page: Page, result: LoopResult) -> None:
    from xosc_lateral.loop.scores import PartEvaluation
    from xosc_lateral.report.evaluation import violin_figure

    scores = result.scores
    for number, (word, sampled, distances) in enumerate(
        (("before", scores.sampled_before, scores.before), ("after", scores.sampled_after, scores.after)), start=1
    ):
        if distances is None:
            continue
        part = PartEvaluation(number, "sampled", "sampled", scores.real, sampled, distances)
        page.figure(violin_figure(part), f"Metrics {word}: measured left, profile right.", f"Ten violins {word}.")


def _not_found(page: Page, result: LoopResult) -> None:
    page.section("Consequences of the car's own movement", "They go with the offset because they follow from it.")
    page.table([{"column": item.column, "why": item.why} for item in result.trace.consequences], "Consequences")
    page.section("Looked at and rejected")
    page.table(
        [
            {
                "look": item.look,
                "best candidate": ", ".join(item.columns) or "-",
                "chance of error": item.p_value,
                "why": item.why,
            }
            for item in result.trace.tried
        ],
        "Best candidate of each look that did not pass, in the last round",
        formats={"chance of error": ".2g"},
    )
    if result.trace.unused:
        page.items(f"`{column}` was not looked at: {why}." for column, why in result.trace.unused.items())
