"""A closed loop in plain words: what was found, how sure it is, what is left, and what these drives could show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from xosc_lateral.base.texts import aligned
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Product
from xosc_lateral.extras.loop.close import Finding, LoopResult
from xosc_lateral.extras.loop.columns import FEEDBACK_BAND_HZ, FUNCTION_COHERENCE, Feedback
from xosc_lateral.extras.loop.omnibus import DELAYS
from xosc_lateral.extras.loop.passage import Passage
from xosc_lateral.extras.loop.selection import Rejected
from xosc_lateral.extras.loop.shown import Shown
from xosc_lateral.extras.loop.terms.time import CHANGE_WITH_TIME
from xosc_lateral.extras.loop.timeline import LOCAL_S
from xosc_lateral.workflows.profiles.effect_words import (
    GAP,
    HINTS,
    change_words,
    elsewhere_words,
    plain_unit,
    side_of,
    timing_words,
    where_words,
)

CERTAIN_P_VALUE = 1e-4  # p-values below this are extrapolated far beyond the null's sample: certain, no better known.
SPREAD = f"spread within {LOCAL_S:g}{GAP}s"  # What the local standard deviation is called in figures.

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

# Of each kind of finding without a column its size, with its error, empty: a shift; and what it means.
KINDS: Mapping[str, tuple[str, str]] = {
    "location": ("", ""),
    "scale": (
        f"factor{GAP}{{0:.2f}}{{1}}",
        "The spread about the mean position changes smoothly over the drive: fatigue, or learning.",
    ),
    "periodic": (
        f"amplitude {{0:.2f}}{{1}}{GAP}m",
        "The car oscillates at a steady frequency, whatever the road and the traffic do.",
    ),
    "drift": (
        "",
        "The mean position changes smoothly over the drive, and no column explains it: a driver who settles, or a "
        "camera whose calibration depends on temperature.",
    ),
    "step": (
        "",
        "From one moment on the car keeps to another position in the lane, and no column changes at that time: a "
        "recalibrated camera, for example, or a change of driver.",
    ),
    "regime": (
        f"factor{GAP}{{0:.2f}}{{1}}",
        "The movement switches between two levels of spread, and no column predicts when: distraction, for example.",
    ),
    "memory": (
        f"factor{GAP}{{0:.2f}}{{1}}",
        "How the car moves depends on more than its position one step ago. The core model is replaced by "
        "`autoregressive`, which has a longer memory.",
    ),
    "population": (
        f"means scatter by {{0:.2f}}{{1}}{GAP}m",
        "The drivers keep to different positions and move by different amounts. The refined profile draws a driver "
        "for every vehicle.",
    ),
}
ANY_TIME = "The mean position changes with time, and the drives do not tell in which form."


def column_label(column: str, *, hint: bool = True) -> str:
    """A column with its unit where that is known, and what its sign means, for axes."""
    unit, sign = plain_unit(column), HINTS.get(column, "") if hint else ""
    return column + (f" [{unit}]" if unit else "") + (f" ({sign})" if sign else "")


def product_label(effect: Product) -> str:
    """Both factors of a product."""
    return " × ".join(str(factor) for factor in effect.factors)


# ---- one finding ----
def finding_sentence(finding: Finding) -> str:
    """One finding in a line: what, how much, between which ends, when, of what shape, and what else it may be."""
    when = "" if finding.lag_s is None else f"; {timing_words(finding.lag_s, finding.response_s or 0.0)}"
    alike = f"; {others_words(finding)} would explain it about as well" if finding.alike else ""
    return f"{finding.effect}: {size_words(finding)}{when}; {finding.shape}{alike}"


def size_words(finding: Finding) -> str:
    """What is different, with two standard errors, and between which ends it is."""
    effect, ends = finding.effects[0] if finding.effects else None, finding.ends
    if ends is None or not isinstance(effect, ColumnEffect):
        about = f"{GAP}±{GAP}{2.0 * finding.size_error:.2f}" if finding.size_error else ""
        shift = change_words(Acts.LOCATION, finding.size_m, finding.size_error)
        return KINDS[finding.kind][0].format(finding.size_m, about) or shift
    if finding.passage is not None:
        return _passage_words(finding.passage, finding.columns[0])
    change, error = finding.size_m, finding.size_error
    if effect.acts is not Acts.LOCATION:
        change, error = np.log(change), error / change
    words = f"{change_words(effect.acts, float(change), error)} {where_words(ends)}{elsewhere_words(effect.acts, ends)}"
    slopes = finding.own_slopes
    if slopes is None:
        return words
    where = f" in {', '.join(slopes.there)}" if slopes.there else ""
    others = ", in the others less, nothing or the reverse" if slopes.there else ""
    return f"{words}{where} (drives differ, p = {slopes.p_value:.1e}{others})"


def _passage_words(passage: Passage, column: str) -> str:
    """How far to either side the car goes in a typical passage, and when."""
    sides: list[str] = []
    for at in dict.fromkeys((passage.at, int(np.argmax(-np.sign(passage.largest_shift[0]) * passage.path)))):
        size, error, moment = float(passage.path[at]), 2.0 * float(passage.error[at]), float(passage.time[at])
        if not sides or abs(size) > error:
            when = f"{abs(moment):.0f}{GAP}s {'before' if moment < 0 else 'after'} it begins"
            sides.append(f"{abs(size):.2f}{GAP}±{GAP}{error:.2f}{GAP}m further {side_of(size)} {when}")
    none = np.isnan(passage.usual)
    usual = "none" if none else f"{passage.usual:.3g}" if abs(passage.usual) > 1e-3 * abs(passage.high) else "0"
    hint = f"; {HINTS[column]}" if column in HINTS else ""
    goes = f"`{column}` from {usual} to {passage.high:.3g} {plain_unit(column)}".rstrip()
    return f"{', '.join(sides)} in a typical passage ({goes} for {passage.lasts_s:.0f}{GAP}s{hint})"


def p_value_words(p_value: float) -> str:
    """How often tables without the effect show one as strong, in words."""
    if p_value < CERTAIN_P_VALUE:
        return "practically never"
    return f"in 1 of {1.0 / p_value:,.0f} tables".replace(",", GAP)


def meaning(finding: Finding) -> str:
    """What an effect means, in sentences that need no statistics."""
    words = ANY_TIME if finding.effect == CHANGE_WITH_TIME else KINDS[finding.kind][1]
    sentence, timeless = finding_sentence(finding), finding.lag_s is None and finding.passage is None
    return " ".join(
        [
            *([] if finding.columns or not words else [words]),
            f"{sentence[0].upper()}{sentence[1:]}.",
            *(
                ["It goes by the mean of each drive, not by changes within one."]
                if timeless and finding.columns
                else []
            ),
            f"Chance gives one as strong {p_value_words(finding.p_value)} (p = {finding.p_value:.1e}).",
            "On stretches that nothing was fitted to, the profile was "
            f"{1e3 * finding.error_before:.0f}{GAP}mm off before, and is {1e3 * finding.error_after:.0f}{GAP}mm off "
            f"now ({_PLAIN_GROUPS.get(finding.statistic, finding.measure)}).",
        ]
    )


def others_words(finding: Finding) -> str:
    """Columns of each other effect that explains as much; empty: there is none."""
    return ", or ".join(
        " with ".join(f"`{name}`" for name in columns) + (" alone" if set(columns) < set(finding.columns) else "")
        for columns in finding.alike
    )


# ---- what is none ----
def feedback_words(item: Feedback) -> str:
    """Why a column is no cause, in a sentence."""
    if item.source:
        return f"it is {'declared to be' if item.source == 'declared' else 'by its name'} the car's own movement"
    if item.function >= FUNCTION_COHERENCE:
        return f"it is a function of the present {item.of} (squared coherence {item.function:.2f}), as a warning is"
    above = f"above {FEEDBACK_BAND_HZ[0]:g}{GAP}Hz, where drivers hardly respond"
    shared = f"{above}, its squared coherence with the {item.of} is"
    share = f"the movement predicts {100 * item.predicted_share:.1f}{GAP}% of its changes"
    verdict = "it may follow from the car's own movement" if item.doubtful else "it follows from the car's own movement"
    declare = f"; if it cannot, declare what it is: `--role {item.column}=road`" if item.doubtful else ""
    return f"{shared} {item.coherence:.2f}, and {share}: {verdict}{declare}"


def taken_back_words(item: Rejected) -> str:
    """What was found and is not kept, or what each drive does in its own way, and why."""
    by = f" ({' and '.join(item.columns)})" if item.columns else ""
    sure = f", p = {item.p_value:.1e}" if item.was_found else ""
    return f"{COMPONENT_WORDS.get(item.component, item.component)}{by}{sure}: {item.why}"


# ---- the whole ----
def loop_text(result: LoopResult) -> str:
    """The outcome in a few lines."""
    lines = [f"{finding_sentence(finding)} (p = {finding.p_value:.1e})" for finding in result.findings]
    lines = lines or ["no effect added"]
    rejected = result.identified.selection.rejected
    lines += [taken_back_words(one) for one in rejected if one.was_found or one.own_way]
    for item in result.identified.usable.feedback:
        may = "may follow" if item.doubtful else "follows"
        lines.append(f"{item.column}: {may} from the car's own movement, so it is not taken for a cause")
    lines += [f"{what}: held-out error {one:.1f} mm before, {two:.1f} mm after" for what, one, two in errors_of(result)]
    lines[-1] += f" ({1e3 * result.floor:.1f} mm between random halves of these drives and the whole)"
    return "\n".join([*lines, verdict(result)])


def errors_of(result: LoopResult) -> list[tuple[str, float, float]]:
    """Held-out errors before and after, where the effects act and over everything, in words and mm."""
    pairs = {"where the effects act": result.own_errors, "over everything": (result.error_before, result.error_after)}
    return [(what, 1e3 * pair[0], 1e3 * pair[1]) for what, pair in pairs.items() if pair]


def outcome(result: LoopResult) -> str:
    """What was found and what became of it, in sentences that are true of every outcome."""
    findings, back = result.findings, result.identified.taken_back
    words = []
    if findings:
        names = "; ".join(finding.effect for finding in findings)
        names += f" ({size_words(findings[0])})" if len(findings) == 1 else ""
        words.append(f"{len(findings)} effect{'s' * (len(findings) > 1)} found and added to the profile: {names}.")
    elif not back:
        words.append("No significant effect was found, and none was added.")
    if back:
        number = f"{len(back)} {'more ' * bool(findings)}" + ("effects were" if len(back) > 1 else "effect was")
        words.append(f"{number} found and taken back ({'; '.join(map(taken_back_words, back))}).")
        words += [] if findings else ["Nothing was added: the base profile is returned."]
    return " ".join(words)


def verdict(result: LoopResult) -> str:
    """What is left: whether any column predicts it, what no table says, and what would have been found."""
    left = result.remainder
    named = sorted({column for finding in result.findings for column in finding.columns})
    if left is None:
        words = "Whether a column predicts what is left is not known: the check failed."
    elif not left.columns:
        words = "The table has no other column that could explain what is left."
    else:
        delays = f"from {-DELAYS[0]:g} s ahead to {DELAYS[-1]:g} s later"
        most = f"`{' and '.join(left.columns)}`, {delays}, explains {100 * left.share:.1f}{GAP}% of what is left"
        words = (
            f"What is left is no more than chance: no column predicts it, {delays} (p = {left.p_value:.2f})."
            if left.silent
            else f"More is left than chance: {most} (p = {left.p_value:.1e})."
        )
    alike = (
        f"a cause that comes and goes with {' or '.join(f'`{one}`' for one in named)} looks the same" if named else ""
    )
    unseen = f"What is not recorded cannot be named{f': {alike}' if alike else ''}."
    return f"{words} {unseen} {shown_words(result.shown)}"


# ---- what drives can show ----
SHOWN_NOTE = (
    "Smallest: an effect of this size is found with 80 % probability. At most: what was not found is smaller, with "
    "95 %. Sizes are changes of the mean between the 5 % and 95 % quantile of what drives it, or factors of the "
    "spread, of time over the longest drive. More minutes: of such driving, until 0.1 m or a factor of 1.5 is found as "
    "often."
)


def shown_rows(shown: Sequence[Shown]) -> list[dict[str, str | None]]:
    """What drives can show, as a table in words."""

    def size(entry: Shown, value: float | None) -> str | None:
        return None if value is None else f"{value:.2f}{GAP}m" if entry.acts == "mean" else f"factor{GAP}{value:.2f}"

    return [
        {
            **{"look": entry.what, "on": entry.acts, "tested": "yes" if entry.tested else "no", "outcome": entry.why},
            **{"smallest": size(entry, entry.smallest), "at most": size(entry, entry.bound)},
            "more minutes": None if entry.more_minutes is None else f"{entry.more_minutes:.0f}",
        }
        for entry in shown
    ]


def shown_text(shown: Sequence[Shown]) -> str:
    """The same for a terminal."""
    rows = shown_rows(shown)
    names = list(rows[0]) if rows else []
    lines = aligned([names, *([row[name] or "-" for name in names] for row in rows)])
    return "\n".join([shown_words(shown), "", *lines, "", SHOWN_NOTE])


def shown_words(shown: Sequence[Shown]) -> str:
    """What silence means here, in a sentence."""
    forms = {"mean": f"of the mean by {{0:.2f}}{GAP}m", "spread": "of the spread by a factor of {0:.1f}"}
    words = []
    for acts, form in forms.items():
        sizes = sorted(one.smallest for one in shown if one.acts == acts and one.smallest is not None)
        words += [form.format(sizes[len(sizes) // 2])] if sizes else []
    short = next((one.why for one in shown if one.what == "time" and not one.tested), None)
    untaken = f" Changes with time, as a driver settles or tires, were not looked for: {short}." if short else ""
    if not words:
        return f"In these drives no effect of a column would be found.{untaken}"
    return (
        f"Four of five changes {' or '.join(words)} would be found in these drives (median over columns; each in the "
        f"report).{untaken}"
    )
