"""A driver simulator that shares nothing with the package's models: for a first try without measured drives, and tests.

`simulate_drive` gives a drive table with the truth behind it. Effects are planted by arguments and act through the
simulated driver: see `plants`.
"""

from .plants import (
    LanePreference,
    Plant,
    Shape,
    ShiftBy,
    SideWind,
    SimulatedResponse,
    curve_cutting,
    linear,
    saturating,
    threshold,
    truck_avoidance,
)
from .simulator import (
    Driver,
    SimulatedDrive,
    Truth,
    draw_driver,
    simulate_drive,
    simulate_population,
)

__all__ = [
    "Driver",
    "LanePreference",
    "Plant",
    "Shape",
    "ShiftBy",
    "SideWind",
    "SimulatedDrive",
    "SimulatedResponse",
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
