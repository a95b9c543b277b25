"""Verdicts of the R157 models on a cut-in, over gaps and seeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laboratory.r157.braking import evaluate_braking
from laboratory.r157.competent_driver import CompetentDriver
from laboratory.r157.encounters import Ego, EncounterOutcome, Traffic
from laboratory.r157.fuzzy_safety import FuzzySafetyModel
from laboratory.r157.reaction_time import required_by_reaction_time
from laboratory.r157.study.encounters import Target

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GAPS = np.arange(0.5, 30.1, 0.5)
"""Gap between the ego's front and the rear of the other vehicle at the beginning of the lane change. [m]"""

MODELS = ("paragraph 5.2.5.2", "competent driver", "FSM")


@dataclass(frozen=True, eq=False)
class Verdicts:
    """Of one scenario.

    Parameters
    ----------
    prevented : dict of str to array of bool, shape (gaps, 1 + seeds)
        The nominal run first.
    smallest_gap : dict of str to array, likewise. [m]
    """

    prevented: dict[str, BoolArray]
    smallest_gap: dict[str, FloatArray]

    def record(self) -> dict[str, Any]:
        """Numbers by model."""
        found = {}
        for name in MODELS:
            prevented, gaps = self.prevented[name], self.smallest_gap[name]
            found_limits = limits(prevented)
            flips = prevented[:, 1:] != prevented[:, :1]
            # The nearest gap that the nominal run calls preventable: what is left there, nominal and lifelike.
            at_limit = gaps[min(int(np.searchsorted(GAPS, found_limits[0])), len(GAPS) - 1)]
            close = np.abs(GAPS - found_limits[0]) <= 5.0
            found[name] = {
                "limit_nominal": float(found_limits[0]),
                "limit_range": [float(value) for value in np.quantile(found_limits[1:], [0.05, 0.95])],
                "flips": float(flips.mean()),
                "flips_within_5_m_of_the_limit": float(flips[close].mean()),
                "to_preventable": float((flips & prevented[:, 1:]).mean()),
                "smallest_gap_at_limit_nominal": float(at_limit[0]),
                "smallest_gap_at_limit": [float(value) for value in np.nanquantile(at_limit[1:], [0.05, 0.5, 0.95])],
                "share_preventable_nominal": prevented[:, 0].astype(float).tolist(),
                "share_preventable_lifelike": prevented[:, 1:].mean(axis=1).tolist(),
            }
        return found


def limits(prevented: BoolArray) -> FloatArray:
    """Smallest gap from which on every verdict is "preventable", for each run; half a step below it. [m]"""
    lost = ~prevented
    last = np.where(lost.any(axis=0), len(GAPS) - 1 - lost[::-1].argmax(axis=0), -1)
    return np.asarray(np.append(GAPS, np.inf)[last + 1] - 0.25)


def verdicts_of(target: Target) -> Verdicts:
    """Every gap, every seed, three models: the other vehicle drives as played, the ego begins nearer or farther."""
    begin = round(target.begins / target.step)
    nominal_gap = target.position[begin] - target.ego_position[begin] - 0.5 * (target.length + target.ego_length)
    first = max(begin - round(3.0 / target.step), 0)  # 3 s before the lane change, so that an early alarm can act
    rows = slice(first, None)
    runs = len(target.towards)
    results: dict[str, list[EncounterOutcome]] = {name: [] for name in MODELS}
    for gap in GAPS:
        # The ego holds its speed until a model brakes; it is put so that the gap at `begin` is the one wanted.
        ego = Ego(
            float(target.ego_position[first] + nominal_gap - gap),
            float(target.ego_speed[first]),
            target.ego_length,
            target.ego_width,
        )
        traffic = Traffic(
            np.tile(target.position[rows], (runs, 1)),
            np.tile(target.speed[rows], (runs, 1)),
            target.towards[:, rows],
            target.distance[:, rows],
            target.lane_width,
            target.width,
            target.length,
            target.step,
        )
        results[MODELS[0]].append(required_by_reaction_time(traffic, ego))
        results[MODELS[1]].append(evaluate_braking(CompetentDriver(), traffic, ego))
        results[MODELS[2]].append(evaluate_braking(FuzzySafetyModel(), traffic, ego))
    return Verdicts(
        {name: np.array([one.prevented for one in found]) for name, found in results.items()},
        {name: np.array([one.smallest_gap for one in found]) for name, found in results.items()},
    )
