"""A closed loop in plain words: what an effect means, how sure it is, what is left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Product
from xosc_lateral.extras.loop.close import Finding, LoopResult
from xosc_lateral.extras.loop.columns import FEEDBACK_BAND_HZ, FUNCTION_COHERENCE, Feedback
from xosc_lateral.extras.loop.drives import OwnSlopes
from xosc_lateral.extras.loop.ends import Ends
from xosc_lateral.extras.loop.loop_shown import GAP, shown_words
from xosc_lateral.extras.loop.omnibus import DELAYS
from xosc_lateral.extras.loop.passage import Passage
from xosc_lateral.extras.loop.selection import Rejected
from xosc_lateral.extras.loop.terms.time import CHANGE_WITH_TIME
from xosc_lateral.extras.loop.timeline import LOCAL_S

CERTAIN_P_VALUE = (
    1e-4  # p-values below this are extrapolated far beyond the null's sample: "certain", and no better known. [-]
)
NAMED_GROUPS = 4  # So many groups with the most left unexplained are named.
SPREAD = f"spread within {LOCAL_S:g}{GAP}s"  # What the local standard deviation is called in figures.

# Signs that a reader of a figure has to know.
HINTS: Mapping[str, str] = {
    "curvature": "positive in left bends",
    "crossfall": "positive: falls to the right",
    "grade": "positive: rises ahead",
    "lane_index": "0 is the rightmost lane",
    "wind_direction": "90: blows to the left",
}

# What is asked of each component.
COMPONENT_WORDS: Mapping[str, str] = {
    "mean": "a column that changes the mean offset",
    "course": "a column that changes the mean offset over a course of time",
    "between": "a column that goes with the mean offset of whole drives",
    "between_spread": "a column that goes with the spread of whole drives",
    "spread": "a column that changes the spread",
    "slow_spread": "a column that changes the spread of slow movement",
    "fine_noise": "a column that changes the fine noise",
    "time_spread": "a spread that changes smoothly with time",
    "regimes": "regimes of small and large spread",
    "cycle": "a periodic oscillation",
    "time_mean": "a mean offset that changes with time, smoothly or by a step",
}

# Groups of cells whose own name is not plain.
_PLAIN_GROUPS: Mapping[str, str] = {
    "movement by band": "standard deviation by frequency band",
    "spread by time": "spread by sixths of the drive",
    "mean by effect: step 0": "mean before and after it",
}

FACTOR = f"factor{GAP}{{0:.2f}}{{1}}"
# Of each kind of finding its size, with its error, and what it means where no column says so.
KINDS: Mapping[str, tuple[str, str]] = {
    "location": (f"{{0:+.2f}}{{1}}{GAP}m", ""),
    "scale": (FACTOR, "The spread about the mean position changes smoothly over the drive: fatigue, or learning."),
    "periodic": (
        f"amplitude {{0:.2f}}{{1}}{GAP}m",
        "The car oscillates at a steady frequency, whatever the road and the traffic do.",
    ),
    "drift": (
        f"{{0:+.2f}}{{1}}{GAP}m",
        "The mean position changes smoothly over the drive, and no column explains it: a driver who settles, or a "
        "camera whose calibration depends on temperature.",
    ),
    "step": (
        f"{{0:+.2f}}{{1}}{GAP}m",
        "From one moment on the car keeps to another position in the lane, and no column changes at that time: a "
        "recalibrated camera, for example, or a change of driver.",
    ),
    "regime": (
        FACTOR,
        "The movement switches between two levels of spread, and no column predicts when: distraction, for example.",
    ),
    "memory": (
        FACTOR,
        "How the car moves depends on more than its position one step ago. The core model is replaced by "
        "`autoregressive`, which has a longer memory.",
    ),
    "population": (
        f"means scatter by {{0:.2f}}{{1}}{GAP}m",
        "The drivers keep to different positions and move by different amounts. The refined profile draws a driver "
        "for every vehicle.",
    ),
}


def column_label(column: str, *, hint: bool = True) -> str:
    """A column with its unit where that is known, and what its sign means, for axes."""
    unit = CONTEXT_UNITS.get(column, "").replace("m/s2", "m/s²").replace("-", "")
    sign = HINTS.get(column, "") if hint else ""
    return column + (f" [{unit}]" if unit else "") + (f" ({sign})" if sign else "")


def product_label(effect: Product) -> str:
    """Both factors of a product."""
    return " × ".join(str(factor) for factor in effect.factors)


def size_words(finding: Finding) -> str:
    """Size with two standard errors and its unit, and between which ends it is."""
    if finding.over_time and finding.passage is not None:
        moment = float(finding.passage.time[finding.passage.at])
        return f"{_does(finding)} {_moment(moment) if moment else 'as it begins'} in a typical passage"
    return f"{_does(finding)} {_where(finding.ends)}" if finding.ends else _size(finding)


def _size(finding: Finding) -> str:
    about = f"{GAP}±{GAP}{2.0 * finding.size_error:.2f}" if finding.size_error else ""
    return KINDS[finding.kind][0].format(finding.size_m, about)


def _does(finding: Finding) -> str:
    """What is different at the high end: to which side, or by which factor."""
    if finding.kind != "location":
        return _size(finding)
    return f"{_size(finding).lstrip('+-')} further {_side(finding.size_m)}"


def _side(shift: float) -> str:
    return "left" if shift > 0 else "right"


def _where(ends: Ends) -> str:
    """From where to where a column goes, and where the other one stays."""
    (column, low), *beside = ends.low.items()
    high, unit = ends.high[column], CONTEXT_UNITS.get(column, "").replace("-", "")
    if (low, high) == (0.0, 1.0):
        words = f"while `{column}` is on"
    elif np.isnan(low) and column in PLACES_BY_COLUMN:
        words = f"{PLACES_BY_COLUMN[column]}, `{column}` {high:.3g} {unit}".rstrip()
    else:
        words = f"as `{column}` goes from {_value(low)} to {_value(high)} {unit}".rstrip()
    words += f" ({HINTS[column]})" if column in HINTS else ""
    return words + "".join(f" where `{name}` is {_value(value)}" for name, value in beside)


def _value(value: float) -> str:
    return "none" if np.isnan(value) else f"{value:.3g}"


def _moment(seconds: float) -> str:
    """A moment of a passage, against where the column begins to change. [s]"""
    return f"{abs(seconds):.0f}{GAP}s {'before' if seconds < 0 else 'after'} it begins"


def p_value_words(p_value: float) -> str:
    """How often tables without the effect show one as strong, in words."""
    if p_value < CERTAIN_P_VALUE:
        return "practically never"
    return f"in 1 of {1.0 / p_value:,.0f} tables".replace(",", GAP)


def meaning(finding: Finding) -> str:
    """What an effect means, in sentences that need no statistics."""
    effect = finding.effects[0] if finding.effects else None
    if isinstance(effect, ColumnEffect):
        sentence = _column_sentence(finding, effect)
    else:
        change = "The mean position changes with time, and the drives do not tell in which form."
        hidden = change if finding.effect == CHANGE_WITH_TIME else KINDS[finding.kind][1]
        sentence = f"{hidden} ({finding.shape[0].upper()}{finding.shape[1:]}; {size_words(finding)}.)"
    when = ""
    if finding.lag_s is not None and finding.response_s is not None:
        lag = finding.lag_s
        start = "at once" if abs(lag) < 0.1 else f"{-lag:.1f} s in advance" if lag < 0 else f"{lag:.1f} s later"
        slow = f", with a response time of {finding.response_s:.1f} s" if finding.response_s > 0 else ""
        when = f"The driver responds {start}{slow}."
    elif finding.columns and not finding.over_time:
        when = "What counts is the mean of each drive, not changes within a drive."
    own = finding.own_slopes
    words = [
        sentence,
        "" if own is None or not own.differ else _own_words(finding, own),
        when,
        f"Without this effect, one as strong is found {p_value_words(finding.p_value)} (p = {finding.p_value:.1e}).",
    ]
    if finding.alike:
        words.append(
            f"{others_words(finding, '`')} would explain it about as well; these drives cannot tell which it is."
        )
    measure = _PLAIN_GROUPS.get(finding.statistic, finding.measure)
    change = f"{_mm(finding.error_before)} before, {_mm(finding.error_after)} now"
    words.append(f"Error of the {measure} on held-out blocks: {change}.")
    return " ".join(word for word in words if word)


def _own_words(finding: Finding, own: OwnSlopes) -> str:
    """In which drives it acts, and how much there."""
    differs = f"It differs from drive to drive (p = {own.p_value:.1e})"
    if not own.there:
        return f"{differs}; in none alone it is sure."
    there = replace(finding, size_m=finding.size_m * own.relative_there, size_error=0.0)
    return f"{differs}: it surely acts in {', '.join(own.there)}, {_does(there)} there; in the others less, or not."


def others_words(finding: Finding, mark: str = "") -> str:
    """Columns of each other effect that explains as much, each name between marks; empty: there is none."""
    return ", or ".join(
        " with ".join(f"{mark}{name}{mark}" for name in columns)
        + (" alone" if set(columns) < set(finding.columns) else "")
        for columns in finding.alike
    )


def feedback_words(item: Feedback) -> str:
    """Why a column is no cause, in a sentence."""
    if item.source:
        by = "declared to be" if item.source == "declared" else "by its name"
        return f"it is {by} the car's own movement"
    if item.function >= FUNCTION_COHERENCE:
        return f"it is a function of the present {item.of} (squared coherence {item.function:.2f}), as a warning is"
    above = f"above {FEEDBACK_BAND_HZ[0]:g}{GAP}Hz, where drivers hardly respond"
    shared = f"{above}, its squared coherence with the {item.of} is"
    share = f"the movement predicts {100 * item.predicted_share:.1f}{GAP}% of its changes"
    verdict = "it may follow from the car's own movement" if item.doubtful else "it follows from the car's own movement"
    declare = f"; if it cannot, declare what it is: `--role {item.column}=road`" if item.doubtful else ""
    return f"{shared} {item.coherence:.2f}, and {share}: {verdict}{declare}"


def outcome(result: LoopResult) -> str:
    """What was found and what became of it, in sentences that are true of every outcome."""
    findings, back = result.findings, result.identified.taken_back
    words = []
    if findings:
        names = "; ".join(f"{finding.effect} ({size_words(finding)})" for finding in findings)
        words.append(f"{len(findings)} effect{'s' * (len(findings) > 1)} found and added to the profile: {names}.")
    elif not back:
        words.append("No significant effect was found, and none was added.")
    if back:
        names = "; ".join(f"{taken_back_words(item)}, p = {item.p_value:.1e}: {item.why}" for item in back)
        number = f"{len(back)} {'more ' * bool(findings)}" + ("effects were" if len(back) > 1 else "effect was")
        words.append(f"{number} found and taken back ({names}).")
        words += [] if findings else ["Nothing was added: the base profile is returned."]
    return " ".join(words)


def taken_back_words(item: Rejected) -> str:
    """What was found and is not kept."""
    by = f" ({' and '.join(item.columns)})" if item.columns else ""
    return f"{COMPONENT_WORDS.get(item.component, item.component)}{by}"


def lack_of_fit_words(result: LoopResult) -> str:
    """What is left unexplained, in a sentence."""
    left = result.lack_of_fit
    if left.unexplained == 0.0:
        total = "Taken together, the residuals do not exceed the difference between halves of the drives."
        return f"{total} {_remainder_words(result)}"
    if not left.is_clear:
        share = f"{100 * left.p_value:.0f}{GAP}% of random halves of these drives differ as much from the whole."
        return f"The error after is above that between halves, but {share} {_remainder_words(result)}"
    where = ", ".join(
        f"{group_words(group.name, result)} ({_mm(group.after)}, between halves {_mm(group.floor)})"
        for group in left.where[:NAMED_GROUPS]
    )
    return (
        f"Unexplained residual of {_mm(left.unexplained)}: the error after ({_mm(result.error_after)}) lies "
        f"clearly above that between halves ({_mm(result.floor)}), and no effect in the profile explains the rest."
        + (f" It stands out in: {where}." if where else "")
        + ("" if result.remainder is None or result.remainder.silent else f" {_remainder_words(result)}")
    )


def explained_words(result: LoopResult) -> str:
    """Share of the explainable, in a sentence; empty where nothing can be held out."""
    known = result.explained
    if known is None:
        return ""
    if not known.is_known:
        return "On held-out blocks no free linear response to the columns predicts the mean better than the base."
    share, low, high = (f"{100.0 * max(one, 0.0):.0f}" for one in (known.share, *known.interval))
    return (
        f"On held-out blocks, chosen and fitted without them, the effects explain {share}{GAP}% (95{GAP}% interval "
        f"{low} to {high}{GAP}%) of what a free linear response to all columns explains of the mean."
    )


def _remainder_words(result: LoopResult) -> str:
    """Whether any column predicts what is left, at whichever delay."""
    left, back = result.remainder, result.identified.taken_back
    if left is None:
        return f"Whether a column predicts what is left is not known: the check failed. {shown_words(result.shown)}"
    delays = f"from {-DELAYS[0]:g} s ahead to {DELAYS[-1]:g} s behind"
    if not left.silent:
        return (
            f"More is left than chance: `{' and '.join(left.columns)}`, at delays {delays}, explains "
            f"{100 * left.share:.1f}{GAP}% of the movement's innovations (p = {left.p_value:.1e})."
        )
    if back:
        return f"No column predicts what is left (p = {left.p_value:.2f}). {shown_words(result.shown)}"
    if not left.columns:
        return f"There is no column that could explain what the profile still misses. {shown_words(result.shown)}"
    return (
        f"No column, at any delay {delays}, predicts what is left (p = {left.p_value:.2f}): it is within chance. "
        f"{shown_words(result.shown)}"
    )


def group_words(name: str, result: LoopResult) -> str:
    """A group of cells as a reader would call it."""
    for finding in result.findings:
        key = finding.statistic.partition(" by effect: ")[2]
        if key and name.endswith(f" by effect: {key}"):
            return f"{name.partition(' by ')[0]} by the effect of {' and '.join(finding.columns) or finding.effect}"
    return _PLAIN_GROUPS.get(name, name)


# Where a driver is, by the column that says so.
PLACES_BY_COLUMN: Mapping[str, str] = {
    "left_distance": "beside vehicles on his left",
    "right_distance": "beside vehicles on his right",
    "car_left": "beside cars on his left",
    "car_right": "beside cars on his right",
    "truck_left": "beside trucks on his left",
    "truck_right": "beside trucks on his right",
    "left_is_truck": "when the next vehicle on his left is a truck",
    "right_is_truck": "when the next vehicle on his right is a truck",
    "lead_distance": "behind a vehicle ahead",
    "lead_is_truck": "when the vehicle ahead is a truck",
    "oncoming_distance": "when somebody comes towards him",
}


def _passage_sentence(passage: Passage, column: str) -> str:
    """How far to either side the car goes in a typical passage, and when."""
    sides: list[str] = []
    for at in dict.fromkeys((passage.at, int(np.argmax(-np.sign(passage.largest_shift[0]) * passage.path)))):
        size, error = float(passage.path[at]), 2.0 * float(passage.error[at])
        if not sides or abs(size) > error:
            moment = _moment(float(passage.time[at]))
            sides.append(f"{abs(size):.2f}{GAP}±{GAP}{error:.2f}{GAP}m to the {_side(size)} {moment}")
    unit = CONTEXT_UNITS.get(column, "").replace("-", "")
    rises = f"from {passage.usual:.3g} to" if np.isfinite(passage.usual) else "from none to"
    hint = f"; {HINTS[column]}" if column in HINTS else ""
    typical = f"`{column}` {rises} {passage.high:.3g}{GAP}{unit}".rstrip() + f" for {passage.lasts_s:.0f}{GAP}s{hint}"
    return f"In a typical passage ({typical}) the car is farthest out {', and '.join(sides)}."


def _column_sentence(finding: Finding, effect: ColumnEffect) -> str:
    if finding.over_time and finding.passage is not None:
        return _passage_sentence(finding.passage, effect.columns[0])
    ends, does = (
        finding.ends,
        {
            Acts.LOCATION: f"the car drives {_does(finding)}",
            Acts.SPREAD: f"the movement about the mean changes by a {_size(finding)}",
            Acts.FINE: f"the fine noise changes by a {_size(finding)}",
            Acts.RATE: f"the rate of mean reversion changes by a {_size(finding)}",
        },
    )
    assert ends is not None
    words = f"{_where(ends)}, {does[effect.acts]}"
    if ends.other:
        (_, (name, value)) = ends.other.items()
        change = ends.elsewhere if effect.acts is Acts.LOCATION else float(np.exp(ends.elsewhere))
        there = replace(finding, size_m=change, size_error=0.0)
        words += (
            f"; where `{name}` is {_value(value)}, {_does(there) if abs(ends.elsewhere) > ends.error else 'nothing'}"
        )
    return f"{words[0].upper()}{words[1:]}."


def _mm(value: float) -> str:
    return f"{1000.0 * value:.0f}{GAP}mm"
