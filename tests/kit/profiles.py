"""Profiles for tests, fitted from simulated drives: never typed by hand."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from examples.driver_simulator.simulator import simulate_drive
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.effects import ColumnEffect, Effect, EffectTerms, HiddenEffect, any_effect
from xosc_lateral.drivers.model.effects.base import step_of, terms_of
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.records import read_as

REFINED = str(Path(__file__).parents[1] / "data" / "profiles" / "motorway-refined.json")
"""A profile that a closed loop made of the motorway recording: effects of columns, hidden ones, drivers that differ."""


def effect_from_dict(values: dict[str, object]) -> Effect:
    """One effect as a profile file holds it."""
    effect: Effect = read_as(any_effect((str(values.get("kind")),)), values)
    return effect


def whole_terms(
    effect: Effect, time: np.ndarray, context: dict[str, np.ndarray], rng: np.random.Generator
) -> EffectTerms:
    """What one effect does on a whole drive, on an even grid [s] with context columns."""
    if isinstance(effect, ColumnEffect):
        strength = effect.strength(step_of(time), context)
        return EffectTerms() if strength is None else terms_of(effect.acts, strength)
    assert isinstance(effect, HiddenEffect)
    return effect.advance(effect.begin(rng, step_of(time)), time, step_of(time)) if len(time) else EffectTerms()


def as_drive(table: object, name: str = "simulated") -> Drive:
    """A simulated table as a `Drive`, without going through a file."""
    columns = {str(key): np.asarray(table[key], dtype=float) for key in table}  # type: ignore[attr-defined,index]
    left, right = columns.pop("distance_left"), columns.pop("distance_right")
    context = {key: values for key, values in columns.items() if key != "time"}
    return Drive(name, columns["time"], 0.5 * (right - left), left + right, context, frozenset({"lane_index"}))


@lru_cache(maxsize=4)
def simulated_profile(model: str = "two-level", seed: int = 11) -> DriverProfile:
    """A driver without effects, from 40 min of simulated driving."""
    drive = simulate_drive(2400.0, seed)
    return fit_profile([as_drive(drive.table)], name=f"simulated-{seed}", model=model)
