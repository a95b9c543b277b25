"""Which of several profiles drove a recorded vehicle: the likelihood of how it moved in its lane.

A profile has no likelihood in closed form, but its free runs say how a summary of windows scatters between drivers and
within one: a normal model of the summary's mean (synthetic likelihood [1]_, with a random effect per driver).

References
----------
.. [1] S. N. Wood, "Statistical inference for noisy nonlinear ecological dynamic systems", Nature 466, 2010.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.rows import true_slices
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.workflows.recordings.plan import Residuals, VehiclePlan

WINDOW, STEP = 10.0, 0.2
"""Of movement that is summed up, as long as the evaluation's snippets; between rows, as profiles have it. [s]"""
MINIMUM_LOG_ODDS = 2.0  # another profile than the population's has to be likelier by this: weights of 7 to 1 [nat]
FREE_RUNS = 40  # of each profile, five minutes each: 30 windows of 40 drivers
LEAST_SPREAD = 1e-4  # of a path in a window, below which its logarithm would say something about digits [m]


@dataclass(frozen=True, slots=True)
class ChosenDriver:
    """Who drives an entity in a twin."""

    profile: str  # name of the profile; empty: too little was seen, or nobody drove it: no profile of its own
    seconds: float  # of road-following that this rests on [s]
    gain: float  # log likelihood beyond the population's [nat]
    why: str


def in_lane_offsets(plan: VehiclePlan, residuals: Residuals) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Stretches of road-following of `WINDOW` and more: time [s], offset and lane width [m] every `STEP`."""
    vehicle = plan.vehicle
    rows = len(vehicle.time) - len(residuals.time)
    time, width = residuals.time, vehicle.lane_width[rows:]
    following = residuals.in_lane & (np.interp(time, plan.speed.time, plan.speed.speed) >= MINIMUM_SPEED)
    parts = []
    for part in true_slices(following):
        even = np.arange(time[part.start], time[part.stop - 1] + 1e-9, STEP)
        if len(even) * STEP > WINDOW:
            across, wide = (np.interp(even, time[part], each[part]) for each in (residuals.across, width))
            parts.append((even, across, wide))
    return parts


def choose_driver(stretches: Sequence[FloatArray], models: Mapping[str, WindowModel], population: str) -> ChosenDriver:
    """The likeliest profile of offsets in lane [m], every `STEP`."""
    seen = [_summaries(_windows(offset)) for offset in stretches]
    seconds = STEP * sum(map(len, stretches))
    if not seen:
        return ChosenDriver("", seconds, 0.0, f"no {WINDOW:g} s of road-following in one piece")
    windows = np.concatenate(seen)
    gains = {
        name: model.log_likelihood(windows) - models[population].log_likelihood(windows)
        for name, model in models.items()
    }
    best = max(gains, key=lambda name: gains[name])
    if best != population and gains[best] > MINIMUM_LOG_ODDS:
        return ChosenDriver(best, seconds, gains[best], "likeliest of the library")
    return ChosenDriver(population, seconds, 0.0, "the population's: no other is clearly likelier")


@dataclass(frozen=True, eq=False, slots=True)
class WindowModel:
    """How window summaries of a profile scatter."""

    mean: FloatArray  # mean offset [m], log spread [log m], log lateral speed [log m/s], shape (3,)
    # between, within: covariance of drivers' means, and of windows about their driver's mean, shape (3, 3)
    between: FloatArray
    within: FloatArray

    @classmethod
    def of(cls, profile: DriverProfile, seed: int = 0) -> WindowModel:
        """From free runs."""
        every = max(1, round(STEP / profile.model.step))
        runs = free_runs(profile, seed, drivers=FREE_RUNS)[:, ::every]
        each = [_summaries(_windows(run)) for run in runs]
        means = np.array([one.mean(axis=0) for one in each])
        within = np.mean([np.cov(one.T) for one in each], axis=0)
        between = np.cov(means.T) - within / len(each[0])
        values, vectors = np.linalg.eigh(between)
        between = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return cls(means.mean(axis=0), between, within)

    def log_likelihood(self, windows: FloatArray) -> float:
        """Of the mean of one driver's windows, shape (k, 3). [nat]"""
        covariance = self.between + self.within / len(windows)
        away = windows.mean(axis=0) - self.mean
        return float(-0.5 * (away @ np.linalg.solve(covariance, away) + np.linalg.slogdet(covariance)[1]))


def _windows(offset: FloatArray) -> FloatArray:
    """Whole windows, shape (k, m). [m]"""
    length = round(WINDOW / STEP)
    return offset[: len(offset) // length * length].reshape(-1, length)


def _summaries(windows: FloatArray) -> FloatArray:
    """Mean, log spread, log lateral speed of each window, shape (k, 3)."""
    spread = np.maximum(windows.std(axis=1), LEAST_SPREAD)
    speed = np.sqrt((np.diff(windows, axis=1) ** 2).mean(axis=1)) / STEP
    return np.column_stack([windows.mean(axis=1), np.log(spread), np.log(np.maximum(speed, LEAST_SPREAD))])


def drive_of(plan: VehiclePlan, residuals: Residuals) -> Drive | None:
    """A vehicle's road-following as a drive that a profile can be fitted to; None: there is none."""
    parts = in_lane_offsets(plan, residuals)
    if not parts:
        return None
    time, offset, width = (np.concatenate([part[k] for part in parts]) for k in range(3))
    run = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    speed = np.interp(time, plan.speed.time, plan.speed.speed)
    return Drive(plan.name, time, offset, width, {"speed": speed, "lane_width": width}, run=run)
