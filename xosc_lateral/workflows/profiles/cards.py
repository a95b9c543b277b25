"""Profiles for people: a list, and a card each."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.texts import counted, hours_in_words
from xosc_lateral.drivers.evaluation import look_words
from xosc_lateral.drivers.evaluation.lane_keeping import LaneKeeping, MovementSummary, figures_of
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.drivers.evaluation.spectra import spectrum
from xosc_lateral.drivers.model.profile import SIDES, DriverProfile, Provenance
from xosc_lateral.files.pages.chart import SAMPLED
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import KeyFigure, Page
from xosc_lateral.files.profiles import FIELDS, Entry, facts_of, profile_hash
from xosc_lateral.workflows.profiles.effect_words import effect_line, side_of

SINGLE_DRIVER_DRIVES = 10  # Drives below which a profile is taken to be of one driver.
SHOWN_DRIVERS, SHOWN_S = 4, 120.0  # Sample paths that are drawn, and their length. [s]
WRAPPED_ROWS = (
    "",
    "valid",
    "lane",
    "margins",
    "look",
    "+-",
    "source",
    "licence",
)  # Rows of a card that are wrapped in the terminal.


# ---- the list --------------------------------------------------------------------------------------------------------
def list_text(entries: Sequence[Entry]) -> str:
    """One line per profile: name, model, hours, drives, effects, where from; what is wrong with a file, in a line."""
    width = max((len(entry.name) for entry in entries if entry.profile is not None), default=0)
    lines = [_list_line(entry.name, entry.profile, width) for entry in entries if entry.profile is not None]
    lines += [f"! {entry.problem}" for entry in entries if entry.problem]
    lines += [
        f"! {entry.hidden_by} hides {'the shipped profile' if entry.is_shipped else entry.path} {entry.name!r}"
        for entry in entries
        if entry.hidden_by is not None
    ]
    return "\n".join(lines) or "no profiles"


def _list_line(name: str, profile: DriverProfile, width: int) -> str:
    known, tags = profile.provenance, "".join(f"#{tag} " for tag in profile.metadata.tags)
    licence = f" [{profile.metadata.licence}]" if profile.metadata.licence else ""
    return (
        f"{name:{width}s}  {profile.model.kind:14s} {known.hours:6.2f} h  {known.drives:4d} drives  "
        f"{len(profile.effects)} effects  {tags}{noted(profile) or known.source}{licence}"
    ).rstrip()


def list_record(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """The same as plain values."""
    return [
        {
            "id": entry.name,
            "path": str(entry.path),
            "problem": entry.problem,
            "hidden_by": None if entry.hidden_by is None else str(entry.hidden_by),
            **({} if entry.profile is None else _listed(entry.profile)),
        }
        for entry in entries
    ]


def _listed(profile: DriverProfile) -> dict[str, Any]:
    known = {name: getattr(profile.provenance, name) for name in ("hours", "drives", "notes", "source")}
    return {**_identity(profile), **known, "effects": len(profile.effects)}


def _identity(profile: DriverProfile) -> dict[str, Any]:
    facts = facts_of(profile)
    return {
        "metadata": {name: facts[name] for name in FIELDS} | {"tags": list(profile.metadata.tags)},
        "sha256": profile_hash(profile),
        "model": profile.model.kind,
    }


# ---- one profile -----------------------------------------------------------------------------------------------------
def card(profile: DriverProfile) -> dict[str, Any]:
    """Everything that a person asks first, as plain values."""
    return {
        "id": profile.name,
        "validity": profile.validity.to_dict(),
        **_identity(profile),
        "effects": [effect.to_dict() for effect in profile.effects],
        "neighbours": {side: profile.basis_of(side).value for side in SIDES},
        "lane_width": profile.lane_width,
        **figures_record(*figures_of(profile)),
        "provenance": profile.provenance.to_dict(),
    }


def figures_record(summary: MovementSummary, keeping: LaneKeeping) -> dict[str, Any]:
    """The figures by which a profile is known, as plain values to 0.1 mm and the like."""

    def rounded(values: Mapping[str, float]) -> dict[str, float]:
        return {name: round(value, 4) for name, value in values.items()}

    values = asdict(keeping)
    errors = rounded(values.pop("errors"))
    return {"summary": rounded(asdict(summary)), "lane_keeping": {**rounded(values), "errors": errors}}


def card_text(profile: DriverProfile) -> str:
    """The card for the terminal."""
    lines = [profile.name]
    for label, value in [("", noted(profile)), *card_rows(profile, *figures_of(profile))]:
        parts = textwrap.wrap(value, 100) if label in WRAPPED_ROWS else [value]
        lines += [f"  {label if k == 0 else '':10s} {part}" for k, part in enumerate(parts)]
    return "\n".join([*lines, f"  {'sha256':10s} {profile_hash(profile)}"])


def noted(profile: DriverProfile) -> str:
    """The notes; a deviation in them is that of the recording, which is shorter than what a profile is measured by."""
    return re.sub(r"\(std ([\d.]+ m)\)", r"(std \1 in the recording)", profile.provenance.notes)


def card_rows(profile: DriverProfile, summary: MovementSummary, keeping: LaneKeeping) -> list[tuple[str, str]]:
    """What there is to know of a profile, a line each: label and words; an empty one has nothing to say."""
    known = profile.provenance
    effects = f"{len(profile.effects) or 'no'} effect{'s' * (len(profile.effects) != 1)}"
    rows = [
        ("valid", profile.validity.in_words()),
        ("model", f"{profile.model.kind}, {effects}, lane width {profile.lane_width:.2f} m"),
        *(("effect", effect_line(effect, profile.effects)) for effect in profile.effects),
        ("neighbours", profile.responses_in_words()),
        ("maneuvers", "" if profile.maneuvers is None else profile.maneuvers.in_words()),
        ("mean", f"{keeping.line('mean', 'm')}, {side_of(keeping.mean)} of the lane centre"),
        ("spread", f"{_spread(known, summary)}; 90 % within {summary.low:+.2f} to {summary.high:+.2f} m"),
        ("speed", f"{summary.lateral_speed:.3f} m/s lateral (rms)"),
        ("lane", keeping.words),
        ("margins", look_words.margins_in_words(profile)),
        ("look", look_words.in_words(profile)),
        ("+-", interval_note(profile) if keeping.errors else ""),
        ("fitted on", _amount(known)),
        ("source", known.source),
        ("licence", known.licence),
        *(("input", f"{name} sha256 {digest}") for name, digest in known.inputs.items()),
        *_outcome(known),
    ]
    return [(label, words) for label, words in rows if words]


def _spread(known: Provenance, summary: MovementSummary) -> str:
    """Standard deviation of the offset: of one driver, or of all."""
    return f"{summary.spread:.2f} m{'' if known.drives == 1 else ' over all drivers'}"


def interval_note(profile: DriverProfile) -> str:
    """What the intervals beside a profile's figures say."""
    known = profile.provenance
    more = "; on another day the same driver may differ by more" if known.drives < SINGLE_DRIVER_DRIVES else ""
    return f"95 %: if as much driving as it was fitted on ({_amount(known)}) were recorded again{more}"


def _amount(known: Provenance) -> str:
    """What a profile was fitted on: time, vehicles, runs."""
    return f"{hours_in_words(known.hours)}, {counted(known.drives, 'vehicle')}, {counted(known.runs, 'run')}"


def _outcome(known: Provenance) -> Iterator[tuple[str, str]]:
    """How a closed loop came to the profile, if one did, and its evaluation on held-out drives."""
    try:
        evaluation = known.evaluation
        if loop := known.fit.get("closed_loop"):
            names = ", ".join(loop["found"]) or "nothing"
            yield "loop", f"started from a {loop['base']} model, seed {loop['seed']}; found: {names}"
        if short := evaluation.get("snippets"):
            scores = (
                f"distance {short['mean_distance']:.3f}, between real drivers {short['mean_floor']:.3f}, "
                f"ratio {short['mean_ratio']:.2f}, worst {short['worst_metric']} {short['worst_ratio']:.2f}"
            )
            yield "held out", f"{evaluation.get('held_out', '')}: {scores}"
        if (error := evaluation.get("spectrum_error_db")) is not None:
            yield "spectrum", f"differs from what was recorded by {error:.1f} dB (rms over frequency bands)"
        if evaluation.get("told_apart"):
            yield "own driver", str(evaluation["told_apart"])
    except (AttributeError, KeyError, TypeError, ValueError):  # anybody may write there what they like
        yield "evaluation", "not as this package writes it"


# ---- the page --------------------------------------------------------------------------------------------------------
def card_page(profile: DriverProfile, seed: int = 0) -> str:
    """HTML page; same profile and seed (of the free runs that are drawn), same bytes."""
    runs, step = free_runs(profile, seed), profile.model.step
    (summary, keeping), known = figures_of(profile, seed), profile.provenance
    page = Page(f"Driver profile {profile.name}")
    look = look_words.in_words(profile)
    page.lead(f"{look}." if look else "", noted(profile))
    page.key_figures(
        [
            KeyFigure(f"{keeping.mean:+.2f} m", f"mean offset: {side_of(keeping.mean)} of the lane centre"),
            KeyFigure(f"{keeping.sdlp:.2f} m", "SDLP: standard deviation within a drive", _spread(known, summary)),
            KeyFigure(
                f"{summary.low:+.2f} to {summary.high:+.2f}\N{NO-BREAK SPACE}m",
                "5 % to 95 %",
                "positive: left of the lane centre",
            ),
            KeyFigure(f"{summary.lateral_speed:.3f} m/s", "lateral speed", "root mean square"),
        ]
    )
    page.section("Sample paths")
    page.figure(
        _paths(runs, step),
        "Offsets of drivers drawn from the profile, in steady traffic on a straight road.",
        "Offsets over time of several sampled drivers",
    )
    page.section("Distribution and spectrum")
    page.figure(
        _places(runs, step),
        "Left: distribution of the offset. Right: its power spectral density.",
        "Density of the offset, and its spectrum",
    )
    page.section("What it is and where it comes from")
    rows = [{"": label, "what is known": words} for label, words in card_rows(profile, summary, keeping)]
    page.table([{name: text.replace("+-", "±") for name, text in row.items()} for row in rows if row[""] != "input"])
    return page.html(
        {
            "profile sha256": profile_hash(profile),
            "inputs": {name: digest[:12] for name, digest in known.inputs.items()},
            "seed of the free runs": seed,
        }
    )


def _paths(runs: FloatArray, step: float) -> Figure:
    shown = runs[:SHOWN_DRIVERS, : round(SHOWN_S / step) + 1]
    figure = Figure(len(shown), height=48.0, share_x="all", share_y="all")
    for number, (panel, run) in enumerate(zip(figure.panels, shown, strict=True), start=1):
        panel.level()
        panel.line(step * np.arange(len(run)), run, SAMPLED, label=f"driver {number}")
        panel.title, panel.x.label = f"Driver {number}", "time [s]"
    figure.panels[len(shown) // 2].y.label = "offset [m]"
    return figure


def _places(runs: FloatArray, step: float) -> Figure:
    figure = Figure(1, 2)
    place, spectral = figure.panels
    density, edges = np.histogram(runs, np.linspace(-1.2, 1.2, 97), density=True)
    place.steps(edges, density, SAMPLED, label="density")
    power = spectrum(list(runs), step)
    spectral.line(power.frequency, power.density, SAMPLED, label="power density")
    spectral.x.log = spectral.y.log = True
    place.title, place.x.label, place.y.label = "Distribution", "offset [m], positive to the left", "density [1/m]"
    spectral.title, spectral.x.label, spectral.y.label = "Spectrum", "frequency [Hz]", "power density [m²/Hz]"
    return figure
