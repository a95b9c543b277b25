"""Profile files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from msgspec.structs import replace

from tests.kit.profiles import simulated_profile
from tests.kit.schema import profile_schema
from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.drivers.model.effects import Acts, Drift, Linear
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.json_text import canonical_json
from xosc_lateral.files.profiles import (
    SCHEMA,
    SHIPPED,
    find_profile,
    list_profiles,
    profile_bytes,
    profile_hash,
    read_profile,
    write_profile,
)

SMALLEST = """{"format": "xosc-lateral driver profile", "version": 2, "id": "old", "model": {"kind": "two-level",
"settings": {"n_bins": 2}, "counts": [[5, 1], [1, 5]], "damping": [0.01, 0.0]}}"""
"""The least that a file has to say."""


@pytest.fixture(params=["two-level", "autoregressive"])
def profile(request: pytest.FixtureRequest) -> DriverProfile:
    effects = (
        Linear(acts=Acts.LOCATION, column="curvature", coefficients=(200.0,), errors=(1.0,), reference=(0.0,)),
        Drift(size=0.1),
    )
    return replace(simulated_profile(request.param), effects=effects)


@pytest.mark.pages
def test_reading_what_was_written_gives_the_same_bytes(profile: DriverProfile, tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    write_profile(profile, path)
    again = read_profile(path)
    assert profile_bytes(again) == path.read_bytes() == profile_bytes(profile)
    assert profile_hash(again) == profile_hash(profile)
    assert again.effects == profile.effects


def test_files_follow_the_schema(profile: DriverProfile) -> None:
    schema = json.loads(SCHEMA.read_text())
    assert schema == json.loads(json.dumps(profile_schema()))  # else: make schema
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(json.loads(profile_bytes(profile)), schema)


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.json")), ids=lambda path: path.stem)
def test_shipped_profiles_follow_the_schema_and_are_canonical(path: Path) -> None:
    jsonschema.validate(json.loads(path.read_text()), json.loads(SCHEMA.read_text()))
    profile = read_profile(path.stem)
    assert profile.name == path.stem
    assert profile.provenance.hours > 0
    assert profile.provenance.source
    assert profile.provenance.licence


def test_a_profile_that_says_the_least_is_read(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text(SMALLEST)
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
    values = json.loads(SMALLEST)
    for key, value in changes.items():
        if value is None:
            del values[key]
        else:
            values[key] = value
    return json.dumps(values)


def test_a_folder_that_is_not_there_is_no_library(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="nowhere: no such folder"):
        find_profile("motorway", [tmp_path / "nowhere"])


BAD = {
    "not JSON": ('{"format": \n oops', ":2: not JSON"),
    "NaN": (SMALLEST.replace("0.01", "NaN"), "NaN is not a number in JSON"),
    "deep": ("[" * 100_000, "levels of nesting: 100000, at most 64"),
    "a list": ("[]", "not a driver profile"),
    "other format": (broken(format="x"), "not a driver profile"),
    "newer": (broken(version=99), "file format 99; this version of xosc-lateral reads 2: update the package"),
    "no version": (broken(version=None), "file format None"),
    "no model": (broken(model=None), "no 'model'"),
    "unknown model": (
        broken(model={"kind": "oracle"}),
        "model: unknown kind 'oracle'; known are autoregressive, two-level",
    ),
    "model without counts": (broken(model={"kind": "two-level", "settings": {}}), "model: no 'counts'"),
    "unknown setting": (broken(model={"kind": "two-level", "settings": {"x": 1}}), "model.settings: unknown field 'x'"),
    "unknown effect": (
        broken(effects=[{"kind": "magic"}]),
        r"effects\[0\]: unknown kind 'magic'; known are adapted, ang",
    ),
    "effect no object": (broken(effects=["magic"]), r"effects\[0\]: expected 'object', got 'str'"),
    "unknown field": (broken(colour="red"), "unknown field 'colour'"),
    "unknown field of an effect": (
        broken(effects=[{"kind": "drift", "size": 0.1, "sise": 2}]),
        r"effects\[0\]: unknown field 'sise'",
    ),
    "unknown field of a model": (
        broken(model=json.loads(SMALLEST)["model"] | {"mood": 1}),
        "model: unknown field 'mood'",
    ),
    "text for a number": (broken(lane_width="3.5"), "lane_width: expected 'float', got 'str'"),
    "odd provenance": (broken(provenance={"x": 1}), "provenance: unknown field 'x'"),
    "lane width 0": (broken(lane_width=0), "lane width 0"),
    "lane width 1e9": (broken(lane_width=1e9), r"lane width 1000000000\.0 m, expected above 0, at most 10 m"),
    "no name": (broken(id=""), "needs a name"),
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


def test_a_name_that_no_file_can_have_is_unknown():
    with pytest.raises(DriverProfileError, match="no profile has a name of 5000 characters"):
        read_profile("a" * 5000)


@pytest.mark.parametrize(("order", "is_read"), [(200, True), (201, False), (40_000, False)])
def test_the_order_of_a_model_is_limited(order: int, is_read: bool, tmp_path: Path) -> None:
    values = json.loads(find_profile("motorway-vehicle-1").read_text("utf-8"))
    values["model"]["coarse"]["coefficients"] = [0.5 / order] * order
    path = tmp_path / "p.json"
    path.write_text(json.dumps(values))
    if is_read:
        assert read_profile(path).model.coarse.order == order
        return
    with pytest.raises(FormatError, match=f"coefficients of an autoregression: {order}, at most 200"):
        read_profile(path)
