"""Drivers side by side are the drivers that each of them is alone."""

from __future__ import annotations

import json

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from tests.kit.profiles import REFINED
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.effects import Acts, Cycle, Drift, Linear
from xosc_lateral.drivers.model.group import OffsetGroup
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.workflows.profiles.profiles import read_profile

COLUMNS = ("speed", "is_truck", "lane_index", "left_distance", "right_distance", "acceleration")


def contexts(n: int, ticks: int, rng: np.random.Generator) -> list[dict[str, NDArray[np.float64]]]:
    """Traffic that changes from moment to moment, neighbours that come and go."""
    speed = 30.0 + np.cumsum(rng.normal(0.0, 0.05, (ticks, n)), axis=0)
    beside = np.where(rng.random((ticks, n)) < 0.3, np.inf, rng.uniform(0.0, 80.0, (ticks, n)))
    beside[rng.random((ticks, n)) < 0.1] = np.nan
    return [
        {
            "speed": speed[k],
            "is_truck": (np.arange(n) % 3 == 0).astype(float),
            "lane_index": (np.arange(n) % 2).astype(float),
            "left_distance": beside[k],
            "right_distance": beside[k][::-1].copy(),
            "acceleration": np.zeros(n),
        }
        for k in range(ticks)
    ]


def with_rate(profile: DriverProfile) -> DriverProfile:
    effect = Linear(
        acts=Acts.RATE, column="speed", coefficients=(0.02,), errors=(0.0,), reference=(30.0,), between_drivers=(0.01,)
    )
    return replace(profile, effects=(*profile.effects, effect))


@pytest.mark.parametrize("name", ["motorway", REFINED, "motorway-vehicle-1", "rate"])
def test_each_driver_is_the_stream_of_his_seed_whoever_comes_and_goes(name: str) -> None:
    profile = with_rate(read_profile("motorway-vehicle-1")) if name == "rate" else read_profile(name)
    ticks, n = 90, 5
    rows = contexts(n, ticks, np.random.default_rng(7))
    width = np.linspace(3.2, 3.9, n)
    group = OffsetGroup(profile, COLUMNS)
    seeds = [np.random.SeedSequence(3, spawn_key=(k,)) for k in range(n)]
    comes, goes = [0, 0, 0, 31, 60], [ticks, 47, ticks, ticks, ticks]
    streams = {k: OffsetStream(profile, seeds[k], rate=20.0) for k in range(n)}
    there: list[int] = []
    for tick, context in enumerate(rows):
        group.keep_present(np.array([goes[k] > tick for k in there], dtype=bool))
        there = [k for k in there if goes[k] > tick]
        new = [k for k in range(n) if comes[k] == tick]
        group.add([seeds[k] for k in new])
        there += new
        curves = group.advance({column: values[there] for column, values in context.items()}, width[there])
        for _ in range(tick % 3):  # whatever is drawn meanwhile
            group.draw_ahead()
        if tick == 50:  # through a file, and on
            state = json.loads(json.dumps(group.to_dict()))
            group = OffsetGroup(profile, COLUMNS)
            group.restore(state, [seeds[k] for k in there])
        for row, k in enumerate(there):
            own = {column: float(values[k]) for column, values in context.items()} | {"lane_width": float(width[k])}
            for quarter in range(4):
                wanted = streams[k].step(own)
                assert np.polyval(curves[row][::-1], quarter / 4) == pytest.approx(wanted, abs=1e-12), (tick, k)


def test_no_step_has_to_draw_what_was_drawn_between_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    group, drawn = OffsetGroup(read_profile("motorway-vehicle-1"), ()), list[int]()
    group.add([np.random.SeedSequence(3, spawn_key=(k,)) for k in range(3)])
    group.advance({}, np.full(3, 3.6))
    monkeypatch.setattr(group, "_draw_more", lambda k, draw=group._draw_more: (drawn.append(k), draw(k)))
    for _ in range(200):
        while group.draw_ahead():
            pass
        between = len(drawn)
        group.advance({}, np.full(3, 3.6))
        assert len(drawn) == between
    assert set(drawn) == {0, 1, 2}


def test_in_even_traffic_a_driver_has_the_offsets_that_are_sampled() -> None:
    profile = read_profile("motorway")
    segment = Segment.even(40.0, profile.model.step, 3.6, 28.0)
    seed = np.random.SeedSequence(11)
    group = OffsetGroup(profile, ("speed",))
    group.add([seed])
    found = [group.advance({"speed": np.array([28.0])}, np.array([3.6]))[0, 0] for _ in range(len(segment))]
    np.testing.assert_allclose(found, sample_offsets(profile, segment, seed), atol=1e-12, rtol=0.0)


def test_hidden_effects_are_those_that_are_sampled_bit_by_bit() -> None:
    """A factor that no hidden effect has is no factor of 1: rounding would differ."""
    profile = replace(
        read_profile("motorway"), effects=(Drift(size=0.1), Cycle(amplitude=0.05, period_s=12.0, coherence_s=300.0))
    )
    seed, segment = np.random.SeedSequence(2), Segment.even(60.0, profile.model.step, 3.6, 28.0)
    group = OffsetGroup(profile, ())
    group.add([seed])
    offsets = [group.advance({}, np.array([3.6]))[0, 0] for _ in range(len(segment))]
    np.testing.assert_array_equal(offsets, sample_offsets(profile, segment, seed))
