"""Profiles for people: a list, a card each, two side by side."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from xosc_lateral.driver.profile import DriverProfile, Provenance
from xosc_lateral.formats.profiles import list_profiles, profile_hash, read_profile
from xosc_lateral.loop.compare import Habits, compare_profiles, habits_of
from xosc_lateral.loop.metrics import METRICS


def list_text(folders: Sequence[Path], *, as_json: bool) -> str:
    """One line per profile: name, model, hours, drives, effects, where from."""
    facts = [_facts(path) for path in list_profiles(folders)]
    if as_json:
        return json.dumps(facts)
    if not facts:
        return "no profiles"
    width = max(len(one["name"]) for one in facts)
    return "\n".join(
        f"{one['name']:{width}s}  {one['model']:10s} {one['hours']:6.2f} h  {one['drives']:4d} drives  "
        f"{one['effects']} effects  {one['notes'] or one['source']}"
        for one in facts
    )


def _facts(path: Path) -> dict[str, Any]:
    profile = read_profile(path)
    known = profile.provenance
    return {
        "name": profile.name,
        "path": str(path),
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
        "name": profile.name,
        "sha256": profile_hash(profile),
        "model": profile.model.kind,
        "effects": [effect.to_dict() for effect in profile.effects],
        "lane_width_m": profile.lane_width,
        "habits": {name: round(value, 4) for name, value in asdict(habits_of(profile)).items()},
        "provenance": known.to_dict(),
    }


def card_text(profile: DriverProfile, *, as_json: bool = False) -> str:
    """The card for the terminal, or as JSON."""
    if as_json:
        return json.dumps(card(profile), ensure_ascii=False)
    known = profile.provenance
    lines = [
        profile.name,
        *_indented("", known.notes),
        f"  model      {profile.model.kind}, {len(profile.effects)} effects, lane {profile.lane_width:.2f} m",
        *(f"  effect     {_effect_line(effect.to_dict())}" for effect in profile.effects),
        *_habit_lines(profile, habits_of(profile)),
        f"  fitted on  {_amount(profile)}",
        *_indented("source", known.source),
        *_indented("licence", known.licence),
        *(f"  input      {name} sha256 {digest}" for name, digest in known.inputs.items()),
        *(f"  {name:10s} {value}" for name, value in _provenance_items(known)),
        f"  sha256     {profile_hash(profile)}",
    ]
    return "\n".join(lines)


def card_markdown(profile: DriverProfile) -> str:
    """The card for a document."""
    known, habits = profile.provenance, habits_of(profile)
    side = "left" if habits.mean_offset > 0 else "right"
    rows = [
        f"### `{profile.name}`",
        "",
        known.notes,
        "",
        "| | |",
        "|---|---|",
        f"| model | {profile.model.kind}, {len(profile.effects)} effects |",
        f"| fitted on | {_amount(profile)} |",
        f"| mean offset | {abs(habits.mean_offset):.2f} m to the {side} |",
        f"| spread | {_spread(profile, habits)} |",
        f"| 5 % to 95 % | {habits.low:+.2f} m to {habits.high:+.2f} m |",
        f"| lateral speed | {habits.lateral_speed:.3f} m/s rms |",
    ]
    rows += [f"| {name} | {value} |" for name, value in _provenance_items(known)]
    return "\n".join([*rows, ""])


def compare_text(one: DriverProfile, other: DriverProfile, *, seed: int, as_json: bool) -> str:
    """Habits of both, and the distance per metric."""
    habits = {profile.name: asdict(habits_of(profile, seed)) for profile in (one, other)}
    distances = compare_profiles(one, other, seed)
    if as_json:
        return json.dumps({"habits": habits, "distance": distances.by_metric, "mean": distances.mean, "seed": seed})
    lines = [f"{'':16s} {one.name:>20s} {other.name:>20s}"]
    first, second = habits.values() if len(habits) == 2 else (*habits.values(), *habits.values())
    lines += [f"{name:16s} {first[name]:20.3f} {second[name]:20.3f}" for name in first]
    lines.append(f"distance of 10 s snippets, in standard deviations of {one.name}: mean {distances.mean:.3f}")
    return "\n".join([*lines, *(f"  {name:10s} {distances.by_metric[name]:.3f}" for name in METRICS)])


def _provenance_items(known: Provenance) -> list[tuple[str, str]]:
    """How a closed loop came to the profile, if one did, and its evaluation on held-out drives."""
    items = _evaluation_items(known.evaluation)
    loop = known.fit.get("closed_loop")
    if not loop:
        return items
    found = ", ".join(loop["found"]) or "nothing"
    return [("loop", f"from a {loop['base']} model, seed {loop['seed']}; found: {found}"), *items]


def _evaluation_items(evaluation: Mapping[str, Any]) -> list[tuple[str, str]]:
    items = []
    short = evaluation.get("snippets")
    if short:
        items.append(
            (
                "held out",
                f"{evaluation.get('held_out', '')}: distance {short['mean_distance']:.3f}, floor "
                f"{short['mean_floor']:.3f}, ratio {short['mean_ratio']:.2f}, worst {short['worst_metric']} "
                f"{short['worst_ratio']:.2f}",
            )
        )
    if evaluation.get("spectrum_error_db") is not None:
        items.append(("spectrum", f"{evaluation['spectrum_error_db']:.1f} dB apart"))
    if evaluation.get("told_apart"):
        items.append(("own driver", str(evaluation["told_apart"])))
    return items


def _habit_lines(profile: DriverProfile, habits: Habits) -> list[str]:
    side = "left" if habits.mean_offset > 0 else "right"
    return [
        f"  keeps      {abs(habits.mean_offset):.2f} m to the {side} of the lane centre on average",
        f"  spread     {_spread(profile, habits)}; 90 % within {habits.low:+.2f} to {habits.high:+.2f} m",
        f"  moves      {habits.lateral_speed:.3f} m/s sideways (rms)",
    ]


def _amount(profile: DriverProfile) -> str:
    known = profile.provenance
    vehicles = "1 vehicle" if known.drives == 1 else f"{known.drives} vehicles"
    return (
        f"{60 * known.hours:.1f} min, {vehicles}, {known.runs} runs"
        if known.hours < 1
        else (f"{known.hours:.2f} h, {vehicles}, {known.runs} runs")
    )


def _spread(profile: DriverProfile, habits: Habits) -> str:
    if profile.provenance.drives == 1:
        return f"{habits.spread:.2f} m"
    return f"{habits.spread:.2f} m over all drivers, {habits.spread_within:.2f} m within one over 5 min"


def _effect_line(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items() if not isinstance(value, list | dict))


def _indented(label: str, text: str) -> list[str]:
    import textwrap

    wrapped = textwrap.wrap(text, 100)
    return [f"  {label if k == 0 else '':10s} {line}" for k, line in enumerate(wrapped)]
