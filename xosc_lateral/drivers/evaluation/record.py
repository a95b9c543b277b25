"""Scores as plain values: what `evaluate --json` prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any

from xosc_lateral.base.numbers import all_significant, significant
from xosc_lateral.drivers.evaluation.lane_keeping import UNITS, Margins
from xosc_lateral.drivers.evaluation.realism import Beside, ConditionScores, VarianceParts
from xosc_lateral.drivers.evaluation.scores import LAGS, ProfileScores, SnippetScores


def scores_to_dict(scores: ProfileScores) -> dict[str, Any]:
    """Plain JSON values, for `--json` and for a profile's provenance (without the single snippets)."""
    return {
        "profile": scores.profile,
        "seed": scores.seed,
        "drives": scores.drives,
        "runs": scores.runs,
        "hours": round(scores.hours, 4),
        "verdict": {
            "words": scores.verdict.in_words(),
            "like_up_to_hz": scores.verdict.like_up_to,
            "bands": [
                {
                    "low_hz": band.low,
                    "high_hz": band.high,
                    "ratio": significant(band.ratio, 3),
                    "error": round(band.error, 3),
                    "is_like": band.is_like,
                }
                for band in scores.verdict.bands
            ],
            "alarms_per_hour": {
                f"{speed:g}": {
                    "real": round(real, 1) if scores.verdict.shows_alarms else None,
                    "sampled": round(made, 1),
                }
                for speed, (real, made) in scores.verdict.alarms.items()
            },
        },
        "compared_below_hz": scores.below,
        "realism": [_condition_to_dict(each) for each in scores.realism.conditions],
        "variance_m2": {
            "real": _variance_to_dict(scores.realism.variance_real),
            "sampled": _variance_to_dict(scores.realism.variance_sampled),
        },
        "snippets": _snippets_to_dict(scores.snippets),
        "long_snippets": None if scores.long_snippets is None else _snippets_to_dict(scores.long_snippets),
        "evaluations": [
            {
                "number": each.number,
                "coarse": each.coarse,
                "fine": each.fine,
                "distances": _rounded(each.distances.by_metric),
            }
            for each in scores.evaluations
        ],
        "spectrum": {
            "frequency_hz": [round(float(f), 5) for f in scores.spectrum_real.frequency],
            "real_m2_per_hz": list(all_significant(scores.spectrum_real.density, 4)),
            "sampled_m2_per_hz": list(all_significant(scores.spectrum_sampled.density, 4)),
            "error_db": round(scores.spectrum_error, 3),
        },
        "autocorrelation": {
            "lag_s": list(LAGS),
            "real": [round(float(v), 4) for v in scores.autocorrelation_real],
            "sampled": [round(float(v), 4) for v in scores.autocorrelation_sampled],
        },
        "margins": {"real": _margins_to_dict(scores.margins_real), "sampled": _margins_to_dict(scores.margins_sampled)},
        "classifier_auc": None if scores.classifier_auc is None else round(scores.classifier_auc, 4),
    }


def _snippets_to_dict(scores: SnippetScores) -> dict[str, Any]:
    worst, ratio = scores.worst_ratio
    return {
        "seconds": scores.seconds,
        "count": scores.count,
        "distance": _rounded(scores.distances.by_metric),
        "floor": _rounded(scores.floor.by_metric),
        "mean_distance": round(scores.distances.mean, 4),
        "mean_floor": round(scores.floor.mean, 4),
        "mean_ratio": round(scores.ratio, 3),
        "worst_metric": worst,
        "worst_ratio": round(ratio, 3),
    }


def _condition_to_dict(scores: ConditionScores) -> dict[str, Any]:
    areas = {"movement": scores.alone, "with_context": scores.jointly, "real_drivers": scores.floor}
    return {
        "seconds": scores.condition.seconds,
        "start": "same" if scores.condition.same_start else "free",
        "band": f"below {scores.condition.below:g} Hz" if scores.condition.slow else "all",
        "sampled": "driver and sensor" if scores.with_sensor else "driver",
        "count": scores.count,
        "families": {name: {**_beside_to_dict(value), "unit": value.unit} for name, value in scores.families.items()},
        "distances": {name: _beside_to_dict(value) for name, value in scores.named.items()},
        "indicators": {
            name: {"real": round(real, 5), "sampled": round(sampled, 5), "unit": unit}
            for (name, (real, sampled)), unit in zip(scores.means.items(), UNITS, strict=True)
        },
        "auc": None
        if scores.alone is None
        else {name: None if area is None else _rounded(asdict(area)) for name, area in areas.items()},
    }


def _beside_to_dict(number: Beside) -> dict[str, float | None]:
    ratio = round(number.ratio, 3) if isfinite(number.ratio) else None
    return {"value": round(number.value, 4), "floor": round(number.floor, 4), "ratio": ratio}


def _variance_to_dict(parts: VarianceParts) -> dict[str, float]:
    named = {"between_drivers": parts.between, "within_drivers": parts.within, "inside_snippets": parts.inside}
    return _rounded(named, 6)


def _margins_to_dict(margins: Margins) -> dict[str, float]:
    return {
        "share_near_marking": round(margins.share_near, 5),
        "excursions_per_hour": round(margins.excursions_per_hour, 2),
        "largest_offset_m": round(margins.largest, 3),
    }


def _rounded(values: Mapping[str, float], digits: int = 4) -> dict[str, float]:
    return {name: round(value, digits) for name, value in values.items()}
