"""Claims, and what becomes of them: they hold, are broken, are stated by others, or nobody tests them; as a page."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from enum import StrEnum
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import msgspec

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.files.pages.page import Html, KeyFigure, Page, Tone, inline
from xosc_lateral.files.source import read_toml


class Claim(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is said of a profile or folder; `measure`: which figure shows it, within `at_least` and `at_most`."""

    id: str
    words: str
    about: Literal["profile", "folder", "any"] = "any"
    measure: str = ""
    unit: str = ""
    at_least: float | None = None
    at_most: float | None = None
    test: str = ""
    figure: str = ""  # that the package's makers found; `origin`: when, and by which command
    origin: str = ""

    @property
    def bound(self) -> str:
        """In words."""
        ends = (("at least", self.at_least), ("at most", self.at_most))
        return ", ".join(f"{word} {value:g}" for word, value in ends if value is not None)

    def allows(self, value: float) -> bool:
        """Whether a figure is what it says; NaN never is."""
        low = -float("inf") if self.at_least is None else self.at_least
        return low <= value <= (float("inf") if self.at_most is None else self.at_most)


class Contents(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a dossier says; `clauses`: part -> what it answers; `tool`: uses, what can go wrong, and what finds it;
    `process`: what else an assessor asks for, and the answer; `verdict`: what is known of verdicts on the road."""

    purpose: str = ""
    clauses: dict[str, list[str]] = {}
    claim: list[Claim] = []
    tool: list[dict[str, str]] = []
    process: list[dict[str, str]] = []
    verdict: list[tuple[str, str]] = []


class State(StrEnum):
    """What is known of a claim."""

    HOLDS = "computed here and within bounds"
    BROKEN = "broken"
    STATED = "stated, not computed here"
    UNTESTED = "without a test"


class Finding(msgspec.Struct, frozen=True):
    """A claim, its figure and where that comes from."""

    claim: Claim
    state: State
    value: float | None = None
    origin: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        value = None if self.value is None else round(self.value, 9)
        return {
            **msgspec.to_builtins(self.claim),
            "state": self.state.name.lower(),
            "value": value,
            "origin": self.origin,
        }


Measure = Callable[[Any], float | None]
"""A figure of a profile's or folder's bench; None: what it needs is not given."""


def contents_of(path: Path | None) -> Contents:
    """What ships, and claims of the user's own file, which replace those of the same id. Raises `FormatError`."""
    shipped = Path(str(files("xosc_lateral.extras.dossier") / "dossier.toml"))
    contents = _read(shipped)
    if path is None:
        return contents
    users = _read(path)
    claims = {claim.id: claim for claim in (*contents.claim, *users.claim)}
    return msgspec.structs.replace(contents, purpose=users.purpose or contents.purpose,
                                   clauses=contents.clauses | users.clauses, claim=[*claims.values()],
                                   tool=[*contents.tool, *users.tool])  # fmt: skip


def _read(path: Path) -> Contents:
    try:
        return msgspec.convert(read_toml(path, "not a file of claims"), Contents)
    except msgspec.ValidationError as error:
        raise FormatError(f"not a file of claims: {error}", path=path) from error


def known_anomalies() -> list[str]:
    """Limitations as the documentation has them, without its links."""
    text = (shipped_folder("docs") / "limitations.md").read_text(encoding="utf-8")
    points = [" ".join(point.split()) for point in text.split("\n- ")[1:]]
    return [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", point).replace("**", "") for point in points]


def judged(
    claims: Iterable[Claim],
    measures: Mapping[str, Measure],
    bench: object,
    stated: Mapping[str, float],
    computed: Container[str],
) -> list[Finding]:
    """Each claim with its figure: on the bench where its measure is to be `computed`, else as `stated` by measure.

    Raises `FormatError`: a measure that nobody knows.
    """
    findings = []
    for claim in claims:
        measure = measures.get(claim.measure)
        if claim.measure and measure is None:
            raise FormatError(
                f"no measure {claim.measure!r}; there are {', '.join(measures)}", element=f"claim {claim.id!r}"
            )
        value = measure(bench) if measure is not None and claim.measure in computed else None
        state, origin = State.HOLDS, "computed here"
        if value is None:
            value = stated.get(claim.measure)
            state = State.STATED if measure is not None else State.UNTESTED
            if value is not None:
                origin = "stated by the profile, from drives that it was not fitted to; --data TABLE: from yours"
            elif measure is not None:
                origin = "its drives are needed: --data" if claim.measure in computed else "not computed: --recompute"
            else:
                origin = claim.origin
        if value is not None and not claim.allows(value):
            state = State.BROKEN
        findings.append(Finding(claim, state, value, origin))
    return findings


def summary_of(findings: Iterable[Finding]) -> str:
    """How many claims of which state."""
    states = [finding.state for finding in findings]
    return "; ".join(f"{states.count(state)} {state.value}" for state in State if state in states)


# ---- the page: each part with the clauses that it answers ----
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
