"""Tables of docs/validation/identification.md from the outcomes of `identification_study`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import NORMAL_95

Outcomes = list[dict[str, Any]]


def right(outcome: dict[str, Any]) -> bool:
    """Whether the planted thing is named."""
    kind, accepted = _planted(outcome)
    if outcome["name"] == "both neighbours":
        return all(any(columns == [one] for _, columns, *_ in outcome["named"]) for one in outcome["accepted"][0])
    return any(k == kind and columns in accepted for k, columns, *_ in outcome["named"])


def false(outcome: dict[str, Any]) -> list[Any]:
    """What is named and was not planted."""
    kind, accepted = _planted(outcome)
    if outcome["name"] == "both neighbours":
        accepted += [[one] for one in outcome["accepted"][0]]
    return [one for one in outcome["named"] if not (one[0] == kind and one[1] in accepted) and not _lane(outcome, one)]


def undecided(outcome: dict[str, Any], named: list[Any]) -> bool:
    """Whether what was planted is among what a finding says would explain about as much."""
    kind, accepted = _planted(outcome)
    return named[0] == kind and any(columns in accepted for columns in (named[4] if len(named) > 4 else ()))


def wrong(outcome: dict[str, Any]) -> list[Any]:
    """What is named, was not planted, and is not said to be undecided between the two."""
    return [one for one in false(outcome) if not undecided(outcome, one)]


def _planted(outcome: dict[str, Any]) -> tuple[str, list[list[str]]]:
    """Kind of what was planted, and the sets of columns that name it; none where nothing was."""
    kind = "scale" if "factor" in outcome else "location"
    return kind, [sorted(columns) for columns in outcome.get("accepted", [])]


def _lane(outcome: dict[str, Any], named: list[Any]) -> bool:
    """Whether a finding is what all short drives hold: the left lane's vehicles keep 0.08 m further right.

    Between drives any column tells the lane that is there, or wider, in one of the two lanes only.
    """
    tells = ("lane_index", "lane_width", "speed", "left_distance", "right_distance", "left_is_truck", "right_is_truck")
    return outcome["type"].endswith("short") and named[3] == "between" and set(named[1]) <= set(tells)


def table(outcomes: list[dict[str, Any]]) -> str:
    """Markdown: per kind and size, the oracle's z, how many are named, what is false."""
    lines = [
        "| drives | size | drives | oracle z (median) | z >= 5 | of these named | all named | something false |",
        "|---|---|---|---|---|---|---|---|",
    ]
    groups: dict[tuple[str, Any], list[dict[str, Any]]] = {}
    for one in outcomes:
        groups.setdefault((one["name"], one.get("size", one.get("factor", ""))), []).append(one)
    for (name, size), own in groups.items():
        z = [abs(one["oracle_z"]) for one in own if "oracle_z" in one]
        seen = [one for one in own if abs(one.get("oracle_z", 0.0)) >= 5.0]
        named = sum(right(one) for one in seen) if seen else ""
        hits = sum(right(one) for one in own) if "accepted" in own[0] else ""
        something = sum(bool(wrong(one)) for one in own)
        median = f"{np.median(z):.1f}" if z else ""
        lines.append(
            f"| {name} | {size} | {len(own)} | {median} | {len(seen) if z else ''} | {named} | {hits} | {something} |"
        )
    return "\n".join(lines)


def calibration(outcomes: list[dict[str, Any]]) -> str:
    """p-values on nulls, and cover of the intervals."""
    p = np.array([one["p"]["mean"] for one in outcomes if one["type"].startswith("null") and "mean" in one["p"]])
    told = [one for one in outcomes if "oracle_size" in one]
    cover = (
        np.mean([abs(one["oracle_size"] - one["size"]) <= NORMAL_95 * one["oracle_error"] for one in told])
        if told
        else math.nan
    )
    found = [one for one in told if "found_size" in one and right(one)]
    own = (
        np.mean([abs(one["found_size"] - one["size"]) <= NORMAL_95 * one["found_error"] for one in found])
        if found
        else math.nan
    )
    quantiles = ", ".join(f"{value:.2f}" for value in np.quantile(p, [0.1, 0.25, 0.5, 0.75, 0.9])) if len(p) else ""
    return (
        f"p-values of the mean on {len(p)} nulls: 10, 25, 50, 75, 90 % quantiles {quantiles}; "
        f"below 0.05: {(p < 0.05).mean() if len(p) else 0:.2f}. "
        f"95 % intervals: told {cover:.2f} of {len(told)}, found {own:.2f} of {len(found)}."
    )


def summary(outcomes: Outcomes) -> str:
    """Markdown: what was asked, for long and short drives, as they are and smoothed."""
    groups: dict[str, Outcomes] = {}
    for one in sorted(outcomes, key=lambda one: (one["type"].endswith("short"), "smoothed" in one)):
        name = "tables of short drives" if one["type"].endswith("short") else "long drives"
        groups.setdefault(name + (", smoothed" if "smoothed" in one else ""), []).append(one)
    lines = [f"| | asked | {' | '.join(groups)} |", "|---" * (2 + len(groups)) + "|"]
    for name, asked, told in ROWS:
        lines.append(f"| {name} | {asked} | {' | '.join(told(own) for own in groups.values())} |")
    return "\n".join(lines)


def _between(outcomes: Outcomes, least: float, most: float = math.inf) -> Outcomes:
    return [one for one in outcomes if least <= abs(one.get("oracle_z", 0.0)) < most]


def _named(outcomes: Outcomes) -> str:
    share = f" ({100 * sum(map(right, outcomes)) / len(outcomes):.0f} %)" if len(outcomes) >= 20 else ""
    return f"{sum(map(right, outcomes))} of {len(outcomes)}{share}" if outcomes else ""


def _wrong(outcomes: Outcomes) -> str:
    return f"{sum(bool(wrong(one)) for one in outcomes)} of {len(outcomes)}"


def _undecided(outcomes: Outcomes) -> str:
    return str(sum(bool(false(one)) and not wrong(one) for one in outcomes) or "")


def _held(outcomes: Outcomes) -> str:
    found = [one for one in outcomes if "found_size" in one and right(one)]
    held = sum(abs(one["found_size"] - one["size"]) <= NORMAL_95 * one["found_error"] for one in found)
    return f"{100 * held / len(found):.0f} % of {len(found)}" if found else ""


def _vetoed(outcomes: Outcomes) -> str:
    alone = [one | {"named": [finding]} for one in outcomes for finding in one.get("vetoed", [])]
    return f"{sum(not false(one) for one in alone)} and {sum(bool(false(one)) for one in alone)}" if alone else ""


def _share(outcomes: Outcomes) -> str:
    found = [abs(one["found_size"]) / one["size"] for one in outcomes if "found_size" in one and right(one)]
    return f"{np.median(found):.2f}" if found else ""


ROWS: tuple[tuple[str, str, Callable[[Outcomes], str]], ...] = (
    ("named where the oracle's z is 5 or more", "19 of 20", lambda own: _named(_between(own, 5.0))),
    ("of these with z from 5 to 6", "", lambda own: _named(_between(own, 5.0, 6.0))),
    ("from 6 to 7", "", lambda own: _named(_between(own, 6.0, 7.0))),
    ("beyond 7", "", lambda own: _named(_between(own, 7.0))),
    ("z from 3 to 5", "", lambda own: _named(_between(own, 3.0, 5.0))),
    (
        "spread changed by a factor of 1.3 to 2 (or 0.75 to 0.5)",
        "",
        lambda own: _named([one for one in own if "factor" in one]),
    ),
    (
        "something named where nothing acts, or a bait does",
        "1 in 20",
        lambda own: _wrong([one for one in own if not one["type"].startswith("effect")]),
    ),
    (
        "something wrong beside what acts",
        "1 in 40",
        lambda own: _wrong([one for one in own if one["type"].startswith("effect")]),
    ),
    (
        "what acts is told only as what would explain about as much as something else",
        "",
        lambda own: _undecided([one for one in own if one["type"].startswith("effect")]),
    ),
    ("significant, and vetoed by held-out rows: right ones and wrong ones", "", _vetoed),
    ("95 % intervals that hold the size", "95 %", _held),
    ("size found, share of the planted one (median)", "1", _share),
)
"""What is counted, what was asked, and how it is told."""
