"""A driver as a functional mock-up unit, FMI 2.0 or 3.0 for co-simulation: C source, and binaries where it compiles."""

from __future__ import annotations

import io
import re
import shlex
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.limits import DISTANCES
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import DriverProfile, sampling_hash
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.workflows.live.c_driver import c_sources, filled, identifier
from xosc_lateral.workflows.live.c_numbers import inputs_of
from xosc_lateral.workflows.live.fmu_variables import ABSENT_DISTANCE, Variable, add_units, variables_of
from xosc_lateral.workflows.live.python_fmu import export_python_fmu

HOST_COMPILERS = ("cc", "gcc", "clang")
"""What is looked for where no compiler is named; the first that is there."""

COMPILER_TIMEOUT = 120.0
"""A driver compiles in a second. [s]"""

STATE = {"2": ("FMUstate", "DeSerializeFMUstate"), "3": ("FMUState", "DeserializeFMUState")}
"""What versions of FMI call the state, and reading it back."""


def export_fmu(
    profile: DriverProfile, path: str | Path, *, fmi: str = "2.0", python: bool = False, compilers: Sequence[str] = ()
) -> tuple[str, ...]:
    """Write a unit; the platforms that it has binaries for.

    Parameters
    ----------
    profile : DriverProfile
    path : path
        ``.fmu``, which is replaced.
    fmi : str
        ``2.0`` or ``3.0``.
    python : bool
        A unit that calls this package, which the simulating process has to have beside its Python (extra `fmu`).
    compilers : sequence of str
        Of C99, cross compilers too; without, the host's where there is one. C source is in every unit.

    Raises `SimulationError`: a compiler is not there or fails, or the extra `fmu` is missing; `DriverProfileError`: the
    profile has an effect or a core model of a plug-in.
    """
    if python:
        export_python_fmu(profile, path, fmi=fmi)
        return ()
    version, name = fmi[0], identifier(profile)
    sources = _sources(profile, version)
    members = {f"sources/{file}": text.encode() for file, text in sources.items()}
    platforms = []
    for compiler in compilers or [host for host in HOST_COMPILERS if shutil.which(host)][:1]:
        platform, suffix, binary = _compiled(compiler, sources, version)
        members[f"binaries/{platform}/{name}{suffix}"] = binary
        platforms.append(platform)
    described = _description_2 if version == "2" else _description_3
    members["modelDescription.xml"] = _xml(described(profile, _token(sources)))
    if version == "3":
        members["sources/buildDescription.xml"] = _xml(_build_description(name))
    write_atomically(path, _packed(members))
    return tuple(platforms)


def _sources(profile: DriverProfile, version: str) -> dict[str, str]:
    sources = c_sources(profile)
    state, deserialize = STATE[version]
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


def _root(profile: DriverProfile, fmi: str, **token: str) -> Element:
    words = {
        "fmiVersion": fmi,
        "modelName": identifier(profile),
        "description": f"Driver {profile.name} of xosc-lateral {__version__}: lateral offset in the lane, positive "
        f"left. C99; profile {sampling_hash(profile)[:16]}",
        "author": "xosc-lateral",
        "generationTool": f"xosc-lateral {__version__}",
        "variableNamingConvention": "flat",
    }
    return Element("fmiModelDescription", words | token)


def _abilities(profile: DriverProfile, state: str) -> dict[str, str]:
    able = ("canHandleVariableCommunicationStepSize", f"canGetAndSet{state}", f"canSerialize{state}")
    return {"modelIdentifier": identifier(profile), **dict.fromkeys(able, "true")}


def _common(root: Element, profile: DriverProfile) -> None:
    """Units, log and experiment, which both versions have at this place."""
    add_units(root, {variable.unit for variable in variables_of(profile) if variable.unit is not None})
    SubElement(SubElement(root, "LogCategories"), "Category", name="logStatusError")
    SubElement(root, "DefaultExperiment", startTime="0", stepSize="0.01")


def _value(variable: Variable) -> dict[str, str]:
    """Unit and start."""
    words = {} if variable.unit is None else {"unit": variable.unit}
    if variable.start is not None:
        words["start"] = str(variable.start).lower() if isinstance(variable.start, bool) else f"{variable.start:.17g}"
    return words


def _kind(variable: Variable) -> int:
    """0: real, 1: truth value, 2: whole number."""
    return 0 if variable.unit is not None else 1 if isinstance(variable.start, bool) else 2


def _variability(variable: Variable) -> str:
    return ("continuous", "discrete", "fixed")[_kind(variable)]


def _description_2(profile: DriverProfile, token: str) -> Element:
    root = _root(profile, "2.0", guid=token)
    simulation = SubElement(root, "CoSimulation", _abilities(profile, STATE["2"][0]))
    listed = SubElement(simulation, "SourceFiles")
    for name in (f"{identifier(profile)}.c", "fmi.c"):
        SubElement(listed, "File", name=name)
    _common(root, profile)
    variables, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    outputs, unknown = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    for reference, variable in enumerate(variables_of(profile)):
        words = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
        words |= {"variability": _variability(variable), "description": variable.words}
        scalar = SubElement(variables, "ScalarVariable", words)
        SubElement(scalar, ("Real", "Boolean", "Integer")[_kind(variable)], _value(variable))
        if variable.causality == "output":
            for part in (outputs, unknown):
                SubElement(part, "Unknown", index=str(reference + 1))
    return root


def _description_3(profile: DriverProfile, token: str) -> Element:
    root = _root(profile, "3.0", instantiationToken=token)
    SubElement(root, "CoSimulation", _abilities(profile, STATE["3"][0]))
    _common(root, profile)
    variables, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    outputs, unknown = [], []
    for reference, variable in enumerate(variables_of(profile)):
        words = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
        words |= {"variability": _variability(variable), "description": variable.words}
        SubElement(variables, ("Float64", "Boolean", "Int32")[_kind(variable)], words | _value(variable))
        if variable.causality == "output":
            outputs.append(Element("Output", valueReference=str(reference)))
            unknown.append(Element("InitialUnknown", valueReference=str(reference)))
    clock = {"name": "time", "valueReference": str(len(variables)), "causality": "independent"}
    SubElement(variables, "Float64", clock | {"variability": "continuous", "description": "Simulation time"})
    structure.extend([*outputs, *unknown])
    return root


def _build_description(name: str) -> Element:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    files = SubElement(SubElement(root, "BuildConfiguration", modelIdentifier=name), "SourceFileSet", language="C99")
    for file in (f"{name}.c", "fmi.c"):
        SubElement(files, "SourceFile", name=file)
    SubElement(
        files, "PreprocessorDefinition", name="FMI3_OVERRIDE_FUNCTION_PREFIX", optional="true",
        description="For shared libraries: functions without a prefix",
    )  # fmt: skip
    return root


def _xml(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _packed(members: Mapping[str, bytes]) -> bytes:
    """A zip file, the same for the same members."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(members):
            archive.writestr(zipfile.ZipInfo(name), members[name], zipfile.ZIP_DEFLATED)
    return packed.getvalue()
