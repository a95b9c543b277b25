"""What a driver as an FMU is given and says: variables and units, of a unit in C and of one in Python alike."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.workflows.live.c_numbers import inputs_of, usual

ABSENT_DISTANCE = 1000.0
"""Distances from here on mean that nobody is there: files of FMI have no infinity that every tool reads. [m]"""

BASE_UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "m/s2": {"m": 1, "s": -2}, "1/m": {"m": -1}, "rad": {"rad": 1},
    "%": {"factor": 0.01}, "h": {"s": 1, "factor": 3600.0}, "mm/h": {"m": 1, "s": -1, "factor": 1e-3 / 3600.0},
    "deg": {"rad": 1, "factor": float(np.pi / 180.0)}, "lx": {"cd": 1, "m": -2}, "-": {},
}  # fmt: skip
"""Units of inputs and outputs in base units."""

DESCRIPTIONS_OF_VARIABLES = {
    "offset": "From the lane's centre, positive left", "rate": "Change of the offset per time",
    "heading": "Relative to the lane, positive left", "position": "Where the vehicle is while it does not follow",
    "following": "It follows the road; while not, `position` is where it is.",
    "seed": "Same seed, same driver: as of `sample`.",
    "lane_index": "0: rightmost", "curvature": "Positive: to the left",
    **{
        f"{side}_distance": f"Free space; {ABSENT_DISTANCE:g} or more: nobody"
        for side in ("lead", "left", "right", "oncoming")
    },
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable; those with a unit are real numbers."""

    name: str
    causality: str
    start: float | bool | None
    unit: str | None = None

    @property
    def kind(self) -> int:
        """0: real, 1: truth value, 2: whole number."""
        return 0 if self.unit is not None else 1 if isinstance(self.start, bool) else 2

    @property
    def variability(self) -> str:
        """In the words of FMI."""
        return ("continuous", "discrete", "fixed")[self.kind]

    @property
    def words(self) -> str:
        """For the description."""
        return DESCRIPTIONS_OF_VARIABLES.get(self.name, self.name)


def variables_of(profile: DriverProfile) -> list[Variable]:
    """In the order of the value references of a unit in C: inputs, outputs, seed."""
    inputs = [
        Variable(name, "input", min(usual(profile, name), ABSENT_DISTANCE), CONTEXT_UNITS.get(name, "-"))
        for name in inputs_of(profile)
    ]
    outputs = [
        Variable(name, "output", None, unit) for name, unit in (("offset", "m"), ("rate", "m/s"), ("heading", "rad"))
    ]
    position = Variable("position", "input", 0.0, "m")
    return [*inputs, position, Variable("following", "input", True), *outputs, Variable("seed", "parameter", 0)]


def add_units(root: Element, names: set[str]) -> Element:
    """Definitions of units as both versions of FMI have them."""
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted(names):
        unit = SubElement(definitions, "Unit", name=name)
        SubElement(unit, "BaseUnit", {key: f"{value:.16g}" for key, value in BASE_UNITS[name].items()})
    return definitions
