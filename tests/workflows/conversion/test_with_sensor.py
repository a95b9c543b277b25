"""The sensor on top of the driver, where it is asked for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.plugins import shipped_folder
from xosc_lateral.cli import main
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import known_sensor, sensor_error
from xosc_lateral.drivers.model.sensor import SensorModel
from xosc_lateral.files.openscenario.provenance import MARK
from xosc_lateral.files.profiles import read_profile, write_profile
from xosc_lateral.workflows.conversion.convert import convert

NOISE = SensorModel(white=0.01)
"""0.12 m rms below 1.5 Hz."""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenario")
    assert main(["template", "write", "cut-in", "-o", str(folder), "-q"]) == 0
    return folder / "cut-in.xosc"


@pytest.fixture(scope="module")
def profile() -> DriverProfile:
    return replace(read_profile(shipped_folder("driver_profiles") / "motorway.json"), sensor=NOISE)


def _offsets(made: object) -> dict[str, np.ndarray]:
    entities = made.movement.entities  # type: ignore[attr-defined]
    return {one.name: np.concatenate([segment.offset for segment in one.segments]) for one in entities}


def test_the_driver_stays_and_the_error_is_added(scenario: Path, profile: DriverProfile) -> None:
    alone = convert(scenario, profile=profile, time_limit=10.0, ego="none")
    both = convert(scenario, profile=profile, time_limit=10.0, ego="none", with_sensor=True)
    again = convert(scenario, profile=profile, time_limit=10.0, ego="none", with_sensor=True)
    assert again.data == both.data != alone.data
    errors = [_offsets(both)[name] - offset for name, offset in _offsets(alone).items()]
    assert np.concatenate(errors).std() == pytest.approx(np.sqrt(NOISE.white * 1.5), rel=0.2)
    assert len({float(error[0]) for error in errors}) == len(errors)  # everybody's own
    assert not alone.to_dict()["provenance"]["options"]["with_sensor"]
    assert both.to_dict()["provenance"]["options"]["with_sensor"]
    assert b'"with_sensor": true' in both.data and b"with sensor]" in both.data and MARK.encode() in both.data


def test_a_profile_that_knows_no_sensor_is_named(scenario: Path, profile: DriverProfile) -> None:
    with pytest.raises(DriverProfileError, match="motorway holds no sensor"):
        convert(scenario, profile=replace(profile, sensor=None), with_sensor=True)
    assert known_sensor(profile) is NOISE


def test_pieces_of_a_drive_have_errors_of_their_own() -> None:
    seed = np.random.SeedSequence(3)
    one, other = (sensor_error(NOISE, np.zeros(50), 0.2, seed, part=part) for part in (0, 1))
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.5
    np.testing.assert_array_equal(sensor_error(NOISE, np.zeros(50), 0.2, seed), one)
    assert not sensor_error(None, np.zeros(5), 0.2, seed).any()


def test_the_command_line_and_the_manifest_say_which(
    scenario: Path, profile: DriverProfile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine.json"
    write_profile(profile, mine)
    words = ["convert", str(scenario.parent), "-o", str(tmp_path / "out"), "-p", str(mine), "--time-limit", "4"]
    for extra, expected in (([], False), (["--with", "sensor"], True)):
        assert main([*words, *extra, "--json"]) == 0
        output, *_ = map(json.loads, capsys.readouterr().out.splitlines())
        assert (output["with_sensor"], output["state"]) == (expected, "written")
