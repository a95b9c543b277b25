"""A profile: what it must say, what its offsets depend on, the same after a file."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import pytest
from msgspec.structs import replace

from tests.kit.core_models import POPULATION
from tests.kit.schema import profile_schema
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Acts, Drift, Linear
from xosc_lateral.drivers.model.profile import (
    MAX_LANE_WIDTH,
    DriverProfile,
    Metadata,
    Provenance,
    sampling_hash,
)
from xosc_lateral.drivers.model.sensor import SensorModel

LINE = Linear(acts=Acts.LOCATION, column="grade", coefficients=(0.05,), errors=(0.01,), reference=(0.0,))
BARE = DriverProfile(name="bare", model=POPULATION)
FULL = DriverProfile(
    name="full",
    model=POPULATION,
    effects=(LINE, Drift(size=0.12)),
    lane_width=3.5,
    provenance=Provenance(source="made", hours=1.5, drives=3, runs=9, inputs={"a.csv": "0" * 64}),
    metadata=Metadata(version="2", tags=("truck", "night")),
    sensor=SensorModel(white=1e-4),
    left_hand=True,
)


@pytest.mark.parametrize("profile", [BARE, FULL], ids=lambda profile: profile.name)
def test_a_profile_comes_back_from_its_file(profile: DriverProfile) -> None:
    values = json.loads(json.dumps(profile.to_dict(), allow_nan=False))
    assert DriverProfile.from_dict(values).to_dict() == profile.to_dict()


@pytest.mark.parametrize("profile", [BARE, FULL], ids=lambda profile: profile.name)
def test_a_profile_is_valid_by_the_schema(profile: DriverProfile) -> None:
    jsonschema.validate(json.loads(json.dumps(profile.to_dict())), profile_schema())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"id": ""}, "needs a name"),
        ({"lane_width": 0.0}, "lane width 0.0 m, expected above 0"),
        ({"lane_width": MAX_LANE_WIDTH + 1.0}, "at most 10 m"),
        ({"lane_width": "wide"}, "lane_width: expected 'float', got 'str'"),
        ({"colour": "red"}, "unknown field 'colour'"),
        ({"effects": [{"kind": "psychic"}]}, r"effects\[0\]: unknown kind 'psychic'; known are adapted, angular"),
        ({"model": {"kind": "crystal-ball"}}, "model: unknown kind 'crystal-ball'"),
        ({"provenance": {"hours": -1.0}}, "provenance.hours"),
        ({"metadata": {"mood": "good"}}, "metadata: unknown field 'mood'"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_is_wrong_in_a_file_is_named_with_its_place(change: dict[str, Any], message: str) -> None:
    with pytest.raises(DriverProfileError, match=message):
        DriverProfile.from_dict(FULL.to_dict() | change)


def test_a_right_hand_profile_says_nothing_of_its_hand() -> None:
    assert "left_hand" not in BARE.to_dict()
    assert FULL.to_dict()["left_hand"] is True


def test_columns_are_those_of_all_effects_once() -> None:
    twice = BARE.with_effects(LINE, LINE)
    assert twice.columns == ("grade",)
    assert BARE.columns == ()


def test_effects_are_added_behind_those_there_and_the_profile_itself_stays() -> None:
    more = FULL.with_effects(LINE, name="more")
    assert [effect.kind for effect in more.effects] == ["linear", "drift", "linear"]
    assert (more.name, FULL.name, len(FULL.effects)) == ("more", "full", 2)


def test_what_is_only_told_changes_no_offset_and_what_is_sampled_does() -> None:
    told = replace(FULL, name="x", metadata=Metadata(), provenance=Provenance(), sensor=None)
    assert sampling_hash(told) == sampling_hash(FULL)
    for changed in (
        replace(FULL, lane_width=3.6),
        replace(FULL, effects=()),
        replace(FULL, effects=FULL.effects[::-1]),
    ):
        assert sampling_hash(changed) != sampling_hash(FULL)


def test_it_introduces_itself_in_a_line() -> None:
    assert repr(FULL) == "<DriverProfile full: autoregressive, 2 effects, 1.5 h of 3 drives>"
    assert repr(BARE.with_effects(LINE)) == "<DriverProfile bare: autoregressive, 1 effect, 0 h of 0 drives>"
