"""The fair measure as lines and table rows: the headline of `evaluate`."""

from __future__ import annotations

from collections.abc import Mapping

from xosc_lateral.base.grouping import grouped
from xosc_lateral.drivers.evaluation.classifier import TwoSampleResult
from xosc_lateral.drivers.evaluation.lane_keeping import INDICATORS
from xosc_lateral.drivers.evaluation.realism import ConditionScores, Realism
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.profile import DriverProfile

FAMILY_LABELS: Mapping[str, str] = {
    "metrics": "ten metrics",
    "lane_keeping": "lane keeping",
    "spectrum": "spectrum",
    "memory": "autocorrelation",
    "energy_score": "energy score",
    "variogram_score": "variogram score",
}
"""Kinds of difference, for readers."""

AREA_LABELS: Mapping[str, str] = {
    "alone": "classifier AUC",
    "jointly": "classifier AUC, movement and context",
    "floor": "classifier AUC, real drivers",
}

INDICATOR_LABELS: Mapping[str, str] = {
    "sdlp": "standard deviation within a snippet [m]",
    "tlc_min": "smallest time to line crossing [s]",
    "tlc_median": "median time to line crossing [s]",
    "beyond_wandering_zone": "share of time beyond the wandering zone (UN R157)",
    "near_marking": "share of time near a marking",
    "lateral_acceleration": "lateral acceleration, rms [m/s²]",
    "lateral_jerk": "lateral jerk, rms [m/s³]",
}

START_FADE_NOTE = (
    "The two-level model fades from the measured start into its own movement within the first second, which raises "
    "diff. std of snippets with the same start slightly."
)
"""Said where that metric is judged: 5 % on the motorway recording, with and without the fade."""


def start_fade_note(profile: DriverProfile) -> str:
    """What a reader of metrics from the same start has to know about the profile's model; empty: nothing."""
    return START_FADE_NOTE if profile.model.kind == ModelKind.TWO_LEVEL else ""


def condition_groups(realism: Realism) -> dict[str, list[ConditionScores]]:
    """Conditions that differ in length alone, the most telling first: heading -> by length."""
    ordered = sorted(realism.conditions, key=lambda each: (not each.condition.slow, each.condition.same_start))
    return grouped(
        (
            f"{'same start' if each.condition.same_start else 'free runs'}, below {each.condition.below:g} Hz "
            f"({'driver and sensor' if each.with_sensor else 'driver'})",
            each,
        )
        for each in ordered
    )


def ratio_rows(group: list[ConditionScores]) -> list[dict[str, object]]:
    """A row for each family and each classifier, a column for each length."""
    families = {
        label: {
            _length(each): f"{each.families[family].ratio:.2f}" if family in each.families else "" for each in group
        }
        for family, label in FAMILY_LABELS.items()
    }
    areas = {label: {_length(each): _area(getattr(each, key)) for each in group} for key, label in AREA_LABELS.items()}
    return [
        {"ratio to real drivers": label, **cells} for label, cells in (families | areas).items() if any(cells.values())
    ]


def _area(area: TwoSampleResult | None) -> str:
    return "" if area is None else f"{area.auc:.2f} ({area.low:.2f}-{area.high:.2f})"


def indicator_rows(scores: ConditionScores) -> list[dict[str, object]]:
    """A row for each lane-keeping indicator: means, distance, that between real drivers."""
    return [
        {
            "indicator": INDICATOR_LABELS[name],
            "measured": scores.means[name][0],
            "sampled": scores.means[name][1],
            "distance [sd]": scores.named[name].value,
            "real drivers [sd]": scores.named[name].floor,
        }
        for name in INDICATORS
    ]


def realism_lines(realism: Realism) -> list[str]:
    """For the terminal."""
    lines = ["compared with other real drivers (1: as close as they are; AUC 0.5: not distinguishable)"]
    for heading, group in condition_groups(realism).items():
        lines.append(f"  {heading:46s}" + "".join(f"{_length(each):>18s}" for each in group))
        for row in ratio_rows(group):
            label, *cells = row.values()
            lines.append(f"    {label!s:44s}" + "".join(f"{cell!s:>18s}" for cell in cells))
    lines += ["    classifier AUC: not computed"] * all(each.alone is None for each in realism.conditions)
    shown = next((each for each in realism.conditions if not each.condition.same_start), None)
    if shown is not None:
        lines.append(f"lane keeping, {shown.condition.name:24s} measured    sampled   distance  real drivers [sd]")
        lines += [
            f"  {label!s:40s}{real:8.4f}  {sampled:9.4f}  {distance:9.3f}  {floor:12.3f}"
            for label, real, sampled, distance, floor in (row.values() for row in indicator_rows(shown))
        ]
    measured, sampled = (
        f"{each.between:.4f}, {each.within:.4f}, {each.inside:.4f}"
        for each in (realism.variance_real, realism.variance_sampled)
    )
    what = "variance between drivers, within drivers, inside snippets [m²]"
    return [*lines, f"{what}: measured {measured}; sampled {sampled}"]


def _length(each: ConditionScores) -> str:
    return f"{each.condition.seconds:g} s"
