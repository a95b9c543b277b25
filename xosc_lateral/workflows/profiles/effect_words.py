"""An effect in words, the same everywhere: what is different, by how much, as what goes from where to where."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect
from xosc_lateral.drivers.model.effects.ends import Ends, ends_of
from xosc_lateral.files.pages.page import format_value

GAP = "\N{NO-BREAK SPACE}"  # Between a number and its unit: they stay on one line.
TARGET_WORDS: Mapping[Acts, str] = {
    Acts.LOCATION: "mean offset",
    Acts.SPREAD: "spread",
    Acts.RATE: "rate of mean reversion",
    Acts.FINE: "fine noise",
}
"""What a column effect changes, in words."""
FACTOR_WORDS: Mapping[Acts, str] = {
    Acts.SPREAD: "times as much movement about the mean",
    Acts.RATE: "times as fast back to the mean",
    Acts.FINE: "times as much fine noise",
}
# Signs that a reader has to know.
HINTS: Mapping[str, str] = {
    "curvature": "positive in left bends",
    "crossfall": "positive: falls to the right",
    "grade": "positive: rises ahead",
    "lane_index": "0 is the rightmost lane",
    "wind_direction": "90: blows to the left",
}


def plain_unit(column: str) -> str:
    """Unit of a column, as a person reads it; empty: it has none, or none is known."""
    return CONTEXT_UNITS.get(column, "").replace("m/s2", "m/s²").replace("-", "")


def side_of(shift: float) -> str:
    """To which side a shift is."""
    return "left" if shift > 0 else "right"


def change_words(acts: Acts, change: float, error: float = 0.0) -> str:
    """What is different, with two standard errors where they are known: `change` in [m], or a natural logarithm."""
    size = abs(change) if acts is Acts.LOCATION else float(np.exp(change))
    about = f"{GAP}±{GAP}{2.0 * error * (1.0 if acts is Acts.LOCATION else size):.2f}" if error else ""
    if acts is Acts.LOCATION:
        return f"{size:.2f}{about}{GAP}m further {side_of(change)}"
    return f"{size:.2f}{about} {FACTOR_WORDS[acts]}"


def where_words(ends: Ends) -> str:
    """From where to where a column goes, and where the other one stays."""
    (column, low), *beside = ends.low.items()
    high = ends.high[column]
    if (low, high) == (0.0, 1.0):
        words = f"while `{column}` is on"
    else:
        words = f"as `{column}` goes from {_value(low)} to {_value(high)} {plain_unit(column)}".rstrip()
    words += f" ({HINTS[column]})" if column in HINTS else ""
    return words + "".join(f" where `{name}` is {_value(value)}" for name, value in beside)


def elsewhere_words(acts: Acts, ends: Ends) -> str:
    """What the first column does at the other end of the second; empty: there is none."""
    if not ends.other:
        return ""
    name, value = list(ends.other.items())[1]
    there = change_words(acts, ends.elsewhere) if abs(ends.elsewhere) > ends.error else "no difference"
    return f"; where `{name}` is {_value(value)}, {there}"


def _value(value: float) -> str:
    return "none" if np.isnan(value) else f"{value:.3g}" if abs(value) < 1000.0 else format_value(value)


def timing_words(lag_s: float, response_s: float) -> str:
    """When a driver begins to respond, and how fast he does."""
    begins = f"{abs(lag_s):.1f} s {'ahead' if lag_s < 0 else 'later'}" if abs(lag_s) >= 0.1 else "at once"
    return f"begins {begins}, response time {response_s:.1f} s"


def effect_line(effect: Effect, profile: Iterable[Effect] = ()) -> str:
    """An effect of a profile in a line: what it changes, how much and between which ends; a hidden one's parameters."""
    if isinstance(effect, ColumnEffect):
        ends = None if effect.course else ends_of(effect, profile)
        size = ""
        if ends is not None:
            size = (
                f" {change_words(effect.acts, ends.change, ends.error)} {where_words(ends)}"
                f"{elsewhere_words(effect.acts, ends)};"
                + (f" drivers differ by {ends.scatter / abs(ends.change):.0%} of it;" if ends.scatter else "")
            )
        timing = "a course over time" if effect.course else timing_words(effect.lag_s, effect.response_time)
        return f"{TARGET_WORDS[effect.acts]} by {' and '.join(effect.columns)}:{size} {timing}; {effect.shape}"
    plain = {name: value for name, value in effect.to_dict().items() if not isinstance(value, list | dict)}
    kind = str(plain.pop("kind")).replace("-", " ")
    return f"{kind}: " + ", ".join(f"{name} {format_value(value)}" for name, value in plain.items())
