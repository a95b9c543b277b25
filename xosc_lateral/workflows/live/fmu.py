"""A driver as a functional mock-up unit, FMI 2.0 or 3.0 for co-simulation, through pythonfmu and pythonfmu3.

The unit holds its profile and a script of a few lines; what it does is here, in the package, which whoever simulates it
has beside a Python of the same version.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.profiles import profile_hash, read_profile, write_profile
from xosc_lateral.workflows.live.traffic import Moment, Traffic

ABSENT_DISTANCE = 1000.0
"""Distances from here on mean that nobody is there: files of FMI have no infinity that every tool reads. [m]"""

UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "m/s2": {"m": 1, "s": -2}, "1/m": {"m": -1}, "rad": {"rad": 1},
    "%": {"factor": 0.01}, "h": {"s": 1, "factor": 3600.0}, "mm/h": {"m": 1, "s": -1, "factor": 1e-3 / 3600.0},
    "deg": {"rad": 1, "factor": float(np.pi / 180.0)}, "lx": {"cd": 1, "m": -2}, "-": {},
}  # fmt: skip
"""Units of inputs and outputs in base units."""

OUTPUTS = {"offset": "m", "rate": "m/s", "heading": "rad"}
"""What the driver says; positive to the LEFT of travel."""

NEEDS = (
    f"Needs a host with Python {sys.version_info.major}.{sys.version_info.minor} in its process, and xosc-lateral in "
    "that; others can't load it (undefined symbol: _Py_NoneStruct)"
)
"""Of a unit that calls Python: without one in the process, no code of it runs that could say so."""

SCRIPT = '''"""A driver of xosc-lateral."""
from {package} import {base}

try:
    from xosc_lateral.workflows.live.fmu import unit_methods
except ImportError as error:
    raise ImportError(
        "this FMU needs the package xosc-lateral {version} beside it, in the Python that loads it: "
        f"pip install 'xosc-lateral[fmu]' ({{error}})"
    ) from None


class LateralDriver({base}):
    """One driver: inputs are what he sees, outputs where he is in his lane."""

    def do_step(self, current_time, step_size):
        return self.go_on(current_time, step_size)


for name, method in unit_methods("{fmi}", __file__).items():
    setattr(LateralDriver, name, method)
'''


class _OneDriver(Traffic):
    """A single vehicle, whose driver is the one that `sample` gives for the seed."""

    def seed_of(self, name: str) -> np.random.SeedSequence:
        return child(np.random.SeedSequence(self.seed), 0)


def export_fmu(profile: DriverProfile, path: str | Path, *, fmi: str = "2.0") -> None:
    """Write a unit.

    `path`: ``.fmu``, which is replaced. `fmi`: ``2.0`` or ``3.0``. Raises `SimulationError`: without the extra `fmu`.
    """
    try:
        package = "pythonfmu3" if fmi == "3.0" else "pythonfmu"
        builder = import_module(f"{package}.builder").FmuBuilder
    except ImportError as error:
        raise SimulationError("writing an FMU needs pythonfmu: pip install 'xosc-lateral[fmu]'") from error
    with tempfile.TemporaryDirectory() as folder:
        # units in one process share Python's modules: each has a name of its own
        script = Path(folder) / f"lateral_driver_fmi{fmi[0]}_{profile_hash(profile)[:12]}.py"
        filled = SCRIPT.format(version=__version__, fmi=fmi, base=f"Fmi{fmi[0]}Slave", package=package)
        script.write_text(filled, encoding="utf-8")
        write_profile(profile, Path(folder) / "profile.json")
        built = Path(folder) / "built"
        built.mkdir()
        before = list(sys.path)
        try:
            state = "canGetAndSetFMUState" if fmi == "3.0" else "canGetAndSetFMUstate"
            serial = "canSerializeFMUState" if fmi == "3.0" else "canSerializeFMUstate"
            builder.build_FMU(
                script, dest=built, project_files={Path(folder) / "profile.json"},
                **{state: "true", serial: "true", "needsExecutionTool": "true"},
            )  # fmt: skip
        finally:
            sys.path[:] = before
            sys.modules.pop(script.stem, None)
        write_atomically(path, next(built.glob("*.fmu")).read_bytes())


def unit_methods(fmi: str, script: str) -> dict[str, Any]:
    """What the class in a unit's script does, by name, for that version of FMI.

    The class itself has to be in the script, made from the base class that is imported there: the loaders of pythonfmu
    look for it so.
    """
    package = import_module("pythonfmu3" if fmi == "3.0" else "pythonfmu")
    base, causality, variability = (
        getattr(package, f"Fmi{fmi[0]}{word}") for word in ("Slave", "Causality", "Variability")
    )
    Boolean, String, Unit = package.Boolean, package.String, getattr(package, "Unit", None) if fmi == "3.0" else None
    if fmi == "3.0":
        real, integer, status = package.Float64, package.Int32, package.Fmi3Status
    else:
        real, integer, status = package.Real, package.Integer, import_module("pythonfmu.enums").Fmi2Status
    own = read_profile(Path(script).with_name("profile.json"))
    columns = ("speed", "lane_width", *sorted(set(own.columns) - {"speed", "lane_width"}))

    description = f"Driver {own.name} of xosc-lateral {__version__}: lateral offset in the lane, positive left. {NEEDS}"

    def begin(self: Any, **settings: Any) -> None:
        base.__init__(self, **settings)
        # the next unit's loader looks for its own files: those of this one may be gone by then
        sys.modules.pop(type(self).__module__, None)
        self.description, self.author = description, "xosc-lateral"
        self.profile, self.seed = "", 0
        self.following, self.position = True, 0.0
        self.offset = self.rate = self.heading = 0.0
        self._traffic, self._has_begun = None, False
        for name in columns:
            setattr(self, name, _start(name, own))
        fixed = {"causality": causality.parameter, "variability": variability.fixed}
        self.register_variable(integer("seed", **fixed, description="Same seed, same driver: as of `sample`."))
        self.register_variable(
            String("profile", **fixed, description="Path or name of another profile; empty: the one within.")
        )
        given = {"causality": causality.input, "variability": variability.continuous}
        if Unit is not None:
            self.register_units([Unit(name, **base_units) for name, base_units in UNITS.items()])
            self.time = 0.0
            clock = {"causality": causality.independent, "variability": variability.continuous}
            self.register_variable(real("time", **clock))
        self._units = {name: CONTEXT_UNITS.get(name, "-") for name in columns} | {"position": "m"} | OUTPUTS
        for name in (*columns, "position"):
            self.register_variable(number(name, self, **given, description=_WORDS.get(name, name)))
        self.register_variable(
            Boolean("following", causality=causality.input, variability=variability.discrete,
                    description="It follows the road; while not, `position` is where it is.")
        )  # fmt: skip
        for name in OUTPUTS:
            shown = {"causality": causality.output, "variability": variability.continuous}
            self.register_variable(number(name, self, **shown, description=_WORDS[name]))

    def number(name: str, self: Any, **how: Any) -> Any:
        return real(name, unit=self._units[name], **how) if Unit is not None else real(name, **how)

    def to_xml(self: Any, *words: Any, **options: Any) -> Any:
        """The model description; FMI 2's with units and initial unknowns, which pythonfmu leaves out."""
        root = base.to_xml(self, *words, **options)
        if Unit is None:
            _complete(root, self._units)
        return root

    def exit_initialization_mode(self: Any) -> None:
        self.start_at(0.0)
        self._has_begun = False

    def start_at(self: Any, time: float) -> None:
        chosen = read_profile(self.profile) if self.profile else own
        self._traffic = _OneDriver(chosen, seed=int(self.seed))
        self.look(time)

    def look(self: Any, time: float) -> None:
        assert self._traffic is not None
        context = {
            name: np.array([_seen(name, getattr(self, name))]) for name in columns if name not in _APART
        }  # fmt: skip
        where = self.position if not self.following else self.offset
        truck = np.array([bool(getattr(self, "is_truck", 0.0))])
        moment = Moment(
            ("vehicle",), np.array([self.speed]), np.array([self.lane_width]), np.array([where]),
            np.array([bool(self.following)]), np.ones(1, dtype=np.bool_), truck, context=context,
        )  # fmt: skip
        moves = self._traffic.step(time, moment)
        self.offset, self.rate, self.heading = (float(values[0]) for values in moves[:3])

    def go_on(self: Any, current_time: float, step_size: float) -> Any:
        """Where the driver is at the end of the step."""
        done = True
        try:
            if self._traffic is None:
                raise SimulationError("a step before the end of initialization mode")
            if self.speed < 0.0:
                raise SimulationError(f"speed {self.speed:g} m/s: a driver who follows the road drives forwards")
            if not self._has_begun and current_time != 0.0:  # not every loader says before when it all begins
                self.start_at(current_time)
            self._has_begun = True
            self.look(current_time + step_size)
        except SimulationError as error:
            self.log(str(error), status.error)
            if Unit is None:  # whoever switched logging off would hear of a step that failed, and not why
                print(f"xosc-lateral: {error}", file=sys.stderr, flush=True)
            done = False
        return package.Fmi3StepResult(status=status.ok if done else status.error) if Unit is not None else done

    def _get_fmu_state(self: Any) -> dict[str, Any]:
        names = (*columns, "position", "following", *OUTPUTS, "seed", "profile")
        traffic = None if self._traffic is None else self._traffic.to_dict()
        values = {name: getattr(self, name) for name in names}
        return {"values": values, "traffic": traffic, "has_begun": self._has_begun}

    def _set_fmu_state(self: Any, state: Mapping[str, Any]) -> None:
        for name, value in state["values"].items():
            setattr(self, name, value)
        self._traffic, self._has_begun = None, state["has_begun"]
        if state["traffic"] is not None:
            self._traffic = _OneDriver(read_profile(self.profile) if self.profile else own)
            self._traffic.restore(state["traffic"])

    return {
        "__init__": begin, "to_xml": to_xml, "go_on": go_on,
        "exit_initialization_mode": exit_initialization_mode,
        "start_at": start_at, "look": look, "_get_fmu_state": _get_fmu_state, "_set_fmu_state": _set_fmu_state,
    }  # fmt: skip


_APART = ("speed", "lane_width", "is_truck")

_WORDS = {
    "offset": "From the lane's centre, positive left", "rate": "Change of the offset per time",
    "heading": "Relative to the lane, positive left", "position": "Where the vehicle is while it does not follow",
    "lane_index": "0: rightmost", "curvature": "Positive: to the left",
    **{
        f"{side}_distance": f"Free space; {ABSENT_DISTANCE:g} or more: nobody"
        for side in ("lead", "left", "right", "oncoming")
    },
}  # fmt: skip


def _start(name: str, profile: DriverProfile) -> float:
    if name.endswith("_distance"):
        return ABSENT_DISTANCE
    return {"speed": 30.0, "lane_width": profile.lane_width, "lane_count": 2.0, "friction": 1.0}.get(name, 0.0)


def _seen(name: str, value: float) -> float:
    return float("inf") if name.endswith("_distance") and value >= ABSENT_DISTANCE else float(value)


def _complete(root: Any, units: Mapping[str, str]) -> None:
    """Units, and outputs as initial unknowns, into a model description of FMI 2."""
    from xml.etree.ElementTree import Element, SubElement

    definitions = Element("UnitDefinitions")
    for name in sorted(set(units.values())):
        one = SubElement(definitions, "Unit", name=name)
        SubElement(one, "BaseUnit", {key: f"{value:.16g}" for key, value in UNITS[name].items()})
    root.insert(1, definitions)
    initial = SubElement(root.find("ModelStructure"), "InitialUnknowns")
    for index, variable in enumerate(root.iter("ScalarVariable"), start=1):
        number = variable.find("Real")
        if number is not None:
            number.set("unit", units[variable.get("name")])
        if variable.get("causality") == "output":
            SubElement(initial, "Unknown", index=str(index))
