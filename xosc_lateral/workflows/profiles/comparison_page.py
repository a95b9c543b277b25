"""Several profiles side by side, as a result with its text, JSON and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import aligned
from xosc_lateral.drivers.evaluation import look_words
from xosc_lateral.drivers.evaluation.lane_keeping import HIGHWAY_DRIVES, HIGHWAY_SPEED
from xosc_lateral.drivers.evaluation.metrics import METRICS
from xosc_lateral.drivers.evaluation.profile_comparison import Compared, ComparedProfile, compare
from xosc_lateral.drivers.evaluation.scores import SNIPPET
from xosc_lateral.drivers.evaluation.sizes import FAST_S, QUANTITIES, SIGNIFICANCE_LEVEL, SLOW_S, Difference, surest
from xosc_lateral.files.pages.chart import color_of
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Page
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.workflows.profiles.cards import figures_record
from xosc_lateral.workflows.profiles.effect_words import effect_line
from xosc_lateral.workflows.result import PathLike, Result, write_page

__all__ = ["ProfileComparison", "compare"]

SHOWN_S = 120.0  # Length of the sample paths in the figure. [s]
PATH_SPACING = 0.8  # Between the zero lines of two sample paths. [m]
MAXIMUM_DRAWN = 12  # So many profiles are drawn at most; the distances are of all.


def comparison_text(compared: Compared) -> str:
    """A table of the profiles, and one of their pairs: verdict, distance, what they differ by."""
    profiles, pairs = (
        aligned([list(rows[0]), *(list(row.values()) for row in rows)])
        for rows in ([_row(each) for each in compared.profiles], _pairs(compared))
    )
    alike = (f"alike: {', '.join(group)}" for group in compared.groups if len(group) > 1)
    notes = f"{_distance_note(compared)}.", *alike, *looks_of(compared)
    return "\n".join([*profiles, f"{FIGURES_NOTE}.", "", *pairs, *notes])


def looks_of(compared: Compared) -> list[str]:
    """What the closing look found at the fit of each, a line each."""
    return [words for each in compared.profiles if (words := look_words.in_words(each.profile))]


FIGURES_NOTE = (
    f"sampled in even traffic at {3.6 * HIGHWAY_SPEED:.0f} km/h, {HIGHWAY_DRIVES} drives of an hour; +-: 95 %, if as "
    "much driving as each was fitted on were recorded again"
)
"""What the figures of a profile are."""


def _distance_note(compared: Compared) -> str:
    """What a distance means, in metres, and what the rest of the table is."""
    scale = dict(zip(METRICS, compared.scale.tolist(), strict=True))
    return (
        f"distance: of the ten metrics of {SNIPPET:g} s snippets, on average; 1.00 is as far as single snippets "
        f"differ: {scale['mean']:.2f} m in their mean, {scale['std']:.2f} m in their standard deviation. Mean offset: "
        f"the second's less the first's; movement, slow (beyond {SLOW_S:g} s) and fast (from {FAST_S:g} s): the "
        f"second's over the first's; 95 % intervals by the drives of the fits. Told apart is what has a p below "
        f"{SIGNIFICANCE_LEVEL:g}, all three considered; of others, what as much driving would show in 4 of 5 cases"
    )


def _pairs(compared: Compared) -> list[dict[str, str]]:
    """A row for each pair of profiles, the most different first."""
    distance, names, differences = compared.distance, compared.names, compared.differences
    rows = []
    for a, b in sorted(combinations(range(len(names)), 2), key=lambda pair: -distance[pair]):
        parts = differences[names[a], names[b]]
        words = {part.quantity: _difference_words(part) for part in parts}
        rows.append(
            {"profiles": f"{names[a]}, {names[b]}", "verdict": _verdict(parts), "distance": f"{distance[a, b]:.2f}"}
            | {quantity: words.get(quantity, "not known") for quantity in QUANTITIES}
        )
    return rows


def _verdict(parts: Sequence[Difference]) -> str:
    """What tells two profiles apart; else what would, in as much driving as there was."""
    p_value = surest(parts)
    if p_value <= SIGNIFICANCE_LEVEL:
        surely = "p < 1e-06" if p_value < 1e-6 else f"p = {p_value:.1g}"
        return f"differ in {min(parts, key=lambda part: part.p_value).quantity}, {surely}"
    least = (f"{np.exp(part.least):.1f} times" if part.is_factor else f"{part.least:.2f} m" for part in parts)
    return f"not told apart; {', '.join(least)} would be"


def _difference_words(part: Difference) -> str:
    low, high = part.interval
    if part.is_factor:
        return f"{np.exp(part.size):.2f} ({np.exp(low):.2f} to {np.exp(high):.2f})"
    return f"{part.size:+.2f} +- {0.5 * (high - low):.2f} m"


def _row(each: ComparedProfile) -> dict[str, str]:
    summary, keeping = each.summary, each.keeping
    return {
        "profile": each.profile.name,
        "mean [m]": keeping.line("mean"),
        "SDLP [m]": keeping.line("sdlp"),
        "over all drivers [m]": f"{summary.spread:.2f}",
        "5 % to 95 % [m]": f"{summary.low:+.2f} to {summary.high:+.2f}",
        "lateral speed [m/s]": f"{summary.lateral_speed:.3f}",
        "to the line [s]": keeping.line("line_crossing", digits=1),
        "effects": str(len(each.profile.effects)),
    }


def comparison_record(compared: Compared) -> dict[str, Any]:
    """The same as plain values."""
    return {
        "profiles": [
            {
                "id": each.profile.name,
                "sha256": profile_hash(each.profile),
                "model": each.profile.model.kind,
                **figures_record(each.summary, each.keeping),
                "look": each.profile.provenance.fit.get("look"),
                "effects": [effect_line(effect, each.profile.effects) for effect in each.profile.effects],
            }
            for each in compared.profiles
        ],
        "distance": _rounded_rows(compared.distance),
        "metrics": {name: _rounded_rows(compared.metrics[:, :, k]) for k, name in enumerate(METRICS)},
        "floor": round(float(compared.floors.max()), 4),
        "floors": _rounded_rows(compared.floors),
        "differences": [
            {"profiles": list(pair), **_difference_record(part)}
            for pair, parts in compared.differences.items()
            for part in parts
        ],
        "alike": [list(group) for group in compared.groups],
        "seed": compared.seed,
    }


def _difference_record(part: Difference) -> dict[str, Any]:
    """In metres, or as a factor."""
    low, high = part.interval
    sizes = {"difference": part.size, "low": low, "high": high, "least": part.least}
    sizes = {name: round(float(np.exp(size) if part.is_factor else size), 4) for name, size in sizes.items()}
    return {"quantity": part.quantity, "unit": "-" if part.is_factor else "m", **sizes, "p_value": part.p_value}


def _rounded_rows(values: FloatArray) -> list[list[float]]:
    return [[round(value, 4) for value in row] for row in values.tolist()]


def comparison_figure(compared: Compared) -> Figure:
    """Where in the lane, how fast (spectrum), and sample paths, a colour per profile."""
    figure = Figure(1, 3, height=180.0, legend=True)
    place, power, paths = figure.panels
    shown = compared.profiles[:MAXIMUM_DRAWN]
    for number, each in enumerate(shown):
        color, name, step = color_of(number), each.profile.name, each.profile.model.step
        heights, edges = np.histogram(each.runs, np.linspace(-1.0, 1.0, 81), density=True)
        place.line(0.5 * (edges[1:] + edges[:-1]), heights, color, label=name)
        power.line(each.spectrum.frequency, each.spectrum.density, color, label=name)
        run = each.runs[0][: round(SHOWN_S / step)] + PATH_SPACING * (len(shown) - number)
        paths.line(step * np.arange(len(run)), run, color, label=name)
    power.x.log = power.y.log = True
    place.title, place.x.label, place.y.label = "Distribution", "offset [m], positive to the left", "density [1/m]"
    power.title, power.x.label, power.y.label = "Spectrum", "frequency [Hz]", "power density [m²/Hz]"
    paths.title, paths.x.label, paths.y.ticks = f"Sample paths, {PATH_SPACING:g} m apart", "time [s]", []
    return figure


def _nowrap(row: dict[str, str]) -> dict[str, str]:
    """Intervals as a page has them, each on one line."""
    return {name: text.replace(" +- ", "\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}") for name, text in row.items()}


def comparison_page(compared: Compared) -> str:
    """HTML page: a figure and two tables; same values, same bytes."""
    names = compared.names
    page = Page(f"{len(names)} driver profiles compared")
    alike = "; ".join(", ".join(group) for group in compared.groups if len(group) > 1)
    pairs = _pairs(compared)
    apart = sum(row["verdict"].startswith("differ") for row in pairs)
    finding = f"{apart} of {len(pairs)} pairs are told apart"
    if len(pairs) == 1:
        finding = f"{pairs[0]['profiles'].replace(', ', ' and ')}: {pairs[0]['verdict']}"
    page.lead(f"{finding}{f'; alike: {alike}' if alike else ''}.")
    more = f"; {len(names) - MAXIMUM_DRAWN} more are left out of the figure" if len(names) > MAXIMUM_DRAWN else ""
    page.figure(
        comparison_figure(compared),
        f"Distribution of the offset, power spectral density and a sample path of each profile{more}.",
        "Densities, spectra and sample paths of the profiles",
    )
    page.section("Which differ")
    page.table([_nowrap(row) for row in pairs])
    note = _distance_note(compared)
    page.text(f"{note[0].upper()}{note[1:]}.", *(f"{words}." for words in looks_of(compared)))
    page.section("Summary")
    page.table([_nowrap(_row(each)) for each in compared.profiles], FIGURES_NOTE.replace("+-", "±"))
    return page.html(
        {"seed": compared.seed, **{each.profile.name: profile_hash(each.profile)[:12] for each in compared.profiles}}
    )


@dataclass(frozen=True, eq=False, repr=False)
class ProfileComparison(Result):
    """Profiles side by side."""

    _compared: Compared

    def headline(self) -> str:
        """One line."""
        return ", ".join(self._compared.names)

    def __str__(self) -> str:
        return comparison_text(self._compared)

    def to_frame(self) -> pd.DataFrame:
        """Mean distance of the ten metrics of each profile (row) from each (column), in standard deviations."""
        names = self._compared.names
        return pd.DataFrame(self._compared.distance, index=names, columns=names)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return comparison_record(self._compared)

    def plot(self) -> Figure:
        """Spread, spectrum and sample paths side by side."""
        return comparison_figure(self._compared)

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page."""
        return write_page(path, "profiles.html", lambda: comparison_page(self._compared), force=force)
