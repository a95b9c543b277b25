"""A driver as a functional mock-up unit that calls this package, through pythonfmu and pythonfmu3.

The unit holds its profile and a script of a few lines; what it does is here, in the package, which whoever simulates it
has beside a Python of the same version.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.profiles import profile_hash, read_profile, write_profile
from xosc_lateral.workflows.live.c_numbers import inputs_of, usual
from xosc_lateral.workflows.live.traffic import Moment, Traffic

HOST_REQUIREMENT = (
    f"Needs a host with Python {sys.version_info.major}.{sys.version_info.minor} in its process, and xosc-lateral in "
    "that; others can't load it (undefined symbol: _Py_NoneStruct)"
)
"""Of a unit that calls Python: without one in the process, no code of it runs that could say so."""

SCRIPT = '''"""A driver of xosc-lateral."""
from {package} import {base}

try:
    from xosc_lateral.workflows.live import python_fmu
except ImportError as error:
    raise ImportError(
        "this FMU needs the package xosc-lateral {version} beside it, in the Python that loads it: "
        f"pip install 'xosc-lateral[fmu]' ({{error}})"
    ) from None


class LateralDriver({base}):
    """One driver: inputs are what he sees, outputs where he is in his lane."""

    def do_step(self, current_time, step_size):
        return self.go_on(current_time, step_size)


python_fmu.complete(LateralDriver, python_fmu.Unit{fmi}, __file__)
'''


class _OneDriver(Traffic):
    """A single vehicle, whose driver is the one that `sample` gives for the seed."""

    def seed_of(self, name: str) -> np.random.SeedSequence:
        return child(np.random.SeedSequence(self.seed), 0)


def export_python_fmu(profile: DriverProfile, path: str | Path, *, fmi: str) -> None:
    """Write a unit; raises `SimulationError` without the extra `fmu`."""
    try:
        package = "pythonfmu3" if fmi == "3.0" else "pythonfmu"
        builder = import_module(f"{package}.builder").FmuBuilder
    except ImportError as error:
        raise SimulationError("writing a --python FMU needs pythonfmu: pip install 'xosc-lateral[fmu]'") from error
    with tempfile.TemporaryDirectory() as folder:
        # units in one process share Python's modules: each has a name of its own
        script = Path(folder) / f"lateral_driver_fmi{fmi[0]}_{profile_hash(profile)[:12]}.py"
        base = f"Fmi{fmi[0]}Slave"
        script.write_text(SCRIPT.format(version=__version__, fmi=fmi[0], base=base, package=package), encoding="utf-8")
        write_profile(profile, Path(folder) / "profile.json")
        built = Path(folder) / "built"
        built.mkdir()
        before = list(sys.path)
        state = "FMUState" if fmi == "3.0" else "FMUstate"
        able = dict.fromkeys((f"canGetAndSet{state}", f"canSerialize{state}", "needsExecutionTool"), "true")
        try:
            builder.build_FMU(script, dest=built, project_files={Path(folder) / "profile.json"}, **able)
        finally:
            sys.path[:] = before
            sys.modules.pop(script.stem, None)
        write_atomically(path, next(built.glob("*.fmu")).read_bytes())


def complete(driver: type, unit: type[Unit], script: str) -> None:
    """Give the class in a unit's script its methods.

    That class has pythonfmu's as its only base: the loader of FMI 2 looks for it so, and hangs where there is another.
    """
    driver.script, driver.base = script, driver.__base__  # type: ignore[attr-defined]
    for part in (Unit, unit):
        for name, value in vars(part).items():
            if name == "__init__" or not name.startswith("__"):
                setattr(driver, name, value)


class Unit:
    """What a unit does; what the two versions of FMI differ in is in the classes below."""

    package: ClassVar[str]
    fmi: ClassVar[str]
    registers_units: ClassVar[bool]
    kinds: ClassVar[tuple[str, str, str]]
    """What the package calls real numbers, truth values and whole numbers."""

    script: ClassVar[str]
    base: ClassVar[Any]

    def __init__(self, **settings: Any) -> None:
        self.base.__init__(self, **settings)
        # the next unit's loader looks for its own files: those of this one may be gone by then
        sys.modules.pop(type(self).__module__, None)
        self._own = read_profile(Path(self.script).with_name("profile.json"))
        self._variables = variables_of(self._own)
        self._columns = inputs_of(self._own)
        self.description = f"Driver {self._own.name} of xosc-lateral {__version__}: lateral offset in the lane, "
        self.description += f"positive left. {HOST_REQUIREMENT}"
        self.author, self.profile = "xosc-lateral", ""
        self._traffic: _OneDriver | None = None
        self._has_begun = False
        for variable in self._variables:
            setattr(self, variable.name, 0.0 if variable.start is None else variable.start)
            words = {"description": variable.words}
            words |= {"unit": variable.unit} if self.registers_units and variable.unit is not None else {}
            self._add(self.kinds[variable.kind], variable.name, variable.causality, variable.variability, **words)
        which = "Path or name of another profile; empty: the one within."
        self._add("String", "profile", "parameter", "fixed", description=which)
        self._add_more()

    def _add_more(self) -> None:
        """What a version has besides."""

    def _add(self, kind: str, name: str, causality: str, variability: str, **words: Any) -> None:
        package, names = import_module(self.package), f"Fmi{self.fmi}"
        causalities = getattr(package, f"{names}Causality")
        variabilities = getattr(package, f"{names}Variability")
        made = getattr(package, kind)
        settings = {"causality": causalities[causality], "variability": variabilities[variability], **words}
        self.register_variable(made(name, **settings))  # type: ignore[attr-defined]

    def exit_initialization_mode(self) -> None:
        """The driver is drawn."""
        self._start_at(0.0)
        self._has_begun = False

    def _start_at(self, time: float) -> None:
        self._traffic = _OneDriver(self._chosen(), seed=int(getattr(self, "seed", 0)))
        self._look(time)

    def _chosen(self) -> DriverProfile:
        return read_profile(self.profile) if self.profile else self._own

    def _look(self, time: float) -> None:
        assert self._traffic is not None
        values = {name: np.array([getattr(self, name)]) for name in (*self._columns, "position", "offset")}
        for name in self._columns:
            if name.endswith("_distance") and values[name][0] >= ABSENT_DISTANCE:
                values[name] = np.array([np.inf])
        following = np.array([bool(getattr(self, "following", True))])
        truck = np.array([bool(values["is_truck"][0])]) if "is_truck" in self._columns else ~np.ones(1, dtype=np.bool_)
        moment = Moment(
            ("vehicle",), values["speed"], values["lane_width"], values["offset" if following[0] else "position"],
            following, np.ones(1, dtype=np.bool_), truck,
            context={name: values[name] for name in self._columns if name not in ("speed", "lane_width", "is_truck")},
        )  # fmt: skip
        moves = self._traffic.step(time, moment)
        self.offset, self.rate, self.heading = (float(part[0]) for part in moves[:3])

    def go_on(self, current_time: float, step_size: float) -> Any:
        """Where the driver is at the end of the step."""
        try:
            if self._traffic is None:
                raise SimulationError("a step before the end of initialization mode")
            speed = float(getattr(self, "speed", 0.0))
            if speed < 0.0:
                raise SimulationError(f"speed {speed:g} m/s: a driver who follows the road drives forwards")
            if not self._has_begun and current_time != 0.0:  # not every loader says before when it all begins
                self._start_at(current_time)
            self._has_begun = True
            self._look(current_time + step_size)
        except SimulationError as error:
            return self._answer(str(error))
        return self._answer()

    def _answer(self, fault: str | None = None) -> Any:
        """What a step gives back."""
        raise NotImplementedError

    def _get_fmu_state(self) -> dict[str, Any]:
        values = {variable.name: getattr(self, variable.name) for variable in self._variables}
        traffic = None if self._traffic is None else self._traffic.to_dict()
        return {"values": {**values, "profile": self.profile}, "traffic": traffic, "has_begun": self._has_begun}

    def _set_fmu_state(self, state: Mapping[str, Any]) -> None:
        for name, value in state["values"].items():
            setattr(self, name, value)
        self._traffic, self._has_begun = None, state["has_begun"]
        if state["traffic"] is not None:
            self._traffic = _OneDriver(self._chosen())
            self._traffic.restore(state["traffic"])


class Unit2(Unit):
    """FMI 2.0, with units and initial unknowns, which pythonfmu leaves out of the description."""

    package, fmi, registers_units = "pythonfmu", "2", False
    kinds: ClassVar[tuple[str, str, str]] = ("Real", "Boolean", "Integer")

    def to_xml(self, *words: Any, **options: Any) -> Any:
        """The model description."""
        root = self.base.to_xml(self, *words, **options)
        units = {variable.name: variable.unit for variable in self._variables if variable.unit is not None}
        definitions = add_units(root, set(units.values()))
        root.remove(definitions)
        root.insert(1, definitions)
        initial = SubElement(root.find("ModelStructure"), "InitialUnknowns")
        for index, variable in enumerate(root.iter("ScalarVariable"), start=1):
            if variable.get("name") in units:
                variable.find("Real").set("unit", units[variable.get("name")])
            if variable.get("causality") == "output":
                SubElement(initial, "Unknown", index=str(index))
        return root

    def _answer(self, fault: str | None = None) -> bool:
        if fault is not None:
            self.log(fault, import_module("pythonfmu.enums").Fmi2Status.error)  # type: ignore[attr-defined]
            # whoever switched logging off would hear of a step that failed, and not why
            print(f"xosc-lateral: {fault}", file=sys.stderr, flush=True)
        return fault is None


class Unit3(Unit):
    """FMI 3.0, whose clock is a variable."""

    package, fmi, registers_units = "pythonfmu3", "3", True
    kinds: ClassVar[tuple[str, str, str]] = ("Float64", "Boolean", "Int32")

    def _add_more(self) -> None:
        unit = import_module("pythonfmu3").Unit
        self.register_units([unit(name, **base) for name, base in BASE_UNITS.items()])  # type: ignore[attr-defined]
        self.time = 0.0
        self._add("Float64", "time", "independent", "continuous")

    def _answer(self, fault: str | None = None) -> Any:
        package = import_module("pythonfmu3")
        if fault is not None:
            self.log(fault, package.Fmi3Status.error)  # type: ignore[attr-defined]
        return package.Fmi3StepResult(status=package.Fmi3Status.ok if fault is None else package.Fmi3Status.error)


# ---- variables and units, of a unit in C and of one in Python alike --------------------------------------------------
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
