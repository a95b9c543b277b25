"""Profiles for people: a list, and a card each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from xosc_lateral.arrays import FloatArray
from xosc_lateral.driver.answers import basis_of, beside_line
from xosc_lateral.driver.effects import Acts, ColumnEffect, Effect
from xosc_lateral.driver.profile import SIDES, DriverProfile, Provenance
from xosc_lateral.evaluation.lane_keeping import LaneKeeping, keeping_of
from xosc_lateral.evaluation.metrics import DURATION, MovementSummary, free_runs, summarise, summary_of
from xosc_lateral.evaluation.spectra import Spectrum, spectrum
from xosc_lateral.formats.profiles import FIELDS, Entry, facts_of, profile_hash
from xosc_lateral.report.chart import SAMPLED
from xosc_lateral.report.figure import Figure
from xosc_lateral.report.page import KeyFigure, Page, format_value

CHANGED: Mapping[Acts, str] = {
    Acts.LOCATION: "mean offset",
    Acts.SPREAD: "spread",
    Acts.RATE: "rate of mean reversion",
    Acts.FINE: "fine noise",
}
"""What a column effect changes, in words."""


def list_text(entries: Sequence[Entry]) -> str:
    """One line per profile: name, model, hours, drives, effects, where from; what is wrong with a file, in a line."""
    good = [entry for entry in entries if entry.profile is not None]
    width = max((len(entry.name) for entry in good), default=0)
    lines = [_list_line(entry, width) for entry in good]
    lines += [f"! {entry.problem}" for entry in entries if entry.problem]
    for entry in entries:
        if entry.hidden_by is not None:
            shipped = "the shipped profile" if entry.is_shipped else str(entry.path)
            lines.append(f"! {entry.hidden_by} hides {shipped} {entry.name!r}")
    return "\n".join(lines) or "no profiles"


def _list_line(entry: Entry, width: int) -> str:
    profile = entry.profile
    assert profile is not None, "only those that can be read are listed"
    known = profile.provenance
    return (
        f"{entry.name:{width}s}  {profile.model.kind:14s} {known.hours:6.2f} h  {known.drives:4d} drives  "
        f"{len(profile.effects)} effects  {_tagged(profile)}{known.notes or known.source}"
    ).rstrip()


def _tagged(profile: DriverProfile) -> str:
    return "".join(f"#{tag} " for tag in profile.metadata.tags)


def list_record(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """The same as plain values."""
    return [_entry_record(entry) for entry in entries]


def _entry_record(entry: Entry) -> dict[str, Any]:
    place: dict[str, Any] = {
        "id": entry.name,
        "path": str(entry.path),
        "problem": entry.problem,
        "hidden_by": None if entry.hidden_by is None else str(entry.hidden_by),
    }
    return place if entry.profile is None else place | _profile_record(entry.profile)


def _profile_record(profile: DriverProfile) -> dict[str, Any]:
    known, metadata = profile.provenance, facts_of(profile)
    return {
        "metadata": {name: metadata[name] for name in FIELDS} | {"tags": list(profile.metadata.tags)},
        "sha256": profile_hash(profile),
        "model": profile.model.kind,
        "hours": known.hours,
        "drives": known.drives,
        "effects": len(profile.effects),
        "notes": known.notes,
        "source": known.source,
    }


def card(profile: DriverProfile) -> dict[str, Any]:
    """Everything that a person asks first, as plain values."""
    known = profile.provenance
    return {
        "id": profile.name,
        "metadata": {name: facts_of(profile)[name] for name in FIELDS} | {"tags": list(profile.metadata.tags)},
        "sha256": profile_hash(profile),
        "model": profile.model.kind,
        "effects": [effect.to_dict() for effect in profile.effects],
        "neighbours": {side: basis_of(profile, side).value for side in SIDES},
        "lane_width": profile.lane_width,
        "summary": {name: round(value, 4) for name, value in asdict(summary_of(profile)).items()},
        "lane_keeping": keeping_record(keeping_of(profile)),
        "provenance": known.to_dict(),
    }


def card_text(profile: DriverProfile) -> str:
    """The card for the terminal."""
    known, keeping = profile.provenance, keeping_of(profile)
    lines = [
        profile.name,
        *_indented("", known.notes),
        f"  model      {profile.model.kind}, {_effects(profile)}, lane width {profile.lane_width:.2f} m",
        *(f"  effect     {effect_line(effect)}" for effect in profile.effects),
        f"  neighbours {'; '.join(beside_line(profile, side) for side in SIDES)}",
        *_summary_lines(profile, summary_of(profile)),
        *_indented("lane", keeping.words),
        *_indented("sure", sureness(profile, keeping)),
        f"  fitted on  {amount(profile)}",
        *_indented("source", known.source),
        *_indented("licence", known.licence),
        *(f"  input      {name} sha256 {digest}" for name, digest in known.inputs.items()),
        *(f"  {name:10s} {value}" for name, value in provenance_items(known)),
        f"  sha256     {profile_hash(profile)}",
    ]
    return "\n".join(lines)


def provenance_items(known: Provenance) -> list[tuple[str, str]]:
    """How a closed loop came to the profile, if one did, and its evaluation on held-out drives."""
    try:
        return [*_loop_items(known.fit.get("closed_loop")), *_evaluation_items(known.evaluation)]
    except (AttributeError, KeyError, TypeError, ValueError):  # anybody may write there what they like
        return [("evaluation", "not as this package writes it")]


def _loop_items(loop: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if not loop:
        return []
    found = ", ".join(loop["found"]) or "nothing"
    return [("loop", f"started from a {loop['base']} model, seed {loop['seed']}; found: {found}")]


def _evaluation_items(evaluation: Mapping[str, Any]) -> list[tuple[str, str]]:
    items = []
    short = evaluation.get("snippets")
    if short:
        items.append(("held out", f"{evaluation.get('held_out', '')}: {_scores(short)}"))
    if evaluation.get("spectrum_error_db") is not None:
        difference = f"{evaluation['spectrum_error_db']:.1f} dB"
        items.append(
            ("spectrum", f"the driver alone differs from what was recorded by {difference} (rms over frequency bands)")
        )
    if evaluation.get("told_apart"):
        items.append(("own driver", str(evaluation["told_apart"])))
    return items


def _scores(short: Mapping[str, Any]) -> str:
    return (
        f"distance {short['mean_distance']:.3f}, between real drivers {short['mean_floor']:.3f}, "
        f"ratio {short['mean_ratio']:.2f}, worst {short['worst_metric']} {short['worst_ratio']:.2f}"
    )


def _summary_lines(profile: DriverProfile, summary: MovementSummary) -> list[str]:
    side = "left" if summary.mean_offset > 0 else "right"
    return [
        f"  mean       {abs(summary.mean_offset):.2f} m to the {side} of the lane centre",
        f"  spread     {spread_text(profile, summary)}; 90 % within {summary.low:+.2f} to {summary.high:+.2f} m",
        f"  speed      {summary.lateral_speed:.3f} m/s lateral (rms)",
    ]


def amount(profile: DriverProfile) -> str:
    """What a profile was fitted on: time, vehicles, runs."""
    known = profile.provenance
    vehicles = "1 vehicle" if known.drives == 1 else f"{known.drives} vehicles"
    return (
        f"{60 * known.hours:.1f} min, {vehicles}, {known.runs} runs"
        if known.hours < 1
        else (f"{known.hours:.2f} h, {vehicles}, {known.runs} runs")
    )


def keeping_record(keeping: LaneKeeping) -> dict[str, Any]:
    """The figures of lane keeping and their standard errors, as plain values."""
    values = asdict(keeping)
    errors = {name: round(value, 4) for name, value in values.pop("errors").items()}
    return {name: round(value, 4) for name, value in values.items()} | {"errors": errors}


def sureness(profile: DriverProfile, keeping: LaneKeeping) -> str:
    """How well one driver's mean and spread are known from so much driving; empty where it is of many or unknown."""
    known = profile.provenance
    independent = 3600.0 * known.hours / (2.0 * keeping.memory) if keeping.memory else 0.0
    if "derived_from" in known.fit or not 0.0 < known.drives < FEW or independent < 1.0:
        return ""
    mean = 1.96 * keeping.sdlp / independent**0.5
    spread = 1.96 * keeping.sdlp / (2.0 * independent) ** 0.5
    return (
        f"from {60 * known.hours:.3g} min his mean is known to +- {mean:.2f} m, his SDLP to +- {spread:.2f} m (95 %), "
        "other days apart"
    )


FEW = 10
"""Drives below which a profile is taken to be of one driver."""


def spread_text(profile: DriverProfile, summary: MovementSummary) -> str:
    """Standard deviation of the offset: of one driver, or of all and within one."""
    if profile.provenance.drives == 1:
        return f"{summary.spread:.2f} m"
    within = f"{summary.spread_within:.2f} m within one driver over {DURATION / 60:g} min"
    return f"{summary.spread:.2f} m over all drivers, {within}"


def effect_line(effect: Effect) -> str:
    """An effect in a line: what it changes, by which columns, of what shape; a hidden one by its parameters."""
    if isinstance(effect, ColumnEffect):
        lag = f", {abs(effect.lag_s):g} s {'ahead' if effect.lag_s < 0 else 'behind'}" if effect.lag_s else ""
        response = f", response time {effect.response_time:g} s" if effect.response_time else ""
        return f"{CHANGED[effect.acts]} by {' and '.join(effect.columns)} ({effect.shape}{lag}{response})"
    plain = {name: value for name, value in effect.to_dict().items() if not isinstance(value, list | dict)}
    kind = str(plain.pop("kind")).replace("-", " ")
    return f"{kind}: " + ", ".join(f"{name} {format_value(value)}" for name, value in plain.items())


def _effects(profile: DriverProfile) -> str:
    count = len(profile.effects)
    return "1 effect" if count == 1 else f"{count or 'no'} effects"


def _indented(label: str, text: str) -> list[str]:
    import textwrap

    wrapped = textwrap.wrap(text, 100)
    return [f"  {label if k == 0 else '':10s} {line}" for k, line in enumerate(wrapped)]


SHOWN_DRIVERS, SHOWN_S = 4, 120.0
"""Sample paths that are drawn, and their length. [s]"""


def card_page(profile: DriverProfile, seed: int = 0) -> str:
    """HTML page; same profile and seed, same bytes.

    Parameters
    ----------
    profile : DriverProfile
    seed : int
        Of the free runs that are drawn and summed up.
    """
    runs, step = free_runs(profile, seed), profile.model.step
    summary, known = summarise(runs, step), profile.provenance
    side = "left" if summary.mean_offset > 0 else "right"
    within = "" if known.drives == 1 else f"one driver over {DURATION / 60:g} min: {summary.spread_within:.2f} m"
    page = Page(f"Driver profile {profile.name}")
    page.lead(known.notes)
    page.key_figures(
        [
            KeyFigure(f"{abs(summary.mean_offset):.2f} m", f"mean offset, to the {side}"),
            KeyFigure(f"{summary.spread:.2f} m", "standard deviation over all drivers", within),
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
        _places(runs, spectrum(list(runs), step)),
        "Left: distribution of the offset. Right: its power spectral density.",
        "Density of the offset, and its spectrum",
    )
    page.section(
        "Model and effects",
        f"Model `{profile.model.kind}`, time step {profile.model.step} s, lane width {profile.lane_width:.2f} m.",
    )
    page.items(effect_line(effect) for effect in profile.effects)
    page.text("" if profile.effects else "The profile has no effects: it does not depend on context.")
    page.section("Where it comes from")
    facts = [("fitted on", amount(profile)), *provenance_items(known)]
    page.table([{"fact": name, "value": value} for name, value in facts])
    page.text(f"Source: {known.source}" if known.source else "")
    page.text(f"Licence of the data: {known.licence}" if known.licence else "")
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


def _places(runs: FloatArray, power: Spectrum) -> Figure:
    figure = Figure(1, 2)
    place, spectral = figure.panels
    density, edges = np.histogram(runs, np.linspace(-1.2, 1.2, 97), density=True)
    place.steps(edges, density, SAMPLED, label="density")
    spectral.line(power.frequency, power.density, SAMPLED, label="power density")
    spectral.x.log = spectral.y.log = True
    place.title, place.x.label, place.y.label = "Distribution", "offset [m], positive to the left", "density [1/m]"
    spectral.title, spectral.x.label, spectral.y.label = "Spectrum", "frequency [Hz]", "power density [m²/Hz]"
    return figure
