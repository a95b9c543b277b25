"""A driver for other tools: as C source (templates in `extras/live/c` hold the model, tables a profile's numbers), and
as a functional mock-up unit, FMI 2.0 or 3.0 for co-simulation: that source, and binaries where it compiles."""

from __future__ import annotations

import io
import re
import shlex
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from textwrap import wrap
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from xosc_lateral.base.errors import DriverProfileError, SimulationError
from xosc_lateral.base.limits import DISTANCES
from xosc_lateral.base.names import in_c_comment, in_c_identifier
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile, sampling_hash
from xosc_lateral.extras.live.c_numbers import inputs_of, numbers_of, usual
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.output_paths import PACKAGE, claim, output_folder, template_mark


def identifier(profile: DriverProfile) -> str:
    """What names in C begin with."""
    return "driver_" + in_c_identifier(profile.name)


def export_c(profile: DriverProfile, folder: str | Path, *, force: bool = False) -> list[Path]:
    """Write a driver as C99 into a folder: header, source, the profile's numbers, a CMake file and an example loop.

    Raises `DriverProfileError` if the profile has an effect or a core model of a plug-in; `FormatError` if a file is
    there that is not to be replaced (`force`).
    """
    texts = c_sources(profile) | {name: filled(name, profile) for name in ("CMakeLists.txt", "example.c")}
    written = [output_folder(folder) / name for name in texts]
    claim(written, force=force)
    with together():
        for path, text in zip(written, texts.values(), strict=True):
            mark = template_mark(text, "# ", "") if path.suffix == ".txt" else template_mark(text, "/* ", " */")
            write_atomically(path, text + mark)
    return written


def _fields(profile: DriverProfile) -> dict[str, str]:
    """What columns are called in C: other names than the usual begin with x_, and so are no words of C.

    Raises `DriverProfileError` where two have the same.
    """
    columns: dict[str, str] = {}
    for column in inputs_of(profile):
        field = column if column in CONTEXT_UNITS else "x_" + in_c_identifier(column)
        if field in columns:
            raise DriverProfileError(f"profile {profile.name}: {columns[field]!r} and {column!r} are both {field} in C")
        columns[field] = column
    return {column: field for field, column in columns.items()}


def c_sources(profile: DriverProfile) -> dict[str, str]:
    """Header, source and numbers of a driver, by file name."""
    name, fields = identifier(profile), _fields(profile)
    (sizes, numbers), what = numbers_of(profile), _about(profile)
    words = {
        "WHAT": what,
        "SIZES": "\n".join(f"#define DRIVER_{key} {value}" for key, value in sizes.items()),
        "MEMORY": str(_memory(sizes)),
        "PREVIEW": repr(round(sizes["LOOKS"] * profile.model.step, 9)),
        "INPUTS": "\n".join(
            f"    double {field}; /* [{CONTEXT_UNITS.get(column, 'as in the profile')}] */"
            for column, field in fields.items()
        ),
        "KNOWN": "\n".join(
            f"#define DRIVER_KNOWS_{field} UINT64_C({1 << k})" for k, field in enumerate(fields.values())
        ),
        "ALL_KNOWN": str((1 << len(fields)) - 1),
        "MOVEMENT_FAULT": str(len(profile.effects) + 1),
    }
    return {
        f"{name}.h": filled("driver.h", profile, words),
        f"{name}.c": filled("driver.c", profile),
        f"{name}_profile.h": _named("\n".join([f"/* {what}\n */", *numbers, ""]), profile),
    }


def _about(profile: DriverProfile) -> str:
    """The driver's name, and the licences that its profile states, as lines of a comment."""
    licences = {"profile": profile.metadata.licence, "drives that it was fitted to": profile.provenance.licence}
    lines = [f"Driver {profile.name} of xosc-lateral {__version__}, in C99."]
    for what, licence in licences.items():
        lines += wrap(f"Licence of the {what}: {licence}", 115) if licence else []
    return in_c_comment("\n * ".join(lines))


def filled(template: str, profile: DriverProfile, words: Mapping[str, str] | None = None) -> str:
    """A template with words in place of those between @, and names of the profile's own."""
    text = files("xosc_lateral.extras.live").joinpath("c", template).read_text(encoding="utf-8")
    known = words or {}  # in one go: what a profile says is no template
    return _named(re.sub(r"@([A-Z_]+)@", lambda match: known.get(match[1], match[0]), text), profile)


def _named(text: str, profile: DriverProfile) -> str:
    return re.sub(r"\bDRIVER(?=_|\.h|\b)", identifier(profile), text)


def _memory(sizes: Mapping[str, int]) -> int:
    """Bytes of `DRIVER_state`, whose fields all have eight; the C compiler checks it."""
    history = sizes["ROWS"] * (sizes["COMPONENTS"] + 1)
    per_size = sum(sizes[name] for name in ("STEPS", "EVERY", "TAPS", "COMPONENTS", "LAGS")) + 10 * sizes["HIDDEN"]
    return 8 * (108 + history + per_size)


# ---- as a functional mock-up unit ----
HOST_COMPILERS = ("cc", "gcc", "clang")
"""What is looked for where no compiler is named; the first that is there."""

COMPILER_TIMEOUT = 120.0
"""A driver compiles in a second. [s]"""

NAMES_OF_STATE = {"2": ("FMUstate", "DeSerializeFMUstate"), "3": ("FMUState", "DeserializeFMUState")}
"""What versions of FMI call the state, and reading it back."""


def export_fmu(
    profile: DriverProfile, path: str | Path, *, fmi: str = "2.0", compilers: Sequence[str] = ()
) -> tuple[str, ...]:
    """Write a unit (``.fmu``, which is replaced) of FMI ``2.0`` or ``3.0``; the platforms that it has binaries for.

    It holds C source, and what the C99 `compilers` make of it, cross compilers too; without, the host's where there is
    one. Raises `SimulationError`: a compiler is not there or fails; `DriverProfileError`: the profile has an effect or
    a core model of a plug-in.
    """
    version, name = fmi[0], identifier(profile)
    sources = _sources(profile, version)
    members = {f"sources/{file}": text.encode() for file, text in sources.items()}
    platforms = []
    for compiler in compilers or [host for host in HOST_COMPILERS if shutil.which(host)][:1]:
        platform, suffix, binary = _compiled(compiler, sources, version)
        members[f"binaries/{platform}/{name}{suffix}"] = binary
        platforms.append(platform)
    members["modelDescription.xml"] = _xml(_description(profile, version, _token(sources)))
    if version == "3":
        members["sources/buildDescription.xml"] = _xml(_build_description(name))
    write_atomically(path, _packed(members))
    return tuple(platforms)


def _sources(profile: DriverProfile, version: str) -> dict[str, str]:
    sources = c_sources(profile)
    state, deserialize = NAMES_OF_STATE[version]
    distances = [
        0 if not column.endswith("_distance") else 1 if column in DISTANCES else 2 for column in inputs_of(profile)
    ]
    words = {
        "FMI": version,
        "STATE": state,
        "DESERIALIZE": deserialize,
        "ABSENT": repr(ABSENT_DISTANCE),
        "DISTANCES": ", ".join(map(str, [*distances, 0, 0])),
    }
    return {**sources, "fmi.c": filled("fmi.c", profile, words | {"TOKEN": _token(sources)})}


def _token(sources: Mapping[str, str]) -> str:
    """By which a description and its binaries know each other."""
    texts = "".join(text for name, text in sources.items() if name != "fmi.c")
    return f"{{{sha256(texts.encode()).hexdigest()[:32]}}}"


def _compiled(compiler: str, sources: Mapping[str, str], version: str) -> tuple[str, str, bytes]:
    """Platform in the words of the version of FMI, suffix, and the shared library."""
    words = shlex.split(compiler)
    if not words or shutil.which(words[0]) is None:
        raise SimulationError(f"compiler {compiler!r}: there is no such program")
    platform, suffix = _platform(_run([*words, "-dumpmachine"], Path()).decode().strip(), version)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX"]
        flags += [] if suffix == ".dll" else ["-fPIC", "-fvisibility=hidden"]
        files = [name for name in sources if name.endswith(".c")]
        _run([*words, *flags, *files, "-o", f"unit{suffix}", "-lm"], Path(folder))
        return platform, suffix, (Path(folder) / f"unit{suffix}").read_bytes()


def _run(words: Sequence[str], folder: Path) -> bytes:
    try:
        return subprocess.run(words, cwd=folder, capture_output=True, check=True, timeout=COMPILER_TIMEOUT).stdout
    except (OSError, subprocess.SubprocessError) as error:
        reason = (getattr(error, "stderr", b"") or b"").decode(errors="replace").strip() or str(error)
        raise SimulationError(f"compiler {words[0]!r}: {reason.splitlines()[0]}") from error


def _platform(machine: str, version: str) -> tuple[str, str]:
    """A compiler's target, such as ``x86_64-linux-gnu``, as the folder of FMI and the suffix of libraries."""
    architecture = machine.split("-")[0].replace("amd64", "x86_64").replace("arm64", "aarch64")
    architecture = "x86" if re.fullmatch(r"i\d86", architecture) else architecture
    systems = {"mingw": ("windows", ".dll"), "windows": ("windows", ".dll"), "darwin": ("darwin", ".dylib"),
               "linux": ("linux", ".so")}  # fmt: skip
    system, suffix = next((value for key, value in systems.items() if key in machine), ("", ""))
    if not system:
        raise SimulationError(f"compiler for {machine!r}: FMI has no binaries for it; use the unit's C source")
    bits = {"x86_64": "64", "x86": "32"}.get(architecture)
    if version == "2" and bits:
        return {"windows": "win"}.get(system, system) + bits, suffix
    return f"{architecture}-{system}", suffix


def _description(profile: DriverProfile, version: str, token: str) -> Element:
    """The model description."""
    is_2, name, state = version == "2", identifier(profile), NAMES_OF_STATE[version][0]
    root = Element("fmiModelDescription", {
        "fmiVersion": f"{version}.0", "modelName": name, "guid" if is_2 else "instantiationToken": token,
        "description": f"Driver {profile.name} of xosc-lateral {__version__}: lateral offset in the lane, positive "
        f"left. C99; profile {sampling_hash(profile)[:16]}",
        "author": "xosc-lateral", "generationTool": f"xosc-lateral {__version__}", "variableNamingConvention": "flat",
    })  # fmt: skip
    able = ("canHandleVariableCommunicationStepSize", f"canGetAndSet{state}", f"canSerialize{state}")
    simulation = SubElement(root, "CoSimulation", {"modelIdentifier": name, **dict.fromkeys(able, "true")})
    if is_2:
        _list_sources(SubElement(simulation, "SourceFiles"), "File", name)
    listed = variables_of(profile)
    names = ["time", *(variable.name for variable in listed)]
    if twice := [name for name in names if names.count(name) > 1]:
        raise DriverProfileError(f"profile {profile.name}: a column is called {twice[0]!r}, as a variable of all units")
    add_units(root, {variable.unit for variable in listed if variable.unit is not None})
    logged = SubElement(root, "LogCategories")
    for category in ("logStatusWarning", "logStatusError"):
        SubElement(logged, "Category", name=category)
    SubElement(root, "DefaultExperiment", startTime="0", stepSize="0.01")
    variables, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    for reference, variable in enumerate(listed):
        words = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
        words |= {"variability": variable.variability, "description": variable.words}
        if is_2:
            scalar = SubElement(variables, "ScalarVariable", words)
            SubElement(scalar, ("Real", "Boolean", "Integer")[variable.kind], _value(variable))
        else:
            SubElement(variables, ("Float64", "Boolean", "Int32")[variable.kind], words | _value(variable))
    if not is_2:
        clock = {"name": "time", "valueReference": str(len(listed)), "causality": "independent"}
        SubElement(variables, "Float64", clock | {"variability": "continuous", "description": "Simulation time"})
    for list_of, element in (("Outputs", "Output"), ("InitialUnknowns", "InitialUnknown")):
        place = SubElement(structure, list_of) if is_2 else structure
        for reference, variable in enumerate(listed):
            if variable.causality == "output":
                where = {"index": str(reference + 1)} if is_2 else {"valueReference": str(reference)}
                SubElement(place, "Unknown" if is_2 else element, where)
    return root


def _value(variable: Variable) -> dict[str, str]:
    """Unit and start."""
    words = {} if variable.unit is None else {"unit": variable.unit}
    if variable.start is not None:
        words["start"] = str(variable.start).lower() if isinstance(variable.start, bool) else f"{variable.start:.17g}"
    return words


def _build_description(name: str) -> Element:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    files = SubElement(SubElement(root, "BuildConfiguration", modelIdentifier=name), "SourceFileSet", language="C99")
    _list_sources(files, "SourceFile", name)
    words = {"optional": "true", "description": "For shared libraries: functions without a prefix"}
    SubElement(files, "PreprocessorDefinition", words, name="FMI3_OVERRIDE_FUNCTION_PREFIX")
    return root


def _list_sources(place: Element, element: str, name: str) -> None:
    for file in (f"{name}.c", "fmi.c"):
        SubElement(place, element, name=file)


def _xml(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _packed(members: Mapping[str, bytes]) -> bytes:
    """A zip file, the same for the same members."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = PACKAGE
        for name in sorted(members):
            archive.writestr(zipfile.ZipInfo(name), members[name], zipfile.ZIP_DEFLATED)
    return packed.getvalue()


# ---- variables and units ---------------------------------------------------------------------------------------------
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
    "fault": "Number of the effect that wanted what can't be driven; 0: none",
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
        return "fixed" if self.causality == "parameter" else "discrete" if self.kind else "continuous"

    @property
    def words(self) -> str:
        """For the description."""
        return DESCRIPTIONS_OF_VARIABLES.get(self.name, self.name)


def variables_of(profile: DriverProfile) -> list[Variable]:
    """In the order of their value references: inputs, outputs, seed, fault."""
    inputs = [
        Variable(name, "input", min(usual(profile, name), ABSENT_DISTANCE), CONTEXT_UNITS.get(name, "-"))
        for name in inputs_of(profile)
    ]
    outputs = [
        Variable(name, "output", None, unit) for name, unit in (("offset", "m"), ("rate", "m/s"), ("heading", "rad"))
    ]
    position = Variable("position", "input", 0.0, "m")
    following, seed, fault = (
        Variable("following", "input", True),
        Variable("seed", "parameter", 0),
        Variable("fault", "output", None),
    )
    return [*inputs, position, following, *outputs, seed, fault]


def add_units(root: Element, names: set[str]) -> Element:
    """Definitions of units as both versions of FMI have them."""
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted(names):
        unit = SubElement(definitions, "Unit", name=name)
        SubElement(unit, "BaseUnit", {key: f"{value:.16g}" for key, value in BASE_UNITS[name].items()})
    return definitions
