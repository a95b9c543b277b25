"""Profile files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.profiles import simulated_profile
from xosc_lateral.driver.effects import Acts, Drift, Linear
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.errors import DriverProfileError, FormatError
from xosc_lateral.formats.profiles import (
    SCHEMA,
    SHIPPED,
    canonical_json,
    find_profile,
    list_profiles,
    profile_bytes,
    profile_hash,
    read_profile,
    write_profile,
)

VERSION_1 = """{"format": "xosc-lateral driver profile", "version": 1, "name": "old", "model": {"kind": "two-level",
"settings": {"n_bins": 2}, "counts": [[5, 1], [1, 5]], "damping": [0.01, 0.0]}}"""
"""A file as the first version wrote it at least; it has to stay readable."""


@pytest.fixture(params=["two-level", "best"])
def profile(request: pytest.FixtureRequest) -> DriverProfile:
    effects = (
        Linear(acts=Acts.LOCATION, column="curvature", coefficients=(200.0,), errors=(1.0,), reference=(0.0,)),
        Drift(size=0.1),
    )
    return replace(simulated_profile(request.param), effects=effects)


def test_reading_what_was_written_gives_the_same_bytes(profile: DriverProfile, tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    write_profile(profile, path)
    again = read_profile(path)
    assert profile_bytes(again) == path.read_bytes() == profile_bytes(profile)
    assert profile_hash(again) == profile_hash(profile)
    assert again.effects == profile.effects


def test_files_follow_the_schema(profile: DriverProfile) -> None:
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(json.loads(profile_bytes(profile)), schema)
    jsonschema.validate(json.loads(VERSION_1), schema)


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.json")), ids=lambda path: path.stem)
def test_shipped_profiles_follow_the_schema_and_are_canonical(path: Path) -> None:
    jsonschema.validate(json.loads(path.read_text()), json.loads(SCHEMA.read_text()))
    profile = read_profile(path.stem)
    assert profile.name == path.stem
    assert profile.provenance.hours > 0
    assert profile.provenance.source
    assert profile.provenance.licence


def test_a_profile_of_the_first_version_stays_readable(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text(VERSION_1)
    profile = read_profile(path)
    assert profile.model.mean == pytest.approx(0.0)
    assert profile.model.settings.smoothing_sigma == 0.6  # type: ignore[attr-defined]


def test_names_are_looked_up_in_the_users_folders_first(tmp_path: Path) -> None:
    mine = replace(simulated_profile(), name="mine")
    write_profile(mine, tmp_path / "mine.json")
    assert read_profile("mine", [tmp_path]).name == "mine"
    assert list_profiles([tmp_path])[0] == tmp_path / "mine.json"
    with pytest.raises(DriverProfileError, match=r"no profile 'mine'; known are "):
        read_profile("mine")
    with pytest.raises(FormatError, match="no such folder"):
        list_profiles([tmp_path / "nowhere"])


def broken(**changes: Any) -> str:
    values = json.loads(VERSION_1)
    for key, value in changes.items():
        if value is None:
            del values[key]
        else:
            values[key] = value
    return json.dumps(values)


def test_a_folder_that_is_not_there_is_no_library(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="nowhere: no such folder"):
        find_profile("motorway-car", [tmp_path / "nowhere"])


BAD = {
    "not JSON": ('{"format": \n oops', ":2: not JSON"),
    "NaN": (VERSION_1.replace("0.01", "NaN"), "NaN is no number of JSON"),
    "deep": ("[" * 100_000, "not JSON"),
    "a list": ("[]", "no driver profile"),
    "other format": (broken(format="x"), "no driver profile"),
    "newer": (broken(version=99), r"newer version \(99\)"),
    "no version": (broken(version=None), "version None"),
    "no model": (broken(model=None), '"model" is missing'),
    "unknown model": (broken(model={"kind": "oracle"}), "model 'oracle' is unknown; known are two-level, best"),
    "model without counts": (broken(model={"kind": "two-level", "settings": {}}), "model two-level: no 'counts'"),
    "unknown setting": (broken(model={"kind": "two-level", "settings": {"x": 1}}), "unexpected keyword argument 'x'"),
    "unknown effect": (broken(effects=[{"kind": "magic"}]), "effect kind 'magic' is unknown"),
    "effect no object": (broken(effects=["magic"]), "effect"),
    "odd provenance": (broken(provenance={"x": 1}), "provenance"),
    "lane width 0": (broken(lane_width=0), "lane width 0"),
    "lane width 1e9": (broken(lane_width=1e9), r"lane width 1000000000\.0 m, expected above 0, at most 10 m"),
    "no name": (broken(name=""), "needs a name"),
}


@pytest.mark.parametrize("case", BAD)
def test_broken_files_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    text, message = BAD[case]
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=message) as caught:
        read_profile(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["none.json", "folder/none", "."])
def test_a_path_without_a_file_is_told_in_our_words(tmp_path: Path, name: str) -> None:
    with pytest.raises(FormatError, match="no such file" if name != "." else "is a folder, not a profile") as caught:
        read_profile(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path))


def test_canonical_json_is_plain_json() -> None:
    value = {"a": [1, 2.5, None, True], "b": {"c": [], "d": {}}, "e": [[1, 2], [3]], "f": "ä\n"}
    assert json.loads(canonical_json(value)) == value
    with pytest.raises(ValueError, match="nan"):
        canonical_json([float("nan")])
