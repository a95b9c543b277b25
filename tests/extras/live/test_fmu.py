"""A driver as an FMU: valid, and the offsets that `sample` gives."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from tests.kit.compiled import SANITIZED, build, compiler, gentle
from tests.kit.profiles import REFINED
from xosc_lateral.cli import main
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.extras.live.c_numbers import inputs_of
from xosc_lateral.extras.live.traffic import Moment, Traffic

fmpy = pytest.importorskip("fmpy", reason="no fmpy here")
pytestmark = pytest.mark.filterwarnings("ignore")  # of foreign packages

VERSIONS = ("2.0", "3.0")


class Alone(Traffic):
    """The driver that `sample` gives for the seed."""

    def seed_of(self, name: str) -> np.random.SeedSequence:
        return child(np.random.SeedSequence(self.seed), 0)


def exported(version: str, path: Path, *words: str, profile: str = "motorway") -> Path:
    assert main(["export", "fmu", "-p", profile, "--fmi", version, "-o", str(path), "-q", *words]) == 0
    return path


@pytest.fixture(scope="module", params=VERSIONS)
def unit(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler()
    return exported(request.param, tmp_path_factory.mktemp("fmu") / f"driver{request.param[0]}.fmu")


def test_it_is_valid_and_has_units(unit: Path) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(unit)) == []
    described = fmpy.read_model_description(str(unit))
    units = {one.name: one.unit for one in described.modelVariables if one.causality in ("input", "output")}
    assert {one.name for one in described.modelVariables if one.type in ("Integer", "Int32")} == {"seed", "fault"}
    assert units["offset"] == "m" and units["rate"] == "m/s" and units["heading"] == "rad"
    assert units["speed"] == "m/s" and units["left_distance"] == "m" and units["is_truck"] == "-"
    assert {one.name for one in described.modelVariables if one.causality == "parameter"} >= {"seed"}
    means = described.coSimulation
    assert means.canGetAndSetFMUstate and means.canSerializeFMUstate


def test_simulated_it_is_what_is_sampled(unit: Path) -> None:
    seconds = 12.0
    values = {"seed": 4, "is_truck": 1.0, "lane_index": 1.0, "speed": 27.0, "lane_width": 3.6}
    rows = round(seconds / 0.2) + 1
    columns = {"speed": 27.0, "lane_width": 3.6, "is_truck": 1.0, "lane_index": 1.0}
    away = {"left_distance": np.inf, "right_distance": np.inf}
    table = pd.DataFrame({"drive": "one", "time": 0.2 * np.arange(rows), "offset": 0.0, **columns, **away})
    wanted = xl.sample("motorway", context=table, seed=4).to_frame().offset.to_numpy()
    found = fmpy.simulate_fmu(
        str(unit), stop_time=seconds, step_size=0.05, output_interval=0.05, start_values=values, output=["offset"]
    )
    np.testing.assert_allclose(found["offset"][::4], wanted, atol=1e-9, rtol=0.0)


def test_a_state_brings_it_back(tmp_path: Path, unit: Path) -> None:
    from fmpy import extract, instantiate_fmu

    described = fmpy.read_model_description(str(unit))
    folder = extract(str(unit), unzipdir=str(tmp_path))
    one = instantiate_fmu(folder, described, "CoSimulation")
    reference = [next(v.valueReference for v in described.modelVariables if v.name == "offset")]
    is_2 = described.fmiVersion.startswith("2")
    if is_2:
        one.setupExperiment(startTime=0.0)
        one.enterInitializationMode()
    else:
        one.enterInitializationMode(startTime=0.0)
    one.exitInitializationMode()
    read = one.getReal if is_2 else one.getFloat64

    def on(first: int, last: int) -> list[float]:
        found = []
        for k in range(first, last):
            one.doStep(currentCommunicationPoint=0.1 * k, communicationStepSize=0.1)
            found.append(read(reference)[0])
        return found

    on(0, 7)
    state = one.getFMUstate() if is_2 else one.getFMUState()
    saved = (one.serializeFMUstate if is_2 else one.serializeFMUState)(state)
    after = on(7, 30)
    (one.setFMUstate if is_2 else one.setFMUState)(state)
    assert on(7, 30) == after
    state = (one.deSerializeFMUstate if is_2 else one.deserializeFMUState)(saved)
    (one.setFMUstate if is_2 else one.setFMUState)(state)
    assert on(7, 30) == after
    one.terminate()
    one.freeInstance()


def test_what_a_driver_can_not_do_is_refused_with_a_reason_and_the_next_step_goes_on(
    tmp_path: Path, unit: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    from fmpy import extract, instantiate_fmu

    described = fmpy.read_model_description(str(unit))
    is_2 = described.fmiVersion.startswith("2")
    one = instantiate_fmu(extract(str(unit), str(tmp_path)), described, "CoSimulation", debug_logging=not is_2)
    number = {variable.name: [variable.valueReference] for variable in described.modelVariables}
    write = one.setReal if is_2 else one.setFloat64

    def step(time: float) -> str:
        try:
            one.doStep(currentCommunicationPoint=time, communicationStepSize=0.1)
        except Exception:
            found = capfd.readouterr()
            return found.err + found.out
        return ""

    assert "before the end of initialization" in step(0.0)
    whole, truth = ("Integer", "Boolean") if is_2 else ("Int32", "Boolean")
    for name, kind, values in (("seed", whole, (0, 7, 2**31 - 1)), ("following", truth, (False, True, False, True))):
        for value in values:  # what is set is read back
            getattr(one, f"set{kind}")(number[name], [value])
            assert getattr(one, f"get{kind}")(number[name]) == [value]
    assert getattr(one, f"get{whole}")(number["fault"]) == [0]
    if is_2:
        one.setupExperiment(startTime=30_000.0)
        one.enterInitializationMode()
    else:
        one.enterInitializationMode(startTime=30_000.0)
    one.exitInitializationMode()
    assert step(30_000.0) == ""
    for name, value, usual in (("speed", -10.0, 30.0), ("speed", 1e9, 30.0), ("lane_width", -1.0, 3.6)):
        write(number[name], [value])
        assert name.replace("_", " ") in step(30_000.1).replace("_", " ")
        write(number[name], [usual])
    assert step(30_000.1) == ""
    one.terminate()
    one.freeInstance()


def run(unit: Path, context: dict[str, np.ndarray], step: float, seed: int = 3, **more: np.ndarray) -> np.ndarray:
    """Outputs at every step, of inputs that are there at its end."""
    from fmpy import extract, instantiate_fmu

    described = fmpy.read_model_description(str(unit))
    is_2 = described.fmiVersion.startswith("2")
    instance = instantiate_fmu(extract(str(unit)), described, "CoSimulation")
    number = {variable.name: [variable.valueReference] for variable in described.modelVariables}
    write, read = (instance.setReal, instance.getReal) if is_2 else (instance.setFloat64, instance.getFloat64)

    def see(row: int) -> None:
        for name, values in {**context, **more}.items():
            (instance.setBoolean if name == "following" else write)(number[name], [values[row].item()])

    if is_2:
        instance.setupExperiment(startTime=0.0)
        instance.enterInitializationMode()
    else:
        instance.enterInitializationMode(startTime=0.0)
    (instance.setInteger if is_2 else instance.setInt32)(number["seed"], [seed])
    see(0)
    instance.exitInitializationMode()
    outputs = [number[name][0] for name in ("offset", "rate", "heading")]
    rows = [list(read(outputs))]
    for k in range(1, len(context["speed"])):
        see(k)
        instance.doStep(currentCommunicationPoint=step * (k - 1), communicationStepSize=step)
        rows.append(list(read(outputs)))
    instance.terminate()
    instance.freeInstance()
    return np.array(rows)


@pytest.mark.parametrize("version", VERSIONS)
def test_under_a_context_that_changes_gently_it_is_what_is_sampled_a_preview_later(
    version: str, tmp_path: Path
) -> None:
    compiler()
    profile = xl.read_profile(REFINED)
    unit = exported(version, tmp_path / "driver.fmu", profile=REFINED)
    context = gentle(inputs_of(profile), 300)
    late = np.maximum(np.arange(300) - round(xl.OffsetStream(profile, 0, rate=100.0).preview / 0.2), 0)
    columns = {name: values[late] for name, values in context.items()}
    table = pd.DataFrame({"drive": "one", "time": 0.2 * np.arange(300), "offset": 0.0, **columns})
    sampled = xl.sample(profile, context=table, seed=3).to_frame()  # without the rows about a change of lanes
    rows = np.round(sampled.time.to_numpy() / 0.2).astype(int)
    known = rows < 300 - round(xl.OffsetStream(profile, 0, rate=100.0).preview / 0.2)  # then `sample` has nothing ahead
    assert known.sum() > 200
    np.testing.assert_allclose(run(unit, context, 0.2)[rows[known], 0], sampled.offset[known], atol=1e-9, rtol=0.0)


@pytest.mark.pages
@pytest.mark.parametrize("version", VERSIONS)
def test_slow_driving_maneuvers_and_surprises_are_as_in_live_traffic(version: str, tmp_path: Path) -> None:
    compiler()
    time = 0.05 * np.arange(1600)
    context = {"speed": np.clip(20.0 + 25.0 * np.sin(time / 9.0), 0.0, None), "lane_width": np.full(1600, 3.5)}
    more = {"following": (time % 20.0 > 6.0) | (time < 14.0), "position": 1.5 * np.sin(time)}
    unit = exported(version, tmp_path / "driver.fmu", profile=REFINED)
    context |= {"lane_index": np.floor(time / 11.0) % 2.0, "is_truck": np.zeros(1600)}
    context |= {f"{side}_distance": np.where(time % 17.0 < 4.0, 8.0, np.inf) for side in ("left", "right")}
    traffic, offset, wanted = Alone(xl.read_profile(REFINED), seed=3), 0.0, []
    for row in range(1600):
        seen = {name: values[row : row + 1] for name, values in context.items()}
        follows = more["following"][row : row + 1]
        place = np.array([offset]) if follows[0] else more["position"][row : row + 1]
        around = {name: values for name, values in seen.items() if name not in ("speed", "lane_width", "is_truck")}
        moment = Moment(("one",), seen["speed"], seen["lane_width"], place, follows, np.ones(1, dtype=bool),
                        np.zeros(1, dtype=bool), context=around)  # fmt: skip
        moves = traffic.step(0.05 * row, moment)
        offset = float(moves.offset[0])
        wanted.append([float(part[0]) for part in moves[:3]])
    seen = {name: np.minimum(values, 1000.0) for name, values in context.items()}
    np.testing.assert_allclose(run(unit, seen, 0.05, **more), wanted, atol=1e-9, rtol=0.0)


@pytest.mark.parametrize("version", VERSIONS)
def test_instances_are_their_own_and_a_reset_one_begins_anew(version: str, tmp_path: Path) -> None:
    from fmpy import extract, instantiate_fmu

    compiler()
    unit = exported(version, tmp_path / "driver.fmu")
    described, folder = fmpy.read_model_description(str(unit)), extract(str(unit))
    is_2 = version == "2.0"
    number = {variable.name: [variable.valueReference] for variable in described.modelVariables}
    instances = [instantiate_fmu(folder, described, "CoSimulation") for _ in range(3)]

    def begin(instance: Any, seed: int) -> None:
        (instance.setInteger if is_2 else instance.setInt32)(number["seed"], [seed])
        instance.enterInitializationMode()
        instance.exitInitializationMode()

    def step(instance: Any, k: int) -> float:
        instance.doStep(currentCommunicationPoint=0.1 * k, communicationStepSize=0.1)
        return float((instance.getReal if is_2 else instance.getFloat64)(number["offset"])[0])

    for instance, seed in zip(instances, (1, 2, 1), strict=True):
        begin(instance, seed)
    first, second, third = np.array([[step(instance, k) for instance in instances] for k in range(50)]).T
    np.testing.assert_array_equal(first, third)
    assert np.abs(first - second).max() > 0.01
    instances[1].reset()
    begin(instances[1], 1)
    np.testing.assert_array_equal([step(instances[1], k) for k in range(50)], first)
    with pytest.raises(Exception, match="SetInt"):
        (instances[0].setInteger if is_2 else instances[0].setInt32)(number["seed"], [5])
    for instance in instances:
        instance.terminate()
        instance.freeInstance()


WITHOUT_US = """
import sys
sys.modules["xosc_lateral"] = None
import fmpy
from fmpy.validation import validate_fmu
assert validate_fmu(sys.argv[1]) == []
run = fmpy.simulate_fmu(sys.argv[1], stop_time=3.0, step_size=0.1, output_interval=0.1, output=["offset"])
print(run["offset"].std())
"""


@pytest.mark.parametrize("version", VERSIONS)
def test_it_runs_where_this_package_is_not(version: str, tmp_path: Path) -> None:
    unit = exported(version, tmp_path / "driver.fmu", "--compiler", compiler("cc"))
    words = [sys.executable, "-I", "-W", "ignore", "-c", WITHOUT_US, str(unit)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path, env={"PATH": ""})
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) > 0.0


@pytest.mark.pages
@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_sources_compile_without_a_warning_and_several_units_link_into_one_program(name: str, tmp_path: Path) -> None:
    sources = []
    for version, profile in (("2.0", "motorway"), ("3.0", REFINED), ("3.0", "rural")):
        unit = exported(version, tmp_path / f"{Path(profile).stem}.fmu", "--compiler", compiler(name), profile=profile)
        with zipfile.ZipFile(unit) as archive:
            archive.extractall(unit.with_suffix(""))
        sources += sorted((unit.with_suffix("") / "sources").glob("*.c"))
    build(sources, tmp_path / "all.so", "-shared", "-fPIC", *SANITIZED, name=name)


def test_a_unit_is_the_same_bytes_each_time_and_without_a_compiler_has_its_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler()
    first, again = (exported("3.0", tmp_path / name).read_bytes() for name in ("a.fmu", "b.fmu"))
    assert first == again
    monkeypatch.setattr("xosc_lateral.extras.live.export.HOST_COMPILERS", ("no such compiler",))
    assert xl.export_fmu(xl.read_profile("motorway"), tmp_path / "bare.fmu") == ()
    names = zipfile.ZipFile(tmp_path / "bare.fmu").namelist()
    assert "sources/fmi.c" in names and not any(name.startswith("binaries") for name in names)


def test_a_compiler_that_is_not_there_or_fails_is_told_in_a_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    failing, odd = tmp_path / "failing", tmp_path / "odd"
    failing.write_text(
        '#!/bin/sh\nif [ "$1" = -dumpmachine ]; then echo i686-linux; exit; fi\necho no licence >&2; exit 1\n'
    )
    odd.write_text("#!/bin/sh\necho avr\n")
    for program in (failing, odd):
        program.chmod(0o755)
    for words, message in (
        ("no-such-cc", "compiler 'no-such-cc': there is no such program"),
        (str(failing), "no licence"),
        (str(odd), "compiler for 'avr': FMI has no binaries for it"),
    ):
        assert main(["export", "fmu", "-o", str(tmp_path / "driver.fmu"), "--compiler", words]) == 1
        printed = capsys.readouterr().err
        assert message in printed and printed.count("\n") == 1
    assert not (tmp_path / "driver.fmu").exists()


@pytest.mark.parametrize(
    ("machine", "folders"),
    [
        ("x86_64-linux-gnu", ("linux64", "x86_64-linux", ".so")),
        ("i686-w64-mingw32", ("win32", "x86-windows", ".dll")),
        ("x86_64-w64-mingw32", ("win64", "x86_64-windows", ".dll")),
        ("arm64-apple-darwin23.1.0", ("aarch64-darwin", "aarch64-darwin", ".dylib")),
        ("aarch64-linux-gnu", ("aarch64-linux", "aarch64-linux", ".so")),
    ],
)
def test_platforms_are_called_as_the_standard_has_them(machine: str, folders: tuple[str, str, str]) -> None:
    from xosc_lateral.extras.live.export import _platform

    assert (_platform(machine, "2")[0], *_platform(machine, "3")) == folders


def test_a_cross_compiler_makes_a_second_binary(tmp_path: Path) -> None:
    cross = shutil.which("x86_64-w64-mingw32-gcc") or pytest.skip("no cross compiler here")
    unit = exported("2.0", tmp_path / "driver.fmu", "--compiler", compiler(), "--compiler", cross)
    names = zipfile.ZipFile(unit).namelist()
    assert {"binaries/linux64/driver_motorway.so", "binaries/win64/driver_motorway.dll"} <= set(names)
