"""Versions of the profile file: what is refused, what is renamed, and the way back for old hashes."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.driver.certified import FOLDER
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.versions import FORMAT, VERSION, as_version_1, upgraded
from xosc_lateral.errors import DriverProfileError

OLD: dict[str, Any] = {
    "format": FORMAT,
    "version": 1,
    "name": "someone",
    "lane_width": 3.5,
    "model": {"kind": "best", "coarse_liveliness": {"between": 0.1}, "fine_liveliness": {"between": 0.2}, "mean": 0.0},
    "effects": [],
}


def test_what_version_1_called_otherwise_has_its_present_name() -> None:
    model = {"coarse_volatility": {"between": 0.1}, "fine_volatility": {"between": 0.2}, "mean": 0.0}
    expected = {"id": "someone", "lane_width": 3.5, "effects": [], "model": model | {"kind": "autoregressive"}}
    assert upgraded(OLD) == expected


def test_the_file_itself_is_left_as_it_is() -> None:
    before = json.dumps(OLD)
    upgraded(OLD)
    assert json.dumps(OLD) == before


def test_the_present_version_is_handed_through() -> None:
    values = {"id": "a", "name": "no field of ours", "model": {"kind": "best"}}
    assert upgraded({"format": FORMAT, "version": VERSION, **values}) == values


def test_there_and_back_is_the_same_file() -> None:
    assert as_version_1({"version": VERSION, "format": FORMAT, **upgraded(OLD)}) == OLD


def test_later_fields_are_none_of_version_1() -> None:
    later = {"metadata": {"tags": ["x"]}, "sensor": {"white": 1e-4}}
    assert as_version_1({**upgraded(OLD), **later}) == as_version_1(upgraded(OLD))


@pytest.mark.parametrize("name", ["two-level-effects", "best-effects"])
def test_certified_files_say_the_same_in_both_versions(name: str) -> None:
    values = json.loads((FOLDER / f"{name}.json").read_text())
    profile = DriverProfile.from_dict(values)
    again = DriverProfile.from_dict(json.loads(json.dumps(profile.to_dict())))
    assert again.to_dict() == profile.to_dict()
    assert as_version_1(profile.to_dict())["model"]["kind"] == values["model"]["kind"]


@pytest.mark.parametrize("values", [{}, [], None, 7, {"format": "another"}, {"version": 1}], ids=str)
def test_what_is_no_profile_is_refused(values: object) -> None:
    with pytest.raises(DriverProfileError, match=f'not a driver profile: "format" is not "{FORMAT}"'):
        upgraded(values)


@pytest.mark.parametrize("version", [0, -1, "1", 1.0, True, None], ids=repr)
def test_a_version_is_a_whole_number_from_1(version: object) -> None:
    with pytest.raises(DriverProfileError, match="expected a whole number from 1"):
        upgraded({"format": FORMAT, "version": version})


def test_a_newer_file_asks_for_a_newer_package() -> None:
    with pytest.raises(DriverProfileError, match=rf"file format {VERSION + 1}; this one reads up to {VERSION}"):
        upgraded({"format": FORMAT, "version": VERSION + 1})


@pytest.mark.parametrize("model", [None, "best", [1]], ids=repr)
def test_a_model_that_is_none_is_left_for_the_reader_to_refuse(model: object) -> None:
    assert upgraded({**OLD, "model": model})["model"] == model
