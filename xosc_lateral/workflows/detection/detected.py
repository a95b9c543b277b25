"""What detectors did on sources, as values: what the text, the page and the JSON of `detect` are made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.detection.observation import Sensor
from xosc_lateral.workflows.detection.scoring import Case, Curve, Tally, worst_of
from xosc_lateral.workflows.detection.sources import Source


@dataclass(frozen=True, eq=False)
class Detected:
    """Tallies of every detector on every source, in the order of the sources."""

    tallies: Sequence[Tally]
    sources: Sequence[Source]
    sensor: Sensor
    seed: int
    still: frozenset[str]  # sources in which no vehicle moves inside its lane

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """Of each tally."""
        return tuple(tally.curve() for tally in self.tallies)

    def headline(self) -> str:
        """One line."""
        detectors = len(self.curves) // len(self.sources)
        hours = sum({curve.source: float(curve.hours.sum()) for curve in self.curves}.values())
        return f"{detectors} detectors on {len(self.sources)} sources, {hours:.2f} h of lane keeping"

    def rows(self, *, every: bool = False) -> list[dict[str, Any]]:
        """A row for each source and detector at the threshold that is set, or at every threshold."""
        found = []
        for curve in self.curves:
            chosen = curve.detector.chosen
            found += _rows(curve, range(len(curve.rate)) if every else [chosen])
        return found

    def worst(self) -> list[tuple[str, str, Case]]:
        """Source, detector and case of the worst ones of all."""
        return worst_of([(one.source, one.detector.label(), case) for one in self.tallies for case in one.cases])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "sources": [{"label": one.label, "files": [path.name for path in one.files]} for one in self.sources],
            "sensor": {"noise": self.sensor.noise, "delay": self.sensor.delay, "rate": self.sensor.rate},
            "rows": [_plain(row) for row in self.rows()],
            "curves": [
                {
                    "source": curve.source,
                    "detector": curve.detector.label(),
                    "quantity": curve.detector.quantity,
                    "threshold": curve.detector.thresholds.tolist(),
                    "false_alarms_per_hour": _listed(curve.rate),
                    "seen": _listed(curve.seen),
                    "seen_before_marking": _listed(curve.in_time),
                    "median_lead_s": _listed(curve.lead(0.5)),
                }
                for curve in self.curves
            ],
            "worst": [
                {"kind": case.kind, "source": source, "detector": detector, "scene": case.scene.name,
                 "vehicle": case.view.track.name, "side": "left" if case.view.side > 0 else "right",
                 "time": round(case.time, 3)}
                for source, detector, case in self.worst()
            ],
            "provenance": self.provenance(),
        }  # fmt: skip

    def provenance(self) -> dict[str, Any]:
        """Seed and hashes of all inputs."""
        files = [path for one in self.sources for path in one.files if path.is_file()]
        return {"seed": self.seed, "inputs": parsed_hashes(files)}


def _rows(curve: Curve, numbers: Sequence[int]) -> list[dict[str, Any]]:
    detector, rates, seen = curve.detector, curve.rate_interval(), curve.seen_interval()
    in_time, medians = curve.seen_interval(in_time=True), curve.lead_interval()
    low, middle, high = (curve.lead(share) for share in (0.05, 0.5, 0.95))
    fixed: dict[str, Any] = {"source": curve.source, "detector": detector.label()}
    counts = {"vehicles": len(curve.hours), "hours": float(curve.hours.sum()), "cut_ins": len(curve.leads)}
    found = []
    for k in numbers:
        is_set = k == detector.chosen
        found.append({
            **fixed, "threshold": float(detector.thresholds[k]), "is_set": is_set, **counts,
            "false_alarms": int(curve.counts[:, k].sum()),
            "false_alarms_per_hour": float(curve.rate[k]),
            "false_alarms_low": float(rates[0, k]), "false_alarms_high": float(rates[1, k]),
            "seen": float(curve.seen[k]), "seen_low": float(seen[0, k]), "seen_high": float(seen[1, k]),
            "seen_before_marking": float(curve.in_time[k]),
            "seen_before_marking_low": float(in_time[0, k]), "seen_before_marking_high": float(in_time[1, k]),
            "lead_median": float(middle[k]), "lead_5": float(low[k]), "lead_95": float(high[k]),
            "lead_median_low": medians[0] if is_set else np.nan,
            "lead_median_high": medians[1] if is_set else np.nan,
        })  # fmt: skip
    return found


def _listed(values: Any) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), 6) for value in values]


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    """NaN as None, numbers rounded."""
    return {
        name: (None if np.isnan(value) else round(value, 6)) if isinstance(value, float) else value
        for name, value in row.items()
    }
