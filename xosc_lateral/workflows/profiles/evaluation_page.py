"""Scores of a profile: the result, with its text, JSON and a page with the paper's violins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.evaluation import spectra
from xosc_lateral.drivers.evaluation.lane_keeping import NEAR_MARKING
from xosc_lateral.drivers.evaluation.metrics import METRICS
from xosc_lateral.drivers.evaluation.realism import Realism
from xosc_lateral.drivers.evaluation.scores import SNIPPET, ProfileScores, SnippetScores, scores_to_dict
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Page
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.workflows.profiles.realism_text import (
    FAMILY_LABELS,
    condition_groups,
    indicator_rows,
    ratio_rows,
    realism_lines,
    start_fade_note,
)
from xosc_lateral.workflows.profiles.violins import (
    METRIC_WORDS,
    spectrum_figure,
    trace_figure,
    verdict_figure,
    violin_figure,
)
from xosc_lateral.workflows.result import GivenDrives, PathLike, Result, write_page

VERDICT_SENTENCES = {
    spectra.ALIKE: "moves as other real drivers do", spectra.UNLIKE: "does not move as other real drivers do",
    spectra.NOT_KNOWN: "may or may not move as other real drivers do: these drives are too few to tell",
}  # fmt: skip


def finding(scores: ProfileScores) -> str:
    """The verdict in a sentence, and the comparison that does worst."""
    worst, ratio = worst_block(scores)
    far = f"; farthest from them, {ratio:.2f} times as far as they are from each other: {worst}"
    return f"`{scores.profile}` {VERDICT_SENTENCES[judged(scores, spectra.DRIVER)]}{far}."


NAMED_BLOCKS = 3
"""Blocks that a verdict names."""
Block = tuple[float, float, float, str]
"""A ratio to what other real drivers get, its 95 % interval, and of what it speaks: driver or recording."""


def evaluation_text(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> str:
    """A table for the terminal."""
    note, long = start_fade_note(profile), scores.long_snippets
    return "\n".join(
        [
            f"{scores.profile} on {scores.hours:.2f} h of {scores.drives} drives ({scores.runs} runs), "
            f"seed {scores.seed}",
            *([FITTED_NOTE] if _fitted_on(profile, inputs) else []),
            finding(scores).replace("`", ""),
            f"verdict: {verdict_in_words(scores)}",
            scores.verdict.alarm_words(),
            *realism_lines(scores.realism),
            "snippets as in the paper, from the same start; real drivers are compared without a common start",
            *_snippet_lines(scores.snippets),
            *([f"  {note}"] if note else []),
            *([] if long is None else _snippet_lines(long)),
            "mean distance of the four evaluations (coarse + fine):",
            *(
                f"  ({each.number}) {each.coarse} + {each.fine}: {each.distances.mean:.3f}, worst "
                f"{each.distances.worst} {each.distances.by_metric[each.distances.worst]:.3f}"
                for each in scores.evaluations
            ),
            f"spectrum: differs by {scores.spectrum_error:.1f} dB (rms over bands)",
            *(
                f"comes near a marking, {name}: {each.excursions_per_hour:.1f} times an hour, "
                f"up to {each.largest:.2f} m"
                for name, each in (("measured", scores.margins_real), ("sampled", scores.margins_sampled))
            ),
        ]
    )


FITTED_NOTE = (
    "The profile was fitted to these drives: the scores say how well it describes them, not how it does on others."
)


def evaluation_record(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> dict[str, Any]:
    """The scores and what is needed to get them again, as plain values."""
    block, ratio = worst_block(scores)
    values = {"worst": {"block": block, "ratio": round(ratio, 3)}, **scores_to_dict(scores)}
    values["verdict"] |= {"words": verdict_in_words(scores)} | {of: judged(scores, of) for of in spectra.BOTH}
    return {**values, "provenance": _provenance(scores, profile, inputs)}


def evaluation_page(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> str:
    """HTML page: scores beside those of real drivers, violins, spectra, and traces; same scores, same bytes."""
    page = Page(f"Evaluation of {scores.profile}")
    page.lead(
        finding(scores),
        f"{scores.hours:.1f} h of measured driving ({scores.drives} drives), beside offsets sampled from "
        f"`{scores.profile}` under the same context. It is valid for: {profile.validity.in_words() or 'not stated'}.",
    )
    if _fitted_on(profile, inputs):
        page.warning(FITTED_NOTE)
    if any(ratio.high for ratio in scores.verdict.ratios):
        page.figure(
            verdict_figure(scores.verdict),
            "Power of what is sampled over what is measured, by frequency; lines: 95 % intervals over drives. Shaded: "
            "as far as real drivers differ from run to run. Driver: without the sensor's error; recording: with it.",
            "Sampled over measured power by frequency, of the driver and of the recording",
        )
    words = verdict_in_words(scores)
    page.text(f"{words[:1].upper()}{words[1:]}.", f"{scores.verdict.alarm_words().capitalize()}.")
    page.section("Traces")
    page.figure(
        trace_figure(scores),
        "Left: offsets as measured. Right: sampled, from the same start and under the same context. The curves are not "
        "meant to coincide: two drives of the same driver do not either. What should agree is how they move.",
        "Measured and sampled offsets over time, drive by drive",
    )
    _add_realism(page, scores.realism)
    page.section(
        f"Ten metrics of {scores.snippets.seconds:g} s snippets",
        "As in the paper: sampled from the same start; real drivers are compared without a common start. "
        f"{start_fade_note(profile)}",
        folded=True,
    )
    _add_metrics(page, scores.snippets)
    made = scores.evaluations[3]
    page.figure(
        violin_figure(made.real, made.artificial),
        "Measured (left, blue) beside sampled (right) snippets. Bars: minimum, mean, maximum.",
        f"Ten pairs of violins; mean distance {made.distances.mean:.3f}.",
    )
    if scores.long_snippets is not None:
        page.section(
            f"Snippets of {scores.long_snippets.seconds:g} s",
            "The same metrics of longer snippets, which show slow movement.",
            folded=True,
        )
        _add_metrics(page, scores.long_snippets)
    page.section(
        "The four evaluations",
        "Which part of the model falls short? The coarse and fine parts of measured snippets (split as in Neis and "
        "Beyerer, 2024) and those of the profile are combined. Evaluation (1) combines the measured coarse part with "
        "the measured fine part, shifted in time: the best that the split allows.",
        folded=True,
    )
    page.table(
        [
            {"evaluation": f"({each.number})", "coarse part": each.coarse, "fine part": each.fine}
            | {"mean distance": each.distances.mean}
            | {METRIC_WORDS[name]: each.distances.by_metric[name] for name in ("std", "range", "diff_mean", "diff_std")}
            for each in scores.evaluations
        ]
    )
    page.section("Spectrum and autocorrelation", folded=True)
    page.figure(
        spectrum_figure(scores),
        "Left: power spectral density of the offset. Right: autocorrelation about the mean over all drivers.",
        "Measured and sampled spectrum and autocorrelation",
    )
    page.section(
        "Near the markings",
        f"How often the reference point comes within {NEAR_MARKING:g} m of a marking (half the width of a car, and a "
        "margin).",
        folded=True,
    )
    page.table(
        [
            {
                "drives": name,
                "excursions [1/h]": each.excursions_per_hour,
                "largest offset [m]": each.largest,
            }
            for name, each in (("measured", scores.margins_real), ("sampled", scores.margins_sampled))
        ]
    )
    return page.html(_provenance(scores, profile, inputs))


def _add_realism(page: Page, realism: Realism) -> None:
    """The fair measure, and lane keeping."""
    page.section(
        "Compared with other real drivers",
        "Differences between sampled and measured driving (Wasserstein distances in units of the measured metric's "
        "standard deviation), divided by those between measured drivers: 1 is as close as other real drivers are. "
        "Where sampled snippets start at the measured offset, so do the other drivers'; free runs have no given start. "
        "Recordings contain the driver and the sensor: what is sampled has the recording's sensor added. "
        "A classifier that does not separate sampled from measured "
        "snippets has an AUC of 0.5; in brackets, the 95 % interval over resampled drives. With context, it also sees "
        "what was around the vehicle; a column that follows from the vehicle's own movement, such as its steering "
        "angle, gives sampled movement away.",
        folded=True,
    )
    for heading, group in condition_groups(realism).items():
        page.table(ratio_rows(group), heading)
    page.section("Lane keeping", folded=True)
    formats = {"measured": ".4g", "sampled": ".4g", "distance [sd]": ".3f", "real drivers [sd]": ".3f"}
    for each in realism.conditions:
        if not each.condition.same_start:
            page.table(indicator_rows(each), each.condition.name, formats=formats)
    real, sampled = (
        f"{each.between:.4f}, {each.within:.4f} and {each.inside:.4f} m²"
        for each in (realism.variance_real, realism.variance_sampled)
    )
    page.text(
        f"Variance between drivers, within drivers and inside snippets of {SNIPPET:g} s: {real} measured, "
        f"{sampled} sampled."
    )


def _metric_rows(scores: SnippetScores) -> list[tuple[str, float, float]]:
    """Each metric and their mean: name, distance, and that between real drivers, in standard deviations."""
    rows = [(METRIC_WORDS[name], scores.distances.by_metric[name], scores.floor.by_metric[name]) for name in METRICS]
    return [*rows, ("mean", scores.distances.mean, scores.floor.mean)]


def _add_metrics(page: Page, scores: SnippetScores) -> None:
    rows = _metric_rows(scores)
    page.table(
        [{"metric": name, "distance": each, "real drivers": real, "ratio": each / real} for name, each, real in rows],
        f"{scores.count} snippets of {scores.seconds:g} s; distances in standard deviations of the measured metric",
        formats={"distance": ".3f", "real drivers": ".3f", "ratio": ".2f"},
    )


def _snippet_lines(scores: SnippetScores) -> list[str]:
    return [
        f"{scores.count} snippets of {scores.seconds:g} s      distance  real drivers  ratio",
        *(f"  {name:24s}  {each:8.3f}  {real:12.3f}  {each / real:5.2f}" for name, each, real in _metric_rows(scores)),
    ]


def blocks_of(scores: ProfileScores) -> dict[str, Block]:
    """Every block of the fair measure over what other real drivers get; classifiers: 1 at AUC 0.5, 2 at 1. [-]"""
    blocks: dict[str, Block] = {}
    for each in scores.realism.conditions:
        of = spectra.DRIVER if each.condition.slow else spectra.RECORDING
        for family, beside in each.families.items():
            if isfinite(beside.ratio):
                blocks[f"{FAMILY_LABELS[family]}, {each.condition.name}"] = (beside.ratio, *beside.interval, of)
        for name, area in (("classifier", each.alone), ("classifier with context", each.jointly)):
            if area is not None:
                ratio, low, high = (1.0 + 2.0 * max(auc - 0.5, 0.0) for auc in (area.auc, area.low, area.high))
                blocks[f"{name}, {each.condition.name}"] = (ratio, low, high, of)
    return blocks


def worst_block(scores: ProfileScores) -> tuple[str, float]:
    """Name and ratio of the block that does worst."""
    blocks = blocks_of(scores)
    worst = max(blocks, key=lambda name: blocks[name][0])
    return worst, blocks[worst][0]


def far_blocks(scores: ProfileScores) -> dict[str, Block]:
    """Those that are farther from real drivers than these are from each other, beyond `TOLERANCE` and chance.

    They contradict a verdict, and don't confirm one: a block is a distance, near for many reasons.
    """
    far = {name: block for name, block in blocks_of(scores).items() if block[1] > spectra.TOLERANCE}
    return dict(sorted(far.items(), key=lambda item: -item[1][0]))


def verdict_in_words(scores: ProfileScores) -> str:
    """One line from all that is compared: driver and recording, and every block that is far from real drivers."""
    far = far_blocks(scores)
    if not far:
        return scores.verdict.in_words()
    listed = [f"{name} {ratio:.2f} ({low:.2f} to {high:.2f}, {of})" for name, (ratio, low, high, of) in far.items()]
    more = f" and {len(far) - NAMED_BLOCKS} more" if len(far) > NAMED_BLOCKS else ""
    what = "farther from real drivers than these are from each other in"
    return f"{scores.verdict.in_words()}; not like them: {what} {', '.join(listed[:NAMED_BLOCKS])}{more}"


def judged(scores: ProfileScores, of: str) -> str:
    """Driver or recording: alike, unlike or not known, by ratios and blocks."""
    contradicted = any(block[3] == of for block in far_blocks(scores).values())
    return spectra.UNLIKE if contradicted else scores.verdict.judged(of)


def _fitted_on(profile: DriverProfile, inputs: Mapping[str, str]) -> bool:
    return not set(profile.provenance.inputs.values()).isdisjoint(inputs.values())


def _provenance(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> dict[str, Any]:
    return {
        "profile": profile.name,
        "profile_sha256": profile_hash(profile),
        "inputs": dict(inputs),
        "fitted_on_these": _fitted_on(profile, inputs),
        "seed": scores.seed,
        "package_version": __version__,
    }


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Result):
    """Scores of a profile on measured drives."""

    _scores: ProfileScores
    profile: DriverProfile
    _tables: GivenDrives

    @property
    def ratio(self) -> float:
        """Mean distance of the ten metrics over that between real drivers; 1: as close as these. [-]"""
        return self._scores.snippets.ratio

    @property
    def realism(self) -> Realism:
        """The fair measure: every condition's distances, those between real drivers (`floor`), and classifiers."""
        return self._scores.realism

    @property
    def worst(self) -> tuple[str, float]:
        """The block that does worst, and its ratio to real drivers; see `to_frame`. [-]"""
        return worst_block(self._scores)

    @property
    def messages(self) -> tuple[Note, ...]:
        """Rows of the tables that are in no drive."""
        return self._tables.messages

    def headline(self) -> str:
        """One line."""
        hours = f"{self._scores.hours:.2f} h of {self._scores.drives} drives"
        return f"{self.profile.name} on {hours}: " + ", ".join(
            f"{of} {self.judged(of)}" for of in ("driver", "recording")
        )

    def judged(self, of: str) -> str:
        """The "driver", or the "recording", his sensor's error on both sides: "alike", "unlike" or "not known"."""
        return judged(self._scores, of)

    def __str__(self) -> str:
        text = evaluation_text(self._scores, self.profile, self._tables.inputs)
        return "\n".join([text, *self.message_lines()])

    def to_frame(self) -> pd.DataFrame:
        """One row per metric and snippet length: `seconds`, `metric`, `distance`, `floor`, `ratio`."""
        rows = [
            {"seconds": one.seconds, "metric": name, "distance": distance, "floor": one.floor.by_metric[name]}
            for one in (self._scores.snippets, self._scores.long_snippets)
            if one is not None
            for name, distance in one.distances.by_metric.items()
        ]
        frame = pd.DataFrame(rows)
        return frame.assign(ratio=frame["distance"] / frame["floor"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        record = evaluation_record(self._scores, self.profile, self._tables.inputs)
        return record | {"messages": self.message_records()}

    def plot(self) -> Figure:
        """Violins of the ten metrics, measured beside sampled."""
        shown = self._scores.evaluations[3]
        return violin_figure(shown.real, shown.artificial)

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page."""
        name, tables = f"{self.profile.name}_evaluation.html", self._tables
        made = partial(evaluation_page, self._scores, self.profile, tables.inputs)
        return write_page(path, name, made, inputs=tables.files, force=force)
