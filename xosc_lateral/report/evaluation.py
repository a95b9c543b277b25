"""Scores of a profile as text, JSON and a report with the paper's violins."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral import __version__
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.hashes import file_hash
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.loop.longterm import Margins
from xosc_lateral.loop.metrics import METRICS
from xosc_lateral.loop.scores import PartEvaluation, ProfileScores, SnippetScores, scores_to_dict
from xosc_lateral.report.figures import GRID, INK, MEASURED, SAMPLED, figure_style, new_figure
from xosc_lateral.report.page import KeyFigure, Page, Tone

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

LABELS = {
    "max": "maximum",
    "min": "minimum",
    "mean": "mean",
    "std": "std. deviation",
    "median": "median",
    "q25": "25 % quantile",
    "q75": "75 % quantile",
    "range": "range",
    "diff_mean": "diff. mean × 10",
    "diff_std": "diff. std × 10",
}
CLOSE, FAR = 1.2, 2.0
"""Ratios to the floor up to which a metric is marked good, and from which it is marked bad."""
SHOWN_QUANTILES = (0.001, 0.999)
"""Violins are drawn within these; minimum and maximum are bars of their own."""


def evaluation_text(scores: ProfileScores, profile: DriverProfile, tables: Sequence[Path]) -> str:
    """A table for the terminal."""
    lines = [
        f"{scores.profile} on {scores.hours:.2f} h of {scores.drives} drives ({scores.runs} runs), seed {scores.seed}",
        *([FITTED] if _fitted_on(profile, tables) else []),
        *_snippet_lines(scores.snippets),
    ]
    if scores.long_snippets is not None:
        lines += _snippet_lines(scores.long_snippets)
    lines.append("mean distance of the four evaluations (coarse + fine):")
    lines += [
        f"  ({one.number}) {one.coarse} + {one.fine}: {one.distances.mean:.3f}, worst {one.distances.worst} "
        f"{one.distances.by_metric[one.distances.worst]:.3f}"
        for one in scores.evaluations
    ]
    lines.append(f"spectrum: {scores.spectrum_error:.1f} dB apart (rms over bands)")
    for name, one in (("measured", scores.margins_real), ("sampled", scores.margins_sampled)):
        lines.append(
            f"near a marking, {name}: {100 * one.share_near:.2f} % of the time, "
            f"{one.excursions_per_hour:.1f} times an hour"
        )
    lines.append(f"classifier AUC: {_auc(scores.classifier_auc)}")
    return "\n".join(lines)


FITTED = (
    "The profile was fitted to these drives: the scores say how well it describes them, not what it is worth on others."
)


def evaluation_json(scores: ProfileScores, profile: DriverProfile, tables: Sequence[Path]) -> str:
    """One JSON object: the scores and what is needed to get them again."""
    return json.dumps({**scores_to_dict(scores), "provenance": _provenance(scores, profile, tables)})


def write_evaluation(scores: ProfileScores, profile: DriverProfile, tables: Sequence[Path], path: Path) -> None:
    """Write the report, whole or not at all."""
    write_atomically(path, evaluation_page(scores, profile, tables).html())


def evaluation_page(scores: ProfileScores, profile: DriverProfile, tables: Sequence[Path]) -> Page:
    """The report."""
    page = Page(f"Evaluation of {scores.profile}")
    worst, ratio = scores.snippets.worst_ratio
    page.lead(
        f"{scores.hours:.1f} h of measured driving ({scores.drives} drives) beside what the profile `{scores.profile}` "
        "samples from the same starts under the same context. Distances are Wasserstein distances in units of the real "
        "metric's standard deviation; the floor is what real data has against other real data.",
        [
            KeyFigure(f"{scores.snippets.ratio:.2f}", "distance / floor, ten metrics", "1: as close as real to real"),
            KeyFigure(f"{ratio:.2f}", f"worst metric: {LABELS[worst]}", "distance / floor", _tone(ratio)),
            KeyFigure(_auc(scores.classifier_auc), "classifier AUC", "0.5: can't tell sampled from real"),
            KeyFigure(f"{scores.spectrum_error:.1f} dB", "spectrum", "rms difference over the bands"),
        ],
    )
    if _fitted_on(profile, tables):
        page.warning(FITTED)
    page.section("Ten metrics of 10 s snippets")
    _metric_table(page, scores.snippets)
    page.figure(
        violin_figure(scores.evaluations[3]),
        "Real (left, blue) beside sampled (right) snippets; bars: minimum, mean, maximum.",
        f"Ten pairs of violins; mean distance {scores.evaluations[3].distances.mean:.3f}.",
    )
    if scores.long_snippets is not None:
        page.section("Snippets of 60 s", "The same over a minute: slow movement, which 10 s don't show.")
        _metric_table(page, scores.long_snippets)
    _parts_section(page, scores)
    page.section("Spectrum and memory")
    page.figure(spectrum_figure(scores), "Power density of the offset.", "Measured and sampled spectrum, log-log.")
    page.figure(
        memory_figure(scores),
        "Correlation of the offset with itself some seconds later, about the mean over all drivers.",
        "Measured and sampled autocorrelation over lag.",
    )
    page.section("Near the markings", "Reference point within 1.2 m of a marking: half a car and 0.3 m of air.")
    rows = (("measured", scores.margins_real), ("sampled", scores.margins_sampled))
    page.table([_margin_row(name, one) for name, one in rows])
    return page.provenance(_provenance(scores, profile, tables))


def _parts_section(page: Page, scores: ProfileScores) -> None:
    page.section(
        "The four evaluations",
        "Which part is at fault? Coarse and fine parts of measured snippets (split as in the paper) and of the "
        "profile, combined. (1) shifts the real fine part by 5 s: the best that the split allows.",
    )
    page.table(
        [
            {
                "evaluation": f"({one.number})",
                "coarse part": one.coarse,
                "fine part": one.fine,
                "mean distance": one.distances.mean,
                **{LABELS[name]: one.distances.by_metric[name] for name in ("std", "range", "diff_mean", "diff_std")},
            }
            for one in scores.evaluations
        ]
    )
    for one in scores.evaluations[:3]:
        page.figure(
            violin_figure(one),
            f"({one.number}) {one.coarse} coarse part + {one.fine} fine part.",
            f"Ten pairs of violins; mean distance {one.distances.mean:.3f}.",
        )


def _metric_table(page: Page, scores: SnippetScores) -> None:
    rows: list[dict[str, object]] = []
    tones: dict[int, Tone] = {}
    for number, name in enumerate(METRICS):
        distance, floor = scores.distances.by_metric[name], scores.floor.by_metric[name]
        rows.append({"metric": LABELS[name], "distance": distance, "floor": floor, "ratio": distance / floor})
        tones[number] = _tone(distance / floor)
    rows.append(
        {"metric": "mean", "distance": scores.distances.mean, "floor": scores.floor.mean, "ratio": scores.ratio}
    )
    caption = f"{scores.count} snippets of {scores.seconds:g} s; distances in standard deviations of the real metric"
    formats = {"distance": ".3f", "floor": ".3f", "ratio": ".2f"}
    page.table(rows, caption, formats=formats, tones=tones)


def _margin_row(name: str, one: Margins) -> dict[str, object]:
    return {
        "drives": name,
        "time near a marking [%]": 100.0 * one.share_near,
        "excursions [1/h]": one.excursions_per_hour,
        "largest offset [m]": one.largest,
    }


# ---- figures ---------------------------------------------------------------------------------------------------------
@figure_style()
def violin_figure(evaluation: PartEvaluation) -> Figure:
    """Ten pairs of half violins, real beside artificial, with bars at minimum, mean and maximum."""
    figure, axes = new_figure(2, 5, height=5.0)
    for k, name in enumerate(METRICS):
        axis = axes[k // 5, k % 5]
        for values, side, color in (
            (evaluation.real[:, k], -1.0, MEASURED),
            (evaluation.artificial[:, k], 1.0, SAMPLED),
        ):
            _half_violin(axis, values, side, color)
        axis.set_title(LABELS[name])
        axis.set_xticks([-0.5, 0.5], ["real", "artificial"])
        axis.set_xlim(-1.15, 1.15)
        axis.grid(False, axis="x")
        if k % 5 == 0:
            axis.set_ylabel("m")
    return figure


def _half_violin(axis: Axes, values: FloatArray, side: float, color: str) -> None:
    grid, density = density_over(values)
    width = 0.95 * density / density.max()
    axis.fill_betweenx(grid, 0.0, side * width, color=color, alpha=0.35, linewidth=0)
    axis.plot(side * width, grid, color=color, linewidth=0.8)
    for value, reach in ((values.min(), 0.35), (values.mean(), 0.8), (values.max(), 0.35)):
        axis.plot([0.0, side * reach], [value, value], color=color, linewidth=1.6)
    axis.axvline(0.0, color=GRID, linewidth=0.8)


def density_over(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Grid over what violins show of the values, and their density on it (unscaled), shape (n,) each."""
    low, high = np.quantile(values, SHOWN_QUANTILES)
    grid = np.linspace(low, high, 120) if high > low else np.array([low - 1e-3, low, low + 1e-3])
    return grid, _density(values, grid)


def _density(values: FloatArray, grid: FloatArray) -> FloatArray:
    """Gaussian kernel density with Silverman's width, over a histogram: fast for any number of snippets."""
    step = grid[1] - grid[0]
    counts, _ = np.histogram(values, np.append(grid - 0.5 * step, grid[-1] + 0.5 * step))
    spread = min(values.std(), (np.quantile(values, 0.75) - np.quantile(values, 0.25)) / 1.349) or values.std()
    width = max(0.9 * spread * len(values) ** -0.2, step)
    kernel = np.exp(-0.5 * (np.arange(-len(grid) + 1, len(grid)) * step / width) ** 2)
    return np.asarray(np.convolve(counts, kernel, mode="valid") if len(grid) == 1 else _same(counts, kernel)) + 1e-12


def _same(counts: NDArray[np.int64], kernel: FloatArray) -> FloatArray:
    full = np.convolve(counts, kernel)
    start = (len(kernel) - 1) // 2
    return np.asarray(full[start : start + len(counts)], dtype=np.float64)


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


# ---- small things ----------------------------------------------------------------------------------------------------
def _snippet_lines(scores: SnippetScores) -> list[str]:
    lines = [f"{scores.count} snippets of {scores.seconds:g} s      distance  floor  ratio"]
    for name in METRICS:
        distance, floor = scores.distances.by_metric[name], scores.floor.by_metric[name]
        lines.append(f"  {LABELS[name]:24s}  {distance:8.3f}  {floor:5.3f}  {distance / floor:5.2f}")
    lines.append(f"  {'mean':24s}  {scores.distances.mean:8.3f}  {scores.floor.mean:5.3f}  {scores.ratio:5.2f}")
    return lines


def _tone(ratio: float) -> Tone:
    return "good" if ratio <= CLOSE else "bad" if ratio >= FAR else ""


def _auc(value: float | None) -> str:
    return "not computed" if value is None else f"{value:.3f}"


def _fitted_on(profile: DriverProfile, tables: Sequence[Path]) -> bool:
    known = set(profile.provenance.inputs.values())
    return any(file_hash(table) in known for table in tables)


def _provenance(scores: ProfileScores, profile: DriverProfile, tables: Sequence[Path]) -> dict[str, Any]:
    return {
        "profile": profile.name,
        "profile_sha256": profile_hash(profile),
        "inputs": {table.name: file_hash(table) for table in tables},
        "fitted_on_these": _fitted_on(profile, tables),
        "seed": scores.seed,
        "package_version": __version__,
    }
