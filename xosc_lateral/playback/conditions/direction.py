"""Component of a vector along an axis of an entity."""

from __future__ import annotations

from xosc_lateral.playback.run import Run
from xosc_lateral.scenario.enums import DirectionalDimension

_AXES = (DirectionalDimension.LONGITUDINAL, DirectionalDimension.LATERAL, DirectionalDimension.VERTICAL)


def component(vector: tuple[float, float, float], direction: DirectionalDimension) -> float:
    """Of a vector in the entity's frame (ahead, left, up)."""
    return vector[_AXES.index(direction)]


def watch_motion(run: Run, direction: DirectionalDimension | None = None) -> None:
    """Have velocities and accelerations worked out in every frame."""
    run.derives_motion = True
    if direction is DirectionalDimension.VERTICAL:
        run.derives_height = True
