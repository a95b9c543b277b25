"""Component of a vector along an axis of an entity."""

from __future__ import annotations

from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.enums import DirectionalDimension

_AXES = (DirectionalDimension.LONGITUDINAL, DirectionalDimension.LATERAL, DirectionalDimension.VERTICAL)


def component(vector: tuple[float, float, float], direction: DirectionalDimension) -> float:
    """Of a vector in the entity's frame (ahead, left, up)."""
    return vector[_AXES.index(direction)]


def watch_motion(simulation: Simulation, direction: DirectionalDimension | None = None) -> None:
    """Have velocities and accelerations worked out in every frame."""
    simulation.derives_motion = True
    if direction is DirectionalDimension.VERTICAL:
        simulation.derives_height = True
