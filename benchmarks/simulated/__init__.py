"""What is planted into simulated drives to try the loop: hidden causes, changes of the spread, cameras, assists.

The simulator itself is `xosc_lateral.datasets`; its names are here, too.
"""

from benchmarks.simulated.camera_plants import CameraStep, SensorDrift, ShakyCamera
from benchmarks.simulated.hidden_plants import Companion, CyclicTarget, Distraction, DriftingTarget, Fatigue
from benchmarks.simulated.spread_plants import RestoringBy, SpreadBy
from xosc_lateral.datasets import *  # noqa: F403
from xosc_lateral.datasets import __all__ as _of_the_simulator

__all__ = [
    "CameraStep",
    "Companion",
    "CyclicTarget",
    "Distraction",
    "DriftingTarget",
    "Fatigue",
    "RestoringBy",
    "SensorDrift",
    "ShakyCamera",
    "SpreadBy",
    *_of_the_simulator,
]
