"""What is planted into simulated drives to try the loop: hidden causes, changes of the spread, cameras, assists.

The simulator itself is `examples.driver_simulator`; its names are here, too.
"""

from examples.driver_simulator import *  # noqa: F403
from examples.driver_simulator import __all__ as _of_the_simulator
from tests.kit.simulated.camera_plants import CameraStep, SensorDrift, ShakyCamera
from tests.kit.simulated.hidden_plants import Companion, CyclicTarget, Distraction, DriftingTarget, Fatigue
from tests.kit.simulated.spread_plants import RestoringBy, SpreadBy

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
