"""A driver simulator that is no relative of the package's model, for tests, examples and the synthetic profile.

`simulate_drive` gives a drive table with the truth behind it. Effects are planted by arguments and act through the
simulated driver; see `plants` for what there is.
"""

from tests.simulators.driver_simulator import (
    Drive,
    Driver,
    Truth,
    draw_driver,
    simulate_drive,
    simulate_population,
)
from tests.simulators.plants import (
    CameraStep,
    Companion,
    CurveCutting,
    Distraction,
    Fatigue,
    LaneHabit,
    Plant,
    Response,
    RestoringBy,
    SensorDrift,
    ShakyCamera,
    Shape,
    ShiftBy,
    SideWind,
    SpreadBy,
    TargetWander,
    TruckAvoidance,
    Weave,
)

__all__ = [
    "CameraStep",
    "Companion",
    "CurveCutting",
    "Distraction",
    "Drive",
    "Driver",
    "Fatigue",
    "LaneHabit",
    "Plant",
    "Response",
    "RestoringBy",
    "SensorDrift",
    "ShakyCamera",
    "Shape",
    "ShiftBy",
    "SideWind",
    "SpreadBy",
    "TargetWander",
    "TruckAvoidance",
    "Truth",
    "Weave",
    "draw_driver",
    "simulate_drive",
    "simulate_population",
]
