"""The dossier as a page: each part with the clauses that it answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from xosc_lateral.extras.dossier.claims import Contents, Finding, State, known_anomalies, summary_of
from xosc_lateral.files.pages.page import Html, KeyFigure, Page, Tone, inline

TITLES = {
    "validity": "Validity by frequency, speed, lane width, road",
    "data": "Data, licence, uncertainty",
    "verdict": "How much a verdict may change",
}
"""Parts that are tables of two columns."""

_COLOURS = {State.HOLDS: "good", State.BROKEN: "bad", State.STATED: "ink", State.UNTESTED: "muted"}
"""Of a page's own, which are legible in light and dark."""


def dossier_page(
    subject: str,
    contents: Contents,
    findings: Sequence[Finding],
    parts: Mapping[str, Sequence[tuple[str, str]]],
    versions: Mapping[str, str],
) -> str:
    """HTML; equal values, equal bytes. `parts`: what is known besides the claims, by part."""
    page = Page(f"Dossier: {subject}")
    page.lead(f"{len(findings)} claims: {summary_of(findings)}.")
    tones: dict[State, Tone] = {State.BROKEN: "bad", State.HOLDS: "good"}
    page.key_figures(
        KeyFigure(
            one.value, one.claim.id.replace("-", " "), f"{one.claim.unit}: {one.claim.bound}", tones.get(one.state, "")
        )
        for one in findings
        if one.value is not None
    )
    for finding in findings:
        if finding.state is State.BROKEN:
            page.warning(f"Broken claim: {finding.claim.words}")

    def begin(part: str, title: str) -> None:
        what = f"Answers: {'; '.join(contents.clauses.get(part, ['no clause']))}."
        page.section(title, what, folded=part not in ("purpose", "claims"))

    begin("purpose", "Purpose and scope")
    page.text(contents.purpose)
    begin("claims", "Claims, and what shows them")
    page.table([_claim_row(finding) for finding in findings])
    for part, title in TITLES.items():
        begin(part, title)
        page.table([{"": name, "what is known": words} for name, words in parts[part]])
    begin("anomalies", "Known anomalies")
    page.items(known_anomalies())
    begin("tool", "Tool classification, as proposed")
    page.text(
        "Impact, detection and confidence level follow from your own use: those below hold where the check that is "
        "named is part of it, and its result is looked at."
    )
    page.table(contents.tool)
    begin("process", "Documentation, process and people")
    page.table(contents.process)
    begin("versions", "Versions and hashes")
    page.table([{"": name, "version": words} for name, words in versions.items()])
    return page.html({"subject": subject, "versions": dict(versions)})


def _claim_row(finding: Finding) -> dict[str, object]:
    claim, value = finding.claim, finding.value
    return {
        "claim": claim.words,
        "state": Html(f'<strong style="color:var(--{_COLOURS[finding.state]})">{inline(finding.state)}</strong>'),
        "figure": claim.figure if value is None else f"{value:.3g} {claim.unit}",
        "bound": claim.bound,
        "from": finding.origin,
        "test": Html(escape(claim.test).replace("/", "/<wbr>").replace("_", "_<wbr>")) if claim.test else "none",
    }
