"""What can be asked of a driver in figures, and states of drivers that a source gives figures of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import MINIMUM_SPEED


@dataclass(frozen=True, slots=True)
class Asked:
    """Figures that a driver is to have; None: the base's.

    - `sdlp`: standard deviation of lateral position, as the highway driving test has it. [m]
    - `sdlp_change`: the same, as a difference from the base's. [m]
    - `mean`: mean offset, positive left. [m]
    - `restlessness`: standard deviation of lateral speed. [m/s]
    - `memory`: after which a deviation is correlated with itself by 1/e. [s]
    - `near_line`: share of time with a side of the vehicle within 0.2 m of a marking, or beyond it. [-]
    - `speed`: at which the figures hold. [m/s]
    - `vehicle`: "truck": what the base knows of trucks
    """

    sdlp: float | None = None
    sdlp_change: float | None = None
    mean: float | None = None
    restlessness: float | None = None
    memory: float | None = None
    near_line: float | None = None
    speed: float | None = None
    vehicle: str | None = None

    def check(self) -> None:
        """Refuse what no driver has."""
        for name, unit in (("sdlp", " m"), ("restlessness", " m/s"), ("memory", " s"), ("near_line", "")):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise DriverProfileError(f"{name.replace('_', ' ')} of {value:g}{unit}: it is above 0")
        if self.near_line is not None and self.near_line >= 1.0:
            raise DriverProfileError(f"near line {self.near_line:g}: a share of the time is below 1")
        if self.sdlp is not None and self.sdlp_change is not None:
            raise DriverProfileError("an SDLP and a change of it: one of both")
        if self.speed is not None and not MINIMUM_SPEED <= self.speed < 100.0:
            raise DriverProfileError(
                f"speed of {self.speed:g} m/s: profiles say nothing below {MINIMUM_SPEED:.1f} m/s, or from 100 m/s on"
            )
        if self.vehicle not in (None, "truck"):
            raise DriverProfileError(f"class {self.vehicle!r}: expected truck")
        if self.mean is not None and not np.isfinite(self.mean):
            raise DriverProfileError(f"mean of {self.mean:g} m")

    @property
    def figures(self) -> dict[str, float]:
        """Those that are stated, by name."""
        values = {name: getattr(self, name) for name in ("sdlp", "mean", "restlessness", "memory", "near_line")}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def size_is_given(self) -> bool:
        """Whether the size of the movement follows from other figures than the time near a marking."""
        return self.sdlp is not None or (self.restlessness is not None and self.memory is not None)


@dataclass(frozen=True, slots=True)
class Preset:
    """A state of a driver that a source gives figures of."""

    name: str
    what: str
    asked: Asked
    source: str
    doi: str


PRESETS = (
    Preset(
        "alcohol-0.5",
        "0.5 g/l of alcohol in the blood: SDLP 2.5 cm larger (95 % interval 2.0 to 2.9), 182 drivers, on the road",
        Asked(sdlp_change=0.025),
        "S. Jongen et al., A pooled analysis of on-the-road highway driving studies in actual traffic measuring "
        "standard deviation of lateral position while driving at a blood alcohol concentration of 0.5 g/L, "
        "Psychopharmacology 234, 2017, pp. 837-844",
        "10.1007/s00213-016-4519-z",
    ),
    Preset(
        "drowsy",
        "after a night without sleep: SDLP 3.1 cm larger, 24 drivers, on the road",
        Asked(sdlp_change=0.031),
        "S. Jongen et al., Sensitivity and validity of psychometric tests for assessing driving impairment: effects of "
        "sleep deprivation, PLoS ONE 10(2), 2015, e0117045",
        "10.1371/journal.pone.0117045",
    ),
    Preset(
        "truck",
        "what the base's own recording says of trucks",
        Asked(vehicle="truck"),
        "DLR Highway Traffic v1.1.0, where the base is a shipped population",
        "10.5281/zenodo.14012005",
    ),
)
"""Only what a source states; each is a difference from the base, whose figures are those of the sober and rested."""


def preset_called(name: str) -> Preset:
    """A preset by name."""
    for preset in PRESETS:
        if preset.name == name:
            return preset
    raise DriverProfileError(f"no preset {name!r}; there are {', '.join(preset.name for preset in PRESETS)}")
