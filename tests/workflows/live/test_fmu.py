"""A driver as an FMU: valid, and the offsets that `sample` gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main

fmpy = pytest.importorskip("fmpy", reason="the extra fmu is not installed")
pytest.importorskip("pythonfmu")
pytest.importorskip("pythonfmu3")
pytestmark = pytest.mark.filterwarnings("ignore")  # of foreign packages

VERSIONS = ("2.0", "3.0")


@pytest.fixture(scope="module", params=VERSIONS)
def unit(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / f"driver{request.param[0]}.fmu"
    assert main(["export", "fmu", "-p", "motorway", "--fmi", request.param, "-o", str(path)]) == 0
    return path


def test_it_is_valid_and_has_units(unit: Path) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(unit)) == []
    described = fmpy.read_model_description(str(unit))
    units = {one.name: one.unit for one in described.modelVariables if one.causality in ("input", "output")}
    assert units["offset"] == "m" and units["rate"] == "m/s" and units["heading"] == "rad"
    assert units["speed"] == "m/s" and units["left_distance"] == "m" and units["is_truck"] == "-"
    assert {one.name for one in described.modelVariables if one.causality == "parameter"} >= {"seed", "profile"}
    means = described.coSimulation
    assert means.canGetAndSetFMUstate and means.canSerializeFMUstate


@pytest.mark.parametrize("profile", ["", "motorway-vehicle-3"])
def test_simulated_it_is_what_is_sampled(unit: Path, profile: str) -> None:
    seconds = 12.0
    values = {"seed": 4, "profile": profile, "is_truck": 1.0, "lane_index": 1.0, "speed": 27.0, "lane_width": 3.6}
    inside = xl.read_profile(profile or "motorway")
    rows = round(seconds / 0.2) + 1
    columns = {"speed": 27.0, "lane_width": 3.6, "is_truck": 1.0, "lane_index": 1.0}
    away = {"left_distance": np.inf, "right_distance": np.inf}
    table = pd.DataFrame({"drive": "one", "time": 0.2 * np.arange(rows), "offset": 0.0, **columns, **away})
    wanted = xl.sample(inside, context=table, seed=4).to_frame().offset.to_numpy()
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
    after = on(7, 30)
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
    assert "Needs a host with Python" in described.description
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
    if is_2:
        one.setupExperiment(startTime=30_000.0)
        one.enterInitializationMode()
    else:
        one.enterInitializationMode(startTime=30_000.0)
    one.exitInitializationMode()
    assert step(30_000.0) == ""
    for name, value, usual in (("speed", -10.0, 30.0), ("speed", 1e9, 30.0), ("lane_width", -1.0, 3.6)):
        write(number[name], [value])
        assert name.replace("_", " ") in step(30_000.1)
        write(number[name], [usual])
    assert step(30_000.1) == ""
    one.terminate()
    one.freeInstance()
