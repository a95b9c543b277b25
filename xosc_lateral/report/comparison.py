"""Several profiles side by side: how each moves, how far each is from each, which are alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from xosc_lateral.arrays import FloatArray
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.evaluation.distances import wasserstein
from xosc_lateral.evaluation.lane_keeping import LaneKeeping, keeping_of
from xosc_lateral.evaluation.metrics import (
    DRIVERS,
    DURATION,
    METRICS,
    MovementSummary,
    cut_snippets,
    free_runs,
    snippet_metrics,
    summarise,
)
from xosc_lateral.evaluation.spectra import Spectrum, spectrum
from xosc_lateral.formats.profiles import profile_hash
from xosc_lateral.report.cards import keeping_record
from xosc_lateral.report.chart import color_of
from xosc_lateral.report.figure import Figure
from xosc_lateral.report.page import Page

SNIPPET = 10.0
"""Length of the snippets that are compared. [s]"""

SHOWN_S = 120.0
"""Length of the sample paths in the figure. [s]"""

SPACING = 0.8
"""Between the zero lines of two sample paths. [m]"""

HALVINGS, SURE = 40, 0.95
"""Random halves of a profile's drivers, and how many of them are no further apart than what counts as alike. [-]"""

SHOWN = 12
"""So many profiles are drawn at most; the distances are of all."""


@dataclass(frozen=True, eq=False, slots=True)
class Compared:
    """Profiles and how they differ.

    Parameters
    ----------
    profiles : tuple of DriverProfile
    summaries : tuple of MovementSummary
    keeping : tuple of LaneKeeping
    runs : tuple of array
        Free runs of each, shape (drivers, n). [m]
    spectra : tuple of Spectrum
    metrics : array, shape (k, k, 10)
        Wasserstein distance per metric, in standard deviations over all profiles' snippets. On the diagonal: of a
        profile from itself, as much driving as it was fitted on from as much other driving, half of its drivers at
        most, where the mean over the metrics is the 95 % quantile of random choices.
    seed : int
    """

    profiles: tuple[DriverProfile, ...]
    summaries: tuple[MovementSummary, ...]
    keeping: tuple[LaneKeeping, ...]
    runs: tuple[FloatArray, ...]
    spectra: tuple[Spectrum, ...]
    metrics: FloatArray
    seed: int

    @property
    def distance(self) -> FloatArray:
        """Mean over the ten metrics, shape (k, k). [-]"""
        return np.asarray(self.metrics.mean(axis=2))

    @property
    def floors(self) -> FloatArray:
        """Up to which distance two profiles are alike, shape (k, k): root mean square of both from themselves. [-]

        From itself is one piece of its free runs from another, each as long as the drives that it was fitted on, at
        most half of them: so far apart are two profiles of one driver by the chance of what was recorded.
        """
        own = np.diag(self.distance)
        return np.sqrt(0.5 * (own[:, None] ** 2 + own[None, :] ** 2))

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Profiles that are alike: no further apart (average linkage) than halves of their own drivers."""
        from scipy.cluster.hierarchy import fcluster, linkage
        from scipy.spatial.distance import squareform

        between = self.distance / np.maximum(self.floors, 1e-12)
        np.fill_diagonal(between, 0.0)
        labels = fcluster(linkage(squareform(between, checks=False), "average"), 1.0, "distance")
        names = [profile.name for profile in self.profiles]
        return tuple(tuple(names[k] for k in np.flatnonzero(labels == one)) for one in dict.fromkeys(labels))


def compare(profiles: Sequence[DriverProfile], seed: int) -> Compared:
    """Sample every profile in even traffic and measure each against each; the first's luck is no other's."""
    runs = [free_runs(profile, seed + number) for number, profile in enumerate(profiles)]
    snippets = [
        [snippet_metrics(cut_snippets(run, round(SNIPPET / profile.model.step) + 1)) for run in own]
        for profile, own in zip(profiles, runs, strict=True)
    ]
    pooled = [np.concatenate(own) for own in snippets]
    metrics = _gap_matrix(pooled, snippets, [_fitted_drivers(profile) for profile in profiles], seed)
    return Compared(
        tuple(profiles),
        tuple(summarise(own, profile.model.step) for profile, own in zip(profiles, runs, strict=True)),
        tuple(keeping_of(profile, seed) for profile in profiles),
        tuple(runs),
        tuple(spectrum(list(own), profile.model.step) for profile, own in zip(profiles, runs, strict=True)),
        metrics,
        seed,
    )


def _fitted_drivers(profile: DriverProfile) -> int:
    """Of how many free runs a profile's drives are worth, half of them where that is not known."""
    known = profile.provenance
    return round(3600.0 * known.hours / DURATION) if known.hours and "derived_from" not in known.fit else DRIVERS // 2


def _gap_matrix(
    pooled: Sequence[FloatArray], snippets: Sequence[Sequence[FloatArray]], fitted: Sequence[int], seed: int
) -> FloatArray:
    """Gaps of all metrics in standard deviations, shape (k, k, metrics); the diagonal is between halves. [-]"""
    scale = np.concatenate(pooled).std(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    count = len(pooled)
    metrics = np.empty((count, count, len(METRICS)))
    for one in range(count):
        metrics[one, one] = _from_itself(snippets[one], fitted[one], scale, np.random.default_rng([seed, one]))
        for other in range(one):
            metrics[one, other] = metrics[other, one] = _gaps(pooled[one], pooled[other]) / scale
    return metrics


def _from_itself(drivers: Sequence[FloatArray], fitted: int, scale: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Distance per metric, shape (10,), between those random pieces that are further apart than 95 % of them."""
    count = min(max(fitted, 1), len(drivers) // 2)
    found = []
    for _ in range(HALVINGS):
        order = rng.permutation(len(drivers)).tolist()
        half, rest = order[:count], order[-count:]
        found.append(_gaps(*(np.concatenate([drivers[k] for k in part]) for part in (half, rest))) / scale)
    means = [float(gaps.mean()) for gaps in found]
    return found[int(np.argsort(means)[round(SURE * (HALVINGS - 1))])]


def _gaps(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.array([wasserstein(one[:, k], other[:, k]) for k in range(one.shape[1])])


def comparison_text(compared: Compared) -> str:
    """Table of summaries, distances, and who is alike."""
    names = [profile.name for profile in compared.profiles]
    rows = _rows(compared)
    widths = [max(len(column), *(len(row[column]) for row in rows)) for column in rows[0]]
    lines = ["  ".join(f"{column:<{width}}" for column, width in zip(rows[0], widths, strict=True))]
    lines += ["  ".join(f"{text:<{width}}" for text, width in zip(row.values(), widths, strict=True)) for row in rows]
    distance = compared.distance
    lines.append(
        f"mean distance of ten metrics of {SNIPPET:g} s snippets, in standard deviations "
        "(diagonal: from itself, by the chance of as much driving as it was fitted on, 95 % quantile):"
    )
    width = max(map(len, names))
    for number, name in enumerate(names):
        lines.append(f"  {name:<{width}}  " + " ".join(f"{value:5.2f}" for value in distance[number]))
    lines.append("two profiles differ where their distance is above the root mean square of their diagonals")
    lines += [f"alike: {', '.join(group)}" for group in compared.groups if len(group) > 1]
    return "\n".join(line.rstrip() for line in lines)


def _rows(compared: Compared) -> list[dict[str, str]]:
    return [
        {
            "profile": profile.name,
            "model": profile.model.kind,
            "mean [m]": f"{one.mean_offset + 0.0:+.2f}".replace("-0.00", "0.00").replace("+0.00", "0.00"),
            "spread [m]": f"{one.spread:.2f}",
            "of one driver [m]": f"{one.spread_within:.2f}",
            "5 % to 95 % [m]": f"{one.low:+.2f} to {one.high:+.2f}",
            "lateral speed [m/s]": f"{one.lateral_speed:.3f}",
            "SDLP [m]": kept.line("sdlp", ""),
            "lane drifts [1/h]": kept.line("drifts", "", 1),
            "to the line [s]": kept.line("line_crossing", "", 1),
            "effects": ", ".join(_effect(values) for values in profile.to_dict()["effects"]) or "none",
        }
        for profile, one, kept in zip(compared.profiles, compared.summaries, compared.keeping, strict=True)
    ]


def _effect(values: dict[str, Any]) -> str:
    columns = values.get("column") or "*".join(factor["column"] for factor in values.get("factors", ()))
    return f"{columns} ({values['kind']})" if columns else str(values["kind"])


def comparison_record(compared: Compared) -> dict[str, Any]:
    """The same as plain values."""
    return {
        "profiles": [
            _profile_record(*all_of)
            for all_of in zip(compared.profiles, compared.summaries, compared.keeping, strict=True)
        ],
        "distance": [[round(float(value), 4) for value in row] for row in compared.distance],
        "metrics": {
            name: [[round(float(value), 4) for value in row] for row in compared.metrics[:, :, k]]
            for k, name in enumerate(METRICS)
        },
        "floor": round(float(compared.floors.max()), 4),
        "floors": [[round(float(value), 4) for value in row] for row in compared.floors],
        "alike": [list(group) for group in compared.groups],
        "seed": compared.seed,
    }


def _profile_record(profile: DriverProfile, summary: MovementSummary, keeping: LaneKeeping) -> dict[str, Any]:
    return {
        "id": profile.name,
        "sha256": profile_hash(profile),
        "model": profile.model.kind,
        "summary": {key: round(value, 4) for key, value in asdict(summary).items()},
        "lane_keeping": keeping_record(keeping),
        "effects": [_effect(values) for values in profile.to_dict()["effects"]],
    }


def comparison_figure(compared: Compared) -> Figure:
    """Where in the lane, how fast (spectrum), and sample paths, a colour per profile."""
    figure = Figure(1, 3, height=180.0, legend=True)
    place, power, paths = figure.panels
    shown = list(zip(compared.profiles, compared.runs, compared.spectra, strict=True))[:SHOWN]
    for number, (profile, runs, density) in enumerate(shown):
        color, name = color_of(number), profile.name
        heights, edges = np.histogram(runs, np.linspace(-1.0, 1.0, 81), density=True)
        place.line(0.5 * (edges[1:] + edges[:-1]), heights, color, label=name)
        power.line(density.frequency, density.density, color, label=name)
        run = runs[0][: round(SHOWN_S / profile.model.step)] + SPACING * (len(shown) - number)
        paths.line(profile.model.step * np.arange(len(run)), run, color, label=name)
    power.x.log = power.y.log = True
    place.title, place.x.label, place.y.label = "Distribution", "offset [m], positive to the left", "density [1/m]"
    power.title, power.x.label, power.y.label = "Spectrum", "frequency [Hz]", "power density [m²/Hz]"
    paths.title, paths.x.label, paths.y.ticks = f"Sample paths, {SPACING:g} m apart", "time [s]", []
    return figure


def comparison_page(compared: Compared) -> str:
    """HTML page: a figure and two tables; same values, same bytes."""
    names = [profile.name for profile in compared.profiles]
    page = Page(f"{len(names)} driver profiles compared")
    alike = "; ".join(", ".join(group) for group in compared.groups if len(group) > 1)
    page.lead(
        "Every profile is sampled in steady traffic on a straight road, at its own lane width. "
        + (f"These profiles are not distinguishable: {alike}." if alike else "All of them differ from each other.")
    )
    page.section("Summary")
    page.table(
        [row | {"effects": len(one.effects)} for row, one in zip(_rows(compared), compared.profiles, strict=True)]
    )
    more = f"; {len(names) - SHOWN} more are left out of the figure" if len(names) > SHOWN else ""
    page.figure(
        comparison_figure(compared),
        f"Distribution of the offset, power spectral density and a sample path of each profile{more}.",
        "Densities, spectra and sample paths of the profiles",
    )
    page.section("Distances")
    rows = [
        {"profile": name, **dict(zip(names, row, strict=True))}
        for name, row in zip(names, compared.distance.tolist(), strict=True)
    ]
    page.table(
        rows,
        f"Mean Wasserstein distance of the ten metrics of snippets of {SNIPPET:g} s, in standard deviations over the "
        "snippets of all profiles. The diagonal shows how far random halves of a profile's own drivers are apart at "
        "most (95 % of them), which is sampling error alone.",
        formats=dict.fromkeys(names, ".2f"),
    )
    hashes = {profile.name: profile_hash(profile)[:12] for profile in compared.profiles}
    return page.html({"seed": compared.seed, **hashes})
