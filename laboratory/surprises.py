"""What a driver does where context changes suddenly: each column of each shipped profile stepped, in Python, C and FMU.

    python -m laboratory.surprises [--seeds 100] [--speed 33] [--no-c] [--fmu]

For 30 s the context stays, at 15 s one column steps. Per column, over all profiles, steps and seeds: the largest
lateral speed and, at 20 Hz, acceleration from then on; in the first line nothing steps. The same drivers in Python
(`Traffic`), in C (`export c`) and, with `--fmu`, in a unit of FMI 3.0 (`export fmu`), and how far they are apart.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

import xosc_lateral as xl
from tests.kit.compiled import CompiledDriver
from tests.kit.stepped import stepped_offsets
from xosc_lateral.extras.live.c_numbers import inputs_of

STEP, SECONDS, AT = 0.05, 30.0, 15.0
USUAL = {"lane_width": 3.5, "lane_index": 1.0, "is_truck": 0.0}
STEPS: dict[str, tuple[float, ...]] = {
    "lane_index": (0.0, 2.0), "lane_width": (2.75, 4.25), "is_truck": (1.0,), "speed": (16.5, 45.0),
    "left_distance": (3.0, np.nan), "right_distance": (3.0, np.nan),
}  # fmt: skip
"""What a column steps to."""


def usual(column: str, speed: float) -> float:
    """Value of a column before it steps."""
    return speed if column == "speed" else USUAL.get(column, np.inf if column.endswith("_distance") else 0.0)


def offsets(profile: xl.DriverProfile, seeds: int, column: str, to: float, speed: float) -> np.ndarray:
    """Of all drivers in Python at every step, shape (n, seeds). [m]"""
    columns = inputs_of(profile)

    def context_at(time: float) -> dict[str, float]:
        return {name: to if name == column and time >= AT else usual(name, speed) for name in columns}

    return stepped_offsets(profile, seeds, round(SECONDS / STEP), STEP, context_at)[0]


class UnitDriver:
    """One driver in an FMU, called as `CompiledDriver` is."""

    def __init__(self, profile: xl.DriverProfile, folder: Path) -> None:
        import fmpy

        unit = folder / "driver.fmu"
        xl.export_fmu(profile, unit, fmi="3.0")
        described = fmpy.read_model_description(str(unit))
        self._one = fmpy.instantiate_fmu(fmpy.extract(str(unit), str(folder / "unit")), described, "CoSimulation")
        self._number = {variable.name: variable.valueReference for variable in described.modelVariables}
        self.columns = inputs_of(profile)

    def start(self, seed: int) -> None:
        """Begin anew."""
        self._one.reset()
        self._seed, self._last = seed, 0.0

    def step(self, time: float, values: dict[str, float]) -> list[float]:
        """The offset; inputs are there at the step's end."""
        one = self._one
        if time <= 0.0:
            one.enterInitializationMode(startTime=0.0)
            one.setInt32([self._number["seed"]], [self._seed])
        one.setFloat64([self._number[name] for name in self.columns], [float(values[name]) for name in self.columns])
        if time <= 0.0:
            one.exitInitializationMode()
        else:
            one.doStep(currentCommunicationPoint=self._last, communicationStepSize=time - self._last)
        self._last = time
        return list(one.getFloat64([self._number["offset"]]))


def compiled(driver: CompiledDriver | UnitDriver, seeds: int, column: str, to: float, speed: float) -> np.ndarray:
    """The same in C, or in an FMU."""
    rows = []
    for seed in range(1, seeds + 1):
        driver.start(seed)
        values = {name: usual(name, speed) for name in driver.columns}
        stepped = values | ({column: to} if column else {})
        steps = range(round(SECONDS / STEP) + 1)
        rows.append([driver.step(k * STEP, stepped if k * STEP >= AT else values)[0] for k in steps])
    return np.array(rows).T


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--speed", type=float, default=33.0)
    parser.add_argument("--profiles", nargs="*", default=["motorway", "motorway-vehicle-1", "rural"])
    parser.add_argument("--no-c", action="store_true")
    parser.add_argument("--fmu", action="store_true")
    given = parser.parse_args()
    worst: dict[str, list[float]] = {}
    for name in given.profiles:
        profile = xl.read_profile(name)
        with tempfile.TemporaryDirectory() as folder:
            drivers = [*([] if given.no_c else [CompiledDriver(profile, Path(folder))]),
                       *([UnitDriver(profile, Path(folder))] if given.fmu else [])]  # fmt: skip
            known = inputs_of(profile)
            cases = [("", 0.0), *((column, to) for column, values in STEPS.items() if column in known for to in values)]
            for column, to in cases:
                moved = offsets(profile, given.seeds, column, to, given.speed)
                others = (compiled(driver, given.seeds, column, to, given.speed) for driver in drivers)
                apart = max((float(np.abs(own - moved).max()) for own in others), default=0.0)
                later = moved[round(AT / STEP) :]
                found = [np.abs(np.diff(later, axis=0)).max() / STEP, np.abs(np.diff(later, 2, axis=0)).max() / STEP**2]
                row = worst.setdefault(column or "nothing", [0.0, 0.0, 0.0])
                worst[column or "nothing"] = [max(pair) for pair in zip(row, [*map(float, found), apart], strict=True)]
    print(
        f"| stepped, at {given.speed:g} m/s | speed aside [m/s] | acceleration [m/s2] | Python and compiled apart [m] |"
    )
    print("|---|---|---|---|")
    for column, (speed, acceleration, apart) in worst.items():
        print(f"| {column} | {speed:.2f} | {acceleration:.2f} | {'' if not drivers else f'{apart:.0e}'} |")


if __name__ == "__main__":
    main()
