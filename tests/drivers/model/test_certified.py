"""Profiles give the offsets that they gave in version 0.1."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from tests.kit.certified import (
    FOLDER,
    KINDS,
    MODELS,
    RATE,
    SEED,
    START,
    STEPS_BEFORE_STATE,
    contexts,
    rows,
    segments,
)
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.files.profiles import read_profile

TOLERANCE = 1e-10
"""Another processor rounds otherwise; an atom is this wide. [m]"""

NAMES = [f"{model}-{kind}" for model in MODELS for kind in KINDS]


def load(name: str, what: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((FOLDER / f"{name}.{what}.json").read_text())
    return content


def profile_of(name: str) -> DriverProfile:
    return read_profile(FOLDER / f"{name}.json")


@pytest.mark.parametrize("start", ["free", "started"])
@pytest.mark.parametrize("name", NAMES)
def test_profiles_give_the_same_offsets(name: str, start: str) -> None:
    sampler = OffsetSampler(profile_of(name), SEED)
    first, second = segments()
    pieces = [sampler.sample(first, start=START if start == "started" else None), sampler.sample(second)]
    for piece, expected in zip(pieces, load(name, "offsets")[start], strict=True):
        np.testing.assert_allclose(piece, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("name", NAMES)
def test_streams_give_the_same_offsets_as_in_0_1(name: str) -> None:
    stream = OffsetStream(profile_of(name), SEED, rate=RATE, start=START, time=3.0)
    columns, ahead = rows(contexts(1000, 1.0 / RATE)), stream.preview_steps
    for context in columns[:ahead]:
        stream.look(context)
    offsets = [stream.step(context) for context in columns[ahead:]]
    expected = load(name, "offsets")
    np.testing.assert_allclose(offsets, [*expected["stream_before"], *expected["stream_after"]], rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("name", NAMES)
def test_streams_that_were_saved_go_on_where_they_were(name: str) -> None:
    stream = OffsetStream(profile_of(name), SEED, rate=RATE, start=START, time=3.0)
    columns, ahead = rows(contexts(1000, 1.0 / RATE)), stream.preview_steps
    for context in columns[:ahead]:
        stream.look(context)
    for context in columns[ahead : ahead + STEPS_BEFORE_STATE]:
        stream.step(context)
    again = OffsetStream.from_dict(profile_of(name), json.loads(json.dumps(stream.to_dict())))
    offsets = [again.step(context) for context in columns[ahead + STEPS_BEFORE_STATE :]]
    np.testing.assert_allclose(offsets, load(name, "offsets")["stream_after"], rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("name", ["two-level-effects", "best-effects", "best-paced"])
def test_streams_that_0_2_saved_go_on_where_they_were(name: str) -> None:
    stream = OffsetStream.from_dict(profile_of(name), load(name, "state"))
    columns, passed = rows(contexts(1000, 1.0 / RATE)), stream.preview_steps + STEPS_BEFORE_STATE
    offsets = [stream.step(context) for context in columns[passed:]]
    np.testing.assert_allclose(offsets, load(name, "offsets")["stream_after"], rtol=0, atol=TOLERANCE)
    again = OffsetStream.from_dict(profile_of(name), json.loads(json.dumps(stream.to_dict())))
    context = columns[-1]
    assert [again.step(context) for _ in range(700)] == [stream.step(context) for _ in range(700)]
