"""Drives of the protocol (docs/validation/identification.toml)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from laboratory.identification_drives import (
    baited,
    long_drive,
    short_drives,
    smoothed_tracks,
    unit,
    with_mean,
    with_spread,
)

ROUNDS = ("", "_2", "_3", "_4", "_5", "_6", "_7", "_8", "_9")
SETS = tuple(name + suffix for suffix in ROUNDS for name in ("design", "validation", "test"))
PROTOCOL = Path(__file__).parents[1] / "docs" / "validation" / "identification.toml"


def cases(protocol: dict[str, Any], which: str, share: float) -> Iterator[dict[str, Any]]:
    """Every drive of a set, in a fixed order."""
    counts, movements, first = protocol["counts"][which], protocol["movements"][which], protocol["seeds"][which]
    wanted: list[dict[str, Any]] = [{"type": "null", "name": "null"}] * max(1, round(share * counts["null"]))
    wanted += [{"type": "null_short", "name": "null, short"}] * max(1, round(share * counts["null_short"]))
    repeats = max(1, round(share * counts["effect"]))
    for bait in protocol["bait"]:
        wanted += [{"type": "bait", "name": bait["name"]}] * repeats
    for key, kind in (("kind", "effect"), ("short_kind", "effect_short")):
        for entry in protocol[key]:
            for size in entry.get("sizes", entry.get("factors")):
                what = "factor" if "factors" in entry else "size"
                accepted = [entry.get("columns", [entry["quantity"]]), *entry.get("accepted", [])]
                planted = {"type": kind, "name": entry["name"], what: size, "accepted": accepted}
                wanted += [planted] * repeats
    smoothed = which in protocol["smoothing"]["sets"]
    for place, case in enumerate(wanted):
        more = {"smoothed": True} if smoothed and place % 2 else {}
        yield {**case, "seed": first + place, "movement": movements[place % len(movements)], **more}


def bare_drive(case: dict[str, Any], protocol: dict[str, Any], seconds: float) -> pd.DataFrame:
    """A case's table before anything is planted; a long drive lasts so many seconds."""
    if case["type"].endswith("short"):
        return short_drives(protocol["drives"]["short_drives"], tuple(protocol["drives"]["short_s"]), case["seed"])
    return long_drive(case["movement"], seconds, case["seed"])


def planted_drive(case: dict[str, Any], protocol: dict[str, Any], seconds: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A case's table before and after its effect or bait is planted, smoothed where the case says so."""
    seed = case["seed"]
    table = bare = bare_drive(case, protocol, seconds)
    if case["type"] == "bait":
        table = baited(table, case["name"], seed)
    elif case["name"].startswith("slow vehicles"):
        usual = table.groupby("drive")["speed"].transform("mean")
        table = table.assign(offset=table["offset"] + case["size"] * unit(usual.to_numpy()))
    elif "size" in case:
        table = with_mean(table, case["name"], case["size"], seed)
    elif "factor" in case:
        table = with_spread(table, case["name"], case["factor"], seed)
    return bare, as_provided(case, table)


def as_provided(case: dict[str, Any], table: pd.DataFrame) -> pd.DataFrame:
    """Smoothed where the case says so."""
    return smoothed_tracks(table) if "smoothed" in case else table
