"""Scores of a profile as text, JSON and a report with the paper's violins."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.evaluation.lane_keeping import NEAR_MARKING, Margins
from xosc_lateral.evaluation.metrics import METRICS
from xosc_lateral.evaluation.parts import PartEvaluation
from xosc_lateral.evaluation.realism import Realism
from xosc_lateral.evaluation.record import scores_to_dict
from xosc_lateral.evaluation.scores import SNIPPET, ProfileScores, SnippetScores
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.report.figures import GRID, INK, MEASURED, SAMPLED, figure_style, new_figure, new_panels
from xosc_lateral.report.realism import (
    FAMILIES,
    condition_groups,
    indicator_rows,
    ratio_rows,
    realism_lines,
    start_fade_note,
)
from xosc_lateral.report.render import KeyFigure, Tone, render_page
from xosc_lateral.report.violins import LABELS, violin_figure
from xosc_lateral.version import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FloatArray = NDArray[np.float64]


@figure_style()
def trace_figure(scores: ProfileScores) -> Figure:
    """Measured offsets on the left, sampled ones of the same drives on the right, on one scale."""
    figure, axes = new_panels(len(scores.traces), 2, panel_height=0.7, sharex=True, sharey=True)
    for row, trace in zip(axes, scores.traces, strict=True):
        for axis, values, color, label in (
            (row[0], trace.real, MEASURED, "measured"),
            (row[1], trace.sampled, SAMPLED, "sampled"),
        ):
            axis.plot(trace.step * np.arange(len(values)), values, color=color, label=f"{trace.drive}, {label}")
            axis.axhline(0.0, color=GRID, linewidth=0.8)
            axis.set_title(f"{trace.drive}, {label}")
    axes[len(scores.traces) // 2, 0].set_ylabel("offset [m]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure


@figure_style()
def spectrum_figure(scores: ProfileScores) -> Figure:
    """Power density, measured and sampled."""
    figure, axes = new_figure(height=3.4)
    axis = axes[0, 0]
    for one, label, color in (
        (scores.spectrum_real, "measured", MEASURED),
        (scores.spectrum_sampled, "sampled", SAMPLED),
    ):
        axis.loglog(one.frequency, one.density, color=color, marker="o", markersize=3, label=label)
    axis.set_xlabel("frequency [Hz]")
    axis.set_ylabel("power density [m²/Hz]")
    axis.legend()
    return figure


@figure_style()
def memory_figure(scores: ProfileScores) -> Figure:
    """Autocorrelation, measured and sampled."""
    figure, axes = new_figure(height=3.0)
    axis = axes[0, 0]
    axis.semilogx(scores.lags, scores.autocorrelation_real, color=MEASURED, marker="o", markersize=3, label="measured")
    axis.semilogx(scores.lags, scores.autocorrelation_sampled, color=SAMPLED, marker="o", markersize=3, label="sampled")
    axis.axhline(0.0, color=INK, linewidth=0.8)
    axis.set_xlabel("lag [s]")
    axis.set_ylabel("correlation [-]")
    axis.legend()
    return figure


CLOSE, FAR = 1.2, 2.0
"""Ratios to the distance between real drivers up to which a metric is marked good, and from which it is marked bad."""


def evaluation_text(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> str:
    """A table for the terminal."""
    lines = [
        f"{scores.profile} on {scores.hours:.2f} h of {scores.drives} drives ({scores.runs} runs), seed {scores.seed}",
        *([FITTED] if _fitted_on(profile, inputs) else []),
        _worst_line(scores),
        *realism_lines(scores.realism),
        "as in the paper: from the same start, without the sensor; real drivers are compared without a common start",
        *_snippet_lines(scores.snippets),
    ]
    if note := start_fade_note(profile):
        lines.append(f"  {note}")
    if scores.long_snippets is not None:
        lines += _snippet_lines(scores.long_snippets)
    lines.append("mean distance of the four evaluations (coarse + fine):")
    lines += [
        f"  ({one.number}) {one.coarse} + {one.fine}: {one.distances.mean:.3f}, worst {one.distances.worst} "
        f"{one.distances.by_metric[one.distances.worst]:.3f}"
        for one in scores.evaluations
    ]
    lines.append(f"spectrum: differs by {scores.spectrum_error:.1f} dB (rms over bands)")
    for name, one in (("measured", scores.margins_real), ("sampled", scores.margins_sampled)):
        lines.append(
            f"near a marking, {name}: {100 * one.share_near:.2f} % of the time, "
            f"{one.excursions_per_hour:.1f} times an hour"
        )
    return "\n".join(lines)


FITTED = "The profile was fitted to these drives: the scores say how well it describes them, not how it does on others."


def evaluation_record(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> dict[str, Any]:
    """The scores and what is needed to get them again, as plain values."""
    block, ratio = worst_block(scores)
    worst = {"worst": {"block": block, "ratio": round(ratio, 3)}}
    return {**worst, **scores_to_dict(scores), "provenance": _provenance(scores, profile, inputs)}


def evaluation_page(scores: ProfileScores, profile: DriverProfile, inputs: Mapping[str, str]) -> str:
    """HTML page: scores beside those of real drivers, violins, spectra, and traces; same scores, same bytes."""
    worst, ratio = worst_block(scores)
    return render_page(
        "evaluation.html",
        title=f"Evaluation of {scores.profile}",
        provenance=_provenance(scores, profile, inputs),
        scores=scores,
        fitted=FITTED if _fitted_on(profile, inputs) else "",
        numbers=[
            KeyFigure(f"{ratio:.2f}", f"worst comparison: {worst}", "1: as close as other real drivers", _tone(ratio)),
            *_key_figures(scores.realism),
        ],
        groups=[(heading, ratio_rows(group)) for heading, group in condition_groups(scores.realism).items()],
        indicators=[
            (one.condition.name, indicator_rows(one))
            for one in scores.realism.conditions
            if not one.condition.same_start
        ],
        start_fade=start_fade_note(profile),
        metric_table=_metric_table,
        near_marking=f"{NEAR_MARKING:g}",
        snippet=f"{SNIPPET:g}",
        part_rows=[_part_row(one) for one in scores.evaluations],
        margin_rows=[_margin_row("measured", scores.margins_real), _margin_row("sampled", scores.margins_sampled)],
        figures={"trace": trace_figure(scores), "spectrum": spectrum_figure(scores), "memory": memory_figure(scores)},
        violin_figure=violin_figure,
    )


def _part_row(one: PartEvaluation) -> dict[str, object]:
    shown = ("std", "range", "diff_mean", "diff_std")
    return {
        "evaluation": f"({one.number})",
        "coarse part": one.coarse,
        "fine part": one.fine,
        "mean distance": one.distances.mean,
        **{LABELS[name]: one.distances.by_metric[name] for name in shown},
    }


def _metric_table(scores: SnippetScores) -> dict[str, Any]:
    """Arguments of `render.table`."""
    rows: list[dict[str, object]] = []
    tones: dict[int, Tone] = {}
    for number, name in enumerate(METRICS):
        distance, floor = scores.distances.by_metric[name], scores.floor.by_metric[name]
        rows.append({"metric": LABELS[name], "distance": distance, "real drivers": floor, "ratio": distance / floor})
        tones[number] = _tone(distance / floor)
    rows.append(
        {"metric": "mean", "distance": scores.distances.mean, "real drivers": scores.floor.mean, "ratio": scores.ratio}
    )
    return {"rows": rows, "tones": tones, "formats": {"distance": ".3f", "real drivers": ".3f", "ratio": ".2f"}}


def _margin_row(name: str, one: Margins) -> dict[str, object]:
    return {
        "drives": name,
        "time near a marking [%]": 100.0 * one.share_near,
        "excursions [1/h]": one.excursions_per_hour,
        "largest offset [m]": one.largest,
    }


def _snippet_lines(scores: SnippetScores) -> list[str]:
    lines = [f"{scores.count} snippets of {scores.seconds:g} s      distance  real drivers  ratio"]
    for name in METRICS:
        distance, floor = scores.distances.by_metric[name], scores.floor.by_metric[name]
        lines.append(f"  {LABELS[name]:24s}  {distance:8.3f}  {floor:12.3f}  {distance / floor:5.2f}")
    lines.append(f"  {'mean':24s}  {scores.distances.mean:8.3f}  {scores.floor.mean:12.3f}  {scores.ratio:5.2f}")
    return lines


def _key_figures(realism: Realism) -> list[KeyFigure]:
    """Of the shortest free runs: how near, how well separated."""
    figures = []
    slow = next((one for one in realism.conditions if one.condition.slow), None)
    free = next((one for one in realism.conditions if not one.condition.slow and not one.condition.same_start), None)
    if slow is not None:
        ratio = slow.families["metrics"].ratio
        figures.append(KeyFigure(f"{ratio:.2f}", "ten metrics / real drivers", slow.condition.name, _tone(ratio)))
    for one in (slow, free):
        if one is not None and one.alone is not None:
            what = ", with the sensor" if one.with_sensor else ""
            figures.append(KeyFigure(f"{one.alone.auc:.2f}", "classifier AUC", f"{one.condition.name}{what}"))
    return figures


def blocks_of(scores: ProfileScores) -> dict[str, float]:
    """Every block of the fair measure as a ratio to what other real drivers get: 1 is as good as it gets. [-]

    Families of differences by condition; the classifiers: 1 at AUC 0.5, 2 at AUC 1.
    """
    blocks = {}
    for one in scores.realism.conditions:
        for family, beside in one.families.items():
            if isfinite(beside.ratio):
                blocks[f"{FAMILIES[family]}, {one.condition.name}"] = beside.ratio
        for name, area in (("classifier", one.alone), ("classifier with context", one.jointly)):
            if area is not None:
                blocks[f"{name}, {one.condition.name}"] = 1.0 + 2.0 * max(area.auc - 0.5, 0.0)
    return blocks


def worst_block(scores: ProfileScores) -> tuple[str, float]:
    """Name and ratio of the block that does worst."""
    blocks = blocks_of(scores)
    worst = max(blocks, key=blocks.__getitem__)
    return worst, blocks[worst]


def _worst_line(scores: ProfileScores) -> str:
    block, ratio = worst_block(scores)
    return f"worst comparison: {block}, {ratio:.2f} times that between real drivers"


def _tone(ratio: float) -> Tone:
    return "good" if ratio <= CLOSE else "bad" if ratio >= FAR else ""


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
