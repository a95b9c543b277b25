"""States of streams as files: sealed, refused when damaged."""

from __future__ import annotations

import json
from typing import Any

import pytest
from msgspec.structs import replace

from tests.kit.core_models import POPULATION
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Drift
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.stream import FORMAT, VERSION, OffsetStream, sealed, unsealed

PROFILE = DriverProfile(name="own", model=POPULATION, effects=(Drift(size=0.1),))


@pytest.fixture(scope="module")
def state() -> dict[str, Any]:
    stream = OffsetStream(PROFILE, 3)
    for _ in range(7):
        stream.step({"speed": 30.0})
    return json.loads(json.dumps(stream.to_dict()))  # type: ignore[no-any-return]


def test_a_seal_holds_whatever_the_order_and_layout_of_the_file(state: dict[str, Any]) -> None:
    backwards = dict(reversed(list(state.items())))
    assert unsealed(backwards) == unsealed(state)
    assert not {"format", "version", "sha256"} & set(unsealed(state))


def test_sealing_says_format_version_and_a_hash_of_all() -> None:
    one, other = sealed({"row": 1}), sealed({"row": 2})
    assert (one["format"], one["version"]) == (FORMAT, VERSION)
    assert len(one["sha256"]) == 64
    assert one["sha256"] != other["sha256"]


@pytest.mark.parametrize("name", ["row", "time", "known", "widths", "process", "seed"])
def test_every_part_is_under_the_seal(state: dict[str, Any], name: str) -> None:
    damaged = {**state, name: None if state[name] is not None else 1}
    with pytest.raises(DriverProfileError, match="damaged: its sha256 is another"):
        unsealed(damaged)
    without = {key: value for key, value in state.items() if key != name}
    with pytest.raises(DriverProfileError, match="damaged"):
        unsealed(without)


@pytest.mark.parametrize("values", [{}, {"format": "another"}, [], None], ids=str)
def test_what_is_no_state_is_refused(values: Any) -> None:
    with pytest.raises(DriverProfileError, match="not a state of offset stream"):
        unsealed(values)


def test_a_state_of_another_version_is_refused(state: dict[str, Any]) -> None:
    with pytest.raises(DriverProfileError, match="another version"):
        unsealed({**state, "version": VERSION + 1})


def test_what_is_only_told_about_a_profile_does_not_matter_to_its_states(state: dict[str, Any]) -> None:
    renamed = replace(PROFILE, name="another name")
    OffsetStream.from_dict(renamed, state)
    wider = replace(PROFILE, lane_width=3.5)
    with pytest.raises(DriverProfileError, match="another profile"):
        OffsetStream.from_dict(wider, state)
