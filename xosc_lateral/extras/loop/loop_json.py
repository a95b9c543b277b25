"""A closed loop as strict JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

from xosc_lateral.base.numbers import NORMAL_95
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.loop.close import Finding, LoopResult
from xosc_lateral.extras.loop.identify import held_out_words
from xosc_lateral.extras.loop.loop_words import feedback_words, meaning, verdict
from xosc_lateral.extras.loop.selection import Gain
from xosc_lateral.extras.loop.shown import Shown, between_drives_of
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.files.source import parsed_hashes

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
