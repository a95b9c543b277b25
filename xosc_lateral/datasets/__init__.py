"""A driver simulator that is no relative of the package's model: a first try without measured drives, and tests.

`simulate_drive` gives a drive table with the truth behind it. Effects are planted by arguments and act through the
simulated driver: see `plants`.
"""

from xosc_lateral.datasets.driver_simulator import (
    Driver,
    SimulatedDrive,
    Truth,
    draw_driver,
    simulate_drive,
    simulate_population,
)
from xosc_lateral.datasets.plants import (
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
