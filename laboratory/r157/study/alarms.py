"""False cut-in alarms and detection times, criterion by criterion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import xosc_lateral as xl
from laboratory.r157.cut_in import CRITERIA, Encounter, alarms, first_alarm
from laboratory.r157.study.encounters import Target
from xosc_lateral.drivers.drives.cuts import all_runs
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.evaluation.snippets import sample_runs
from xosc_lateral.drivers.model.profile import DriverProfile

FloatArray = NDArray[np.float64]

RESAMPLES = 1000


def false_alarms(targets: Sequence[Target]) -> dict[str, Any]:
    """Alarms per hour while a vehicle beside the ego lane keeps its lane, by scenario; intervals over seeds."""
    rng = np.random.default_rng(157)
    found: dict[str, Any] = {}
    for target in targets:
        seconds = float(target.keeps_lane.sum()) * target.step
        if seconds < 2.0:
            continue
        seen, seeds = target.seen(), target.towards.shape[0] - 1
        for name, criterion in CRITERIA.items():
            counts = alarms(criterion(seen) & target.keeps_lane)
            per_seed = counts[1:] / (seconds / 3600.0)
            drawn = per_seed[rng.integers(0, seeds, (RESAMPLES, seeds))].mean(axis=1)
            found.setdefault(f"{target.scenario}, {target.name}", {})[name] = {
                "hours": seconds * seeds / 3600.0,
                "nominal": float(counts[0] / (seconds / 3600.0)),
                "lifelike": float(per_seed.mean()),
                "interval": [float(value) for value in np.quantile(drawn, [0.025, 0.975])],
                "runs_with_alarm": float((counts[1:] > 0).mean()),
            }
    return found


def detection_times(target: Target) -> dict[str, Any]:
    """Time from the beginning of the lane change to the first alarm that lasts into it; negative: before it."""
    found = {}
    seen = target.seen()
    begin = round(target.begins / target.step)
    for name, criterion in CRITERIA.items():
        flags = criterion(seen)
        # An alarm that began before the lane change and still stands counts as early; one that had gone does not.
        standing = flags[:, begin]
        last_quiet = begin - np.argmax(~flags[:, begin::-1], axis=1)
        after = first_alarm(flags[:, begin:], target.step)
        times = np.where(standing, (last_quiet + 1 - begin) * target.step, after)
        known = times[1:][np.isfinite(times[1:])]
        found[name] = {
            "nominal": float(times[0]),
            "quantiles": [float(v) + 0.0 for v in np.quantile(known, [0.05, 0.5, 0.95]).round(3)]
            if known.size
            else [np.nan] * 3,
            "early": float((known < 0.0).mean()) if known.size else 0.0,
            "never": float(1.0 - known.size / (len(times) - 1)),
        }
    return found


def measured_alarms(table: Path, profile: DriverProfile) -> dict[str, Any]:
    """The same on measured vehicles that keep their lane, and on free runs sampled under their context.

    Only criteria that need no other vehicle; either side counts, as a neighbour could be on either.
    """
    runs = all_runs(xl.read_drives(table))
    sampled = sample_runs(profile, runs, seed=157)
    hours = sum(map(len, runs)) * STEP / 3600.0
    found: dict[str, Any] = {"hours": hours}
    for name in ("wandering zone (0.375 m)", "perceived (1.095 m)", "lane intrusion (0.3 m)"):
        counts = {"measured": 0.0, "sampled": 0.0}
        for run, path in zip(runs, sampled, strict=True):
            for kind, offset in (("measured", run.offset), ("sampled", path)):
                for side in (-1.0, 1.0):
                    counts[kind] += float(alarms(CRITERIA[name](_alone(side * offset, run.lane_width))))
        found[name] = {kind: count / (2.0 * hours) for kind, count in counts.items()}
    return found


def _alone(towards: FloatArray, lane_width: FloatArray) -> Encounter:
    nothing = np.full_like(towards, np.inf)
    return Encounter(towards, np.gradient(towards, STEP), nothing, nothing, nothing, lane_width, 1.8, 4.5, 4.5)
