"""Several profiles side by side, as text, JSON and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.evaluation.metrics import METRICS
from xosc_lateral.drivers.evaluation.profile_comparison import Compared, ComparedProfile
from xosc_lateral.drivers.evaluation.scores import SNIPPET
from xosc_lateral.drivers.evaluation.sizes import LEVEL, Difference
from xosc_lateral.files.pages.chart import color_of
from xosc_lateral.files.pages.figure import Figure
from xosc_lateral.files.pages.page import Page
from xosc_lateral.files.profiles import profile_hash
from xosc_lateral.workflows.profiles.cards import keeping_record, rounded

SHOWN_S = 120.0
"""Length of the sample paths in the figure. [s]"""

SPACING = 0.8
"""Between the zero lines of two sample paths. [m]"""

MAXIMUM_DRAWN = 12
"""So many profiles are drawn at most; the distances are of all."""

MAXIMUM_WORDED = 4
"""Of so many profiles at most, what each pair differs by stands in the text; the JSON has all."""


def comparison_text(compared: Compared) -> str:
    """Table of summaries, distances, and who is alike."""
    rows = [_row(one) for one in compared.profiles]
    widths = [max(len(column), *(len(row[column]) for row in rows)) for column in rows[0]]
    lines = [
        "  ".join(f"{text:<{width}}" for text, width in zip(texts, widths, strict=True))
        for texts in (list(rows[0]), *(list(row.values()) for row in rows))
    ]
    lines.append(
        f"mean distance of ten metrics of {SNIPPET:g} s snippets, in standard deviations "
        "(diagonal: from itself, by the chance of as much driving as it was fitted on, 95 % quantile):"
    )
    width = max(map(len, compared.names))
    for name, distances in zip(compared.names, compared.distance, strict=True):
        lines.append(f"  {name:<{width}}  " + " ".join(f"{value:5.2f}" for value in distances))
    if len(compared.profiles) <= MAXIMUM_WORDED:
        lines.append("second beside first (95 % interval; in brackets the least that as much driving would show):")
        lines += [f"  {' and '.join(pair)}: {_pair_words(parts)}" for pair, parts in compared.differences.items()]
    lines += [f"alike: {', '.join(group)}" for group in compared.groups if len(group) > 1]
    return "\n".join(line.rstrip() for line in lines)


def _pair_words(parts: Sequence[Difference]) -> str:
    """What two profiles differ by, and whether that is more than chance."""
    words = []
    for part in parts:
        low, high = part.interval
        if part.is_factor:
            size, least = f"{np.exp(part.size):.2f} times ({np.exp(low):.2f} to {np.exp(high):.2f})", np.exp(part.least)
        else:
            size, least = f"{part.size:+.3f} m ({low:+.3f} to {high:+.3f})", part.least
        words.append(f"{part.quantity} {size} [{least:.2f}]")
    p_value = min((part.p_value for part in parts), default=1.0)
    verdict = "differ" if p_value <= LEVEL else "not told apart"
    return f"{', '.join(words)}: {verdict} (p = {p_value:.2g})" if parts else "nothing is known of both"


def _row(one: ComparedProfile) -> dict[str, str]:
    summary, keeping = one.summary, one.keeping
    return {
        "profile": one.profile.name,
        "model": one.profile.model.kind,
        "mean [m]": f"{summary.mean_offset + 0.0:+.2f}".replace("-0.00", "0.00").replace("+0.00", "0.00"),
        "spread [m]": f"{summary.spread:.2f}",
        "of one driver [m]": f"{summary.spread_within:.2f}",
        "5 % to 95 % [m]": f"{summary.low:+.2f} to {summary.high:+.2f}",
        "lateral speed [m/s]": f"{summary.lateral_speed:.3f}",
        "SDLP [m]": keeping.line("sdlp", ""),
        "lane drifts [1/h]": keeping.line("drifts", "", 1),
        "to the line [s]": keeping.line("line_crossing", "", 1),
        "effects": ", ".join(_effects(one)) or "none",
    }


def _effects(one: ComparedProfile) -> list[str]:
    found = []
    for values in one.profile.to_dict()["effects"]:
        columns = values.get("column") or "*".join(factor["column"] for factor in values.get("factors", ()))
        found.append(f"{columns} ({values['kind']})" if columns else str(values["kind"]))
    return found


def comparison_record(compared: Compared) -> dict[str, Any]:
    """The same as plain values."""
    return {
        "profiles": [
            {
                "id": one.profile.name,
                "sha256": profile_hash(one.profile),
                "model": one.profile.model.kind,
                "summary": rounded(asdict(one.summary)),
                "lane_keeping": keeping_record(one.keeping),
                "effects": _effects(one),
            }
            for one in compared.profiles
        ],
        "distance": _rounded_rows(compared.distance),
        "metrics": {name: _rounded_rows(compared.metrics[:, :, k]) for k, name in enumerate(METRICS)},
        "floor": round(float(compared.floors.max()), 4),
        "floors": _rounded_rows(compared.floors),
        "differences": [
            {"profiles": list(pair), "quantity": part.quantity, "p_value": part.p_value}
            | {"unit": "-" if part.is_factor else "m"}
            | {
                name: round(float(np.exp(value) if part.is_factor else value), 4)
                for name, value in zip(
                    ("difference", "low", "high", "least"), (part.size, *part.interval, part.least), strict=True
                )
            }
            for pair, parts in compared.differences.items()
            for part in parts
        ],
        "alike": [list(group) for group in compared.groups],
        "seed": compared.seed,
    }


def _rounded_rows(values: FloatArray) -> list[list[float]]:
    return [[round(value, 4) for value in row] for row in values.tolist()]


def comparison_figure(compared: Compared) -> Figure:
    """Where in the lane, how fast (spectrum), and sample paths, a colour per profile."""
    figure = Figure(1, 3, height=180.0, legend=True)
    place, power, paths = figure.panels
    shown = compared.profiles[:MAXIMUM_DRAWN]
    for number, one in enumerate(shown):
        color, name, step = color_of(number), one.profile.name, one.profile.model.step
        heights, edges = np.histogram(one.runs, np.linspace(-1.0, 1.0, 81), density=True)
        place.line(0.5 * (edges[1:] + edges[:-1]), heights, color, label=name)
        power.line(one.spectrum.frequency, one.spectrum.density, color, label=name)
        run = one.runs[0][: round(SHOWN_S / step)] + SPACING * (len(shown) - number)
        paths.line(step * np.arange(len(run)), run, color, label=name)
    power.x.log = power.y.log = True
    place.title, place.x.label, place.y.label = "Distribution", "offset [m], positive to the left", "density [1/m]"
    power.title, power.x.label, power.y.label = "Spectrum", "frequency [Hz]", "power density [m²/Hz]"
    paths.title, paths.x.label, paths.y.ticks = f"Sample paths, {SPACING:g} m apart", "time [s]", []
    return figure


def comparison_page(compared: Compared) -> str:
    """HTML page: a figure and two tables; same values, same bytes."""
    names = compared.names
    page = Page(f"{len(names)} driver profiles compared")
    alike = "; ".join(", ".join(group) for group in compared.groups if len(group) > 1)
    page.lead(
        "Every profile is sampled in steady traffic on a straight road, at its own lane width. "
        + (f"These profiles are not distinguishable: {alike}." if alike else "All of them differ from each other.")
    )
    page.section("Summary")
    page.table(
        [
            {name: text.replace(" +- ", "\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}") for name, text in _row(one).items()}
            | {"effects": len(one.profile.effects)}
            for one in compared.profiles
        ]
    )
    more = f"; {len(names) - MAXIMUM_DRAWN} more are left out of the figure" if len(names) > MAXIMUM_DRAWN else ""
    page.figure(
        comparison_figure(compared),
        f"Distribution of the offset, power spectral density and a sample path of each profile{more}.",
        "Densities, spectra and sample paths of the profiles",
    )
    page.section("Distances")
    page.table(
        [
            {"profile": name, **dict(zip(names, row, strict=True))}
            for name, row in zip(names, compared.distance.tolist(), strict=True)
        ],
        f"Mean Wasserstein distance of the ten metrics of snippets of {SNIPPET:g} s, in standard deviations over the "
        "snippets of all profiles. The diagonal shows how far random halves of a profile's own drivers are apart at "
        "most (95 % of them), which is sampling error alone.",
        formats=dict.fromkeys(names, ".2f"),
    )
    hashes = {one.profile.name: profile_hash(one.profile)[:12] for one in compared.profiles}
    return page.html({"seed": compared.seed, **hashes})
