"""What a profile holds of the closing look of its fit, and in words."""

from __future__ import annotations

from typing import Any

from xosc_lateral.drivers.evaluation.lane_keeping import NEAR_MARKING
from xosc_lateral.drivers.model.profile import DriverProfile

NUMBERS, LACKING = "numbers", "not_as_measured"
ZONE, ENTRIES = "time near a marking", "excursions [1/h]"


def found_in(profile: DriverProfile) -> tuple[dict[str, tuple[float, float]], list[str]]:
    """What the closing look found: numbers as measured and as sampled, and which don't come back; empty: none known."""
    look: Any = profile.provenance.fit.get("look")
    try:
        numbers = {str(name): (float(was), float(now)) for name, (was, now) in look[NUMBERS].items()}
        return numbers, [name for name in look[LACKING] if name in numbers]
    except (AttributeError, KeyError, TypeError, ValueError):  # anybody may write there what they like
        return {}, []


def in_words(profile: DriverProfile) -> str:
    """What the closing look at a profile, or at that which it was derived from, found; empty: nobody looked."""
    numbers, lacking = found_in(profile)
    driver = profile.provenance.fit.get("derived_from", profile.name)
    if lacking:
        parts = ", ".join(f"{name} {numbers[name][0]:g} becomes {numbers[name][1]:g}" for name in lacking)
        return f"{driver} does not drive as its drives do: {parts}"
    return f"{driver} drives as its drives do, in all {len(numbers)} numbers compared" if numbers else ""


def margins_in_words(profile: DriverProfile) -> str:
    """Time near a marking and excursions there, of the drives and as sampled under their context; empty: not known."""
    numbers, _ = found_in(profile)
    if "derived_from" in profile.provenance.fit or not {ZONE, ENTRIES} <= numbers.keys():
        return ""
    (share, made_share), (rate, made_rate) = numbers[ZONE], numbers[ENTRIES]
    return (
        f"within {NEAR_MARKING:g} m of a marking {share:.2%} of the time, {rate:.3g} excursions an hour, as measured; "
        f"{made_share:.2%}, {made_rate:.3g} as sampled"
    )
