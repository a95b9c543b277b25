"""A driver simulator that is no relative of the package's model, for docs, examples, tests and benchmarks.

`simulate_drive` gives a drive table with the truth behind it. Effects are planted by arguments and act through the
simulated driver; see `plants`, `spread_plants`, `hidden_plants` and `camera_plants` for what there is.
"""

from xosc_lateral.datasets.camera_plants import CameraStep, SensorDrift, ShakyCamera
from xosc_lateral.datasets.driver_simulator import (
    Driver,
    SimulatedDrive,
    Truth,
    draw_driver,
    simulate_drive,
    simulate_population,
)
from xosc_lateral.datasets.hidden_plants import Companion, CyclicTarget, Distraction, DriftingTarget, Fatigue
from xosc_lateral.datasets.intent import Plant
from xosc_lateral.datasets.plants import LanePreference, ShiftBy, SideWind, curve_cutting, truck_avoidance
from xosc_lateral.datasets.response import Shape, SimulatedResponse, linear, saturating, threshold
from xosc_lateral.datasets.spread_plants import RestoringBy, SpreadBy

__all__ = [
    "CameraStep",
    "Companion",
    "CyclicTarget",
    "Distraction",
    "DriftingTarget",
    "Driver",
    "Fatigue",
    "LanePreference",
    "Plant",
    "RestoringBy",
    "SensorDrift",
    "ShakyCamera",
    "Shape",
    "ShiftBy",
    "SideWind",
    "SimulatedDrive",
    "SimulatedResponse",
    "SpreadBy",
    "Truth",
    "curve_cutting",
    "draw_driver",
    "linear",
    "saturating",
    "simulate_drive",
    "simulate_population",
    "threshold",
    "truck_avoidance",
]
