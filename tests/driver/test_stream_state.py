"""States of streams as files: sealed, refused when damaged, read from version 0.1."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from tests.driver.certified import FOLDER
from tests.driver.models.made_models import POPULATION
from xosc_lateral.driver.effects import Drift
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.stream import OffsetStream
from xosc_lateral.driver.stream_state import FORMAT, VERSION, sealed, upgraded
from xosc_lateral.driver.stream_state_1 import from_version_1
from xosc_lateral.errors import DriverProfileError
from xosc_lateral.formats.profiles import read_profile

PROFILE = DriverProfile(name="own", model=POPULATION, effects=(Drift(size=0.1),))


@pytest.fixture(scope="module")
def state() -> dict[str, Any]:
    stream = OffsetStream(PROFILE, 3)
    for _ in range(7):
        stream.step({"speed": 30.0})
    return json.loads(json.dumps(stream.to_dict()))  # type: ignore[no-any-return]


def old(name: str = "best-effects") -> tuple[dict[str, Any], DriverProfile]:
    return json.loads((FOLDER / f"{name}.state.json").read_text()), read_profile(FOLDER / f"{name}.json")


def test_a_seal_holds_whatever_the_order_and_layout_of_the_file(state: dict[str, Any]) -> None:
    backwards = dict(reversed(list(state.items())))
    assert upgraded(backwards, PROFILE) == upgraded(state, PROFILE)
    assert not {"format", "version", "sha256"} & set(upgraded(state, PROFILE))


def test_sealing_says_format_version_and_a_hash_of_all() -> None:
    one, other = sealed({"row": 1}), sealed({"row": 2})
    assert (one["format"], one["version"]) == (FORMAT, VERSION)
    assert len(one["sha256"]) == 64
    assert one["sha256"] != other["sha256"]


@pytest.mark.parametrize("name", ["row", "time", "known", "widths", "process", "seed"])
def test_every_part_is_under_the_seal(state: dict[str, Any], name: str) -> None:
    damaged = {**state, name: None if state[name] is not None else 1}
    with pytest.raises(DriverProfileError, match="damaged: its sha256 is another"):
        upgraded(damaged, PROFILE)
    without = {key: value for key, value in state.items() if key != name}
    with pytest.raises(DriverProfileError, match="damaged"):
        upgraded(without, PROFILE)


@pytest.mark.parametrize("values", [{}, {"format": "another"}, [], None], ids=str)
def test_what_is_no_state_is_refused(values: Any) -> None:
    with pytest.raises(DriverProfileError, match="not a state of an offset stream"):
        upgraded(values, PROFILE)


def test_a_newer_state_asks_for_a_newer_package(state: dict[str, Any]) -> None:
    with pytest.raises(DriverProfileError, match="newer version"):
        upgraded({**state, "version": VERSION + 1}, PROFILE)


def test_a_state_of_0_1_belongs_to_its_profile_alone() -> None:
    values, profile = old()
    with pytest.raises(DriverProfileError, match=f"another profile than {PROFILE.name}"):
        from_version_1(values, PROFILE)
    assert from_version_1(values, profile)["seed"] == values["seed"]


def test_a_state_of_0_1_is_not_changed_by_being_read() -> None:
    values, profile = old()
    before = deepcopy(values)
    from_version_1(values, profile)
    assert values == before


def test_a_state_of_0_1_from_before_the_start_has_no_core_yet() -> None:
    values, profile = old("two-level-bare")
    values["movement"] = {**values["movement"], "core": None}
    assert from_version_1(values, profile)["process"]["core"] is None


def test_a_state_read_from_0_1_is_sealed_anew_and_goes_on_alike() -> None:
    values, profile = old("two-level-bare")
    first = OffsetStream.from_dict(profile, values)
    second = OffsetStream.from_dict(profile, json.loads(json.dumps(first.to_dict())))
    steps = [[stream.step({"speed": 30.0}) for _ in range(60)] for stream in (first, second)]
    np.testing.assert_array_equal(steps[0], steps[1])


def test_what_is_only_told_about_a_profile_does_not_matter_to_its_states(state: dict[str, Any]) -> None:
    renamed = replace(PROFILE, name="another name")
    OffsetStream.from_dict(renamed, state)
    wider = replace(PROFILE, lane_width=3.5)
    with pytest.raises(DriverProfileError, match="another profile"):
        OffsetStream.from_dict(wider, state)
