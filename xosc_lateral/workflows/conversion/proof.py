"""What an effect does in a scenario: one stretch converted with it and without it, and the shift measured there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.workflows.conversion.driver_context import SAMPLE_STEP
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.surroundings.context import Surroundings

Converted = Callable[[str, int], FloatArray]
"""Template, number of the vehicle -> deviations."""

SCENARIOS = ("overtake-truck", "cut-in", "curves")
"""Shipped templates, of which the one in which an effect moves somebody most is taken."""

SEEDS = range(4)

STEP = 0.1
"""Of playback: stretches are stated to a second and shifts to a centimetre. [s]"""

MINIMUM_SHIFT = 0.02
"""A stretch on which an effect moves its driver by less is none. [m]"""


@dataclass(frozen=True, slots=True)
class Proof:
    """A shift by one effect, measured between two conversions of a scenario with the same seeds."""

    columns: tuple[str, ...]  # what the effect goes by
    scenario: str  # the template
    vehicle: str  # who shows it most
    # start, end: of the stretch, from its first to its last moment with half of the largest shift or more [s]
    start: float
    end: float
    shift: float  # mean over the stretch and over seeds, positive left [m]

    def __str__(self) -> str:
        """In words."""
        side = "left" if self.shift > 0 else "right"
        return (
            f"In the template `{self.scenario}` '{self.vehicle}' drives {abs(self.shift):.2f} m "
            f"further {side} with the effect of `{'` and `'.join(self.columns)}` than without it, from "
            f"{self.start:.0f} to {self.end:.0f} s"
        )


def proofs_of(profile: DriverProfile, effects: Iterable[Effect] | None = None) -> list[Proof]:
    """Of those effects of a profile (all by default) that move the mean and act in one of the `SCENARIOS`."""
    chosen = profile.effects if effects is None else tuple(effects)
    moving = [one for one in chosen if isinstance(one, ColumnEffect) and one.acts is Acts.LOCATION]
    converted: Converted = cache(partial(_deviations, profile))  # the same for every effect
    return [proof for effect in moving if (proof := _proof(profile, effect, converted)) is not None]


def _proof(profile: DriverProfile, effect: ColumnEffect, converted: Converted) -> Proof | None:
    stretches = [(name, *stretch) for name in SCENARIOS for stretch in _stretches(name, effect)]
    if not stretches:
        return None
    name, vehicle, rows, _ = max(stretches, key=lambda stretch: stretch[-1])
    without = replace(profile, effects=tuple(stretch for stretch in profile.effects if stretch != effect))
    shifts = (converted(name, vehicle) - _deviations(without, name, vehicle))[:, rows].mean(axis=1)
    driven = _played(name).motion.entities[vehicle]
    begin, end = driven.time[rows[[0, -1]]].tolist()
    return Proof(effect.columns, name, driven.name, begin, end, float(shifts.mean()))


@cache
def _played(name: str) -> Played:
    """A template with its own settings, played."""
    return play_scenario(shipped_folder("templates") / f"{name}.xosc", step=STEP)


@cache
def _contexts(name: str) -> tuple[tuple[IntArray, Mapping[str, FloatArray]], ...]:
    """Of each of its vehicles: rows `SAMPLE_STEP` apart, and what the driver knows there."""
    played = _played(name)
    every = round(SAMPLE_STEP / played.motion.step)
    grids = [np.arange(0, len(entity.time), every) for entity in played.motion.entities]
    surroundings = Surroundings(played.motion, played.network)
    return tuple((grid, surroundings.context(k, grid)) for k, grid in enumerate(grids))


def _stretches(name: str, effect: ColumnEffect) -> Iterator[tuple[int, IntArray, float]]:
    """Vehicles that an effect moves: number, rows on which it does by half of its most or more, and how far. [m]"""
    for number, (grid, context) in enumerate(_contexts(name)):
        strength = effect.strength(SAMPLE_STEP, context)
        if strength is None or not np.isfinite(strength).any():
            continue
        most = float(np.nanmax(np.abs(strength)))
        if most >= MINIMUM_SHIFT:
            yield number, grid[np.abs(strength) >= 0.5 * most], most


def _deviations(profile: DriverProfile, name: str, vehicle: int) -> FloatArray:
    """How far from the nominal path one vehicle drives in conversions, shape (seeds, rows). [m]"""
    played = _played(name)
    drivers = {played.motion.entities[vehicle].name: profile}
    run = SegmentedRun(played.motion, played.network, neighbours=Neighbours.PROFILE)
    conversions = [enrich(run, drivers, seed=k) for k in SEEDS]
    return np.array([one.entities[vehicle].deviation for one in conversions])
