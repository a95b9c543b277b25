"""Offsets one by one against the batch call."""

from __future__ import annotations

import json
import random
import tracemalloc
from collections import Counter
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.profiles import REFINED
from tests.kit.upsampled import upsample
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level
from xosc_lateral.drivers.model.effects import (
    EFFECTS,
    Acts,
    Adapted,
    ColumnEffect,
    Cycle,
    Drift,
    Effect,
    Levels,
    Linear,
    Nearness,
    Population,
    Regimes,
    Step,
    TimeSmooth,
    VarianceTrend,
)
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.stream import OffsetStream, sealed, unsealed
from xosc_lateral.files.profiles import read_profile

STEP = 0.2

COLUMNED: tuple[Effect, ...] = (
    Linear(
        column="curvature",
        acts=Acts.LOCATION,
        coefficients=(80.0,),
        errors=(1.0,),
        reference=(1e-4,),
        lag_s=-1.3,
        response_s=2.0,
    ),
    Nearness(
        column="lead_distance",
        scale=20.0,
        acts=Acts.SPREAD,
        coefficients=(0.4,),
        errors=(0.1,),
        reference=(0.1,),
        response_s=1.5,
    ),
    Levels(
        column="lane_index",
        levels=(1.0, 2.0),
        acts=Acts.FINE,
        coefficients=(0.3, -0.2),
        errors=(0.1, 0.1),
        reference=(0.3, 0.2),
    ),
    Linear(column="speed", acts=Acts.LOCATION, coefficients=(0.01,), errors=(0.01,), reference=(30.0,), lag_s=0.7),
)
HIDDEN: tuple[Effect, ...] = (
    Drift(size=0.1, correlation_s=120.0),
    Cycle(amplitude=0.05, period_s=12.0, coherence_s=300.0),
    Regimes(factor=1.8, fine_factor=1.5, on_s=20.0, off_s=60.0),
    Population(shift=0.1, log_spread=0.2, log_fine=0.1),
    VarianceTrend(factor=1.5, to_s=600.0),
    Step(size=0.2, at_s=130.0),
    Adapted(shift=-0.1, spread=1.2, rate=0.8, fine=1.5),
    TimeSmooth(location=(0.1, -0.05), location_errors=(0.02, 0.02), spread=(0.3,), spread_errors=(0.1,), to_s=300.0),
)
PACED: tuple[Effect, ...] = (
    Linear(column="speed", acts=Acts.RATE, coefficients=(0.03,), errors=(0.01,), reference=(30.0,), response_s=1.0),
)


def make_profile(*effects: Effect) -> DriverProfile:
    rng = np.random.default_rng(5)
    run = np.convolve(rng.normal(size=6000), np.ones(25) / 60.0, mode="same")
    return DriverProfile("made", fit_two_level([run]), effects, lane_width=3.6)


def make_contexts(n: int, step: float = STEP) -> dict[str, np.ndarray]:
    time = np.arange(n) * step
    lead = 60.0 + 40.0 * np.sin(time / 7.0)
    return {
        "speed": 30.0 + 4.0 * np.sin(time / 11.0),
        "lane_width": 3.5 + 0.2 * np.sin(time / 31.0),
        "curvature": 1e-3 * np.sin(time / 5.0),
        "lead_distance": np.where(lead > 80.0, np.nan, lead),
        "lane_index": np.floor(time / 20.0) % 3,
    }


def segment(columns: dict[str, np.ndarray], before: int = 0, after: int = 0, begin: float = 0.0) -> Segment:
    time = begin + np.arange(-before, len(columns["speed"]) - before) * STEP
    return Segment(time, columns["lane_width"], columns["speed"], columns, before, after)


def rows(columns: dict[str, np.ndarray]) -> list[dict[str, float]]:
    return [{name: float(values[row]) for name, values in columns.items()} for row in range(len(columns["speed"]))]


def drive(stream: OffsetStream, contexts: list[dict[str, float]]) -> np.ndarray:
    """All offsets for which the context is known far enough ahead."""
    ahead = stream.preview_steps
    for context in contexts[:ahead]:
        stream.look(context)
    return np.array([stream.step(context) for context in contexts[ahead:]])


@pytest.mark.parametrize("effects", [(), COLUMNED, HIDDEN, PACED, COLUMNED + HIDDEN + PACED], ids=lambda e: str(len(e)))
def test_the_stream_gives_the_batch_calls_offsets(effects: tuple[Effect, ...]) -> None:
    profile, columns = make_profile(*effects), make_contexts(1300)  # hidden effects: beyond two horizons
    offsets = drive(OffsetStream(profile, 7), rows(columns))
    expected = sample_offsets(profile, segment(columns), 7)[: len(offsets)]
    assert len(offsets) >= 1290
    np.testing.assert_allclose(offsets, expected, rtol=0, atol=1e-13)


def test_context_before_the_drive_and_a_start_count_as_in_the_batch_call() -> None:
    profile, columns = make_profile(*COLUMNED, *HIDDEN), make_contexts(400)
    contexts = rows(columns)
    stream = OffsetStream(profile, 3, start=0.31, time=50.0)
    for context in contexts[:120]:
        stream.recall(context)
    offsets = drive(stream, contexts[120:])
    expected = sample_offsets(profile, segment(columns, before=120, begin=50.0), 3, start=0.31)[: len(offsets)]
    assert offsets[0] == pytest.approx(0.31, abs=1e-9)
    np.testing.assert_allclose(offsets, expected, rtol=0, atol=1e-13)


def test_at_100_hz_it_gives_the_upsampled_batch_call() -> None:
    profile = make_profile(*COLUMNED, *HIDDEN)
    columns = make_contexts(20 * 300, 0.01)
    stream = OffsetStream(profile, 11, rate=100.0)
    assert stream.preview == pytest.approx(1.8)  # 1.3 s looked ahead, up to the next model step, and two samples
    offsets = drive(stream, rows(columns))
    coarse = {name: values[::20] for name, values in columns.items()}
    samples = sample_offsets(profile, segment(coarse), 11)
    expected = upsample(samples, 20)[: len(offsets)]
    np.testing.assert_allclose(offsets, expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(offsets[::20], samples[: len(offsets[::20])], rtol=0, atol=1e-13)


def test_the_curve_between_samples_has_continuous_speed_and_acceleration() -> None:
    samples = np.random.default_rng(0).normal(size=40)
    factor = 2000
    dense = upsample(samples, factor)
    np.testing.assert_array_equal(dense[::factor], samples)
    speed = np.diff(dense) * factor
    acceleration = np.diff(speed) * factor
    assert np.abs(np.diff(speed)).max() < 30.0 / factor
    assert np.abs(np.diff(acceleration)).max() < 400.0 / factor


def test_the_curve_follows_a_parabola_exactly() -> None:
    time = np.arange(20.0)
    dense = upsample(0.3 * time**2 - time, 10)
    fine = np.arange(len(dense)) / 10
    inside = slice(10, -10)  # the ends are continued in a straight line
    np.testing.assert_allclose(dense[inside], (0.3 * fine**2 - fine)[inside], atol=1e-12)


@pytest.mark.parametrize("rate", [5.0, 50.0])
@pytest.mark.parametrize("stop", [0, 133])
def test_a_saved_stream_goes_on_bit_by_bit(rate: float, stop: int) -> None:
    profile, contexts = make_profile(*COLUMNED, *HIDDEN, *PACED), rows(make_contexts(700, 1.0 / rate))
    whole = drive(OffsetStream(profile, 2, rate=rate), contexts)
    stream = OffsetStream(profile, 2, rate=rate)
    ahead = stream.preview_steps
    first = drive(stream, contexts[: ahead + stop])
    saved = json.loads(json.dumps(stream.to_dict()))
    again = OffsetStream.from_dict(profile, saved)
    rest = [again.step(context) for context in contexts[ahead + stop :]]
    np.testing.assert_array_equal(np.concatenate([first, rest]), whole)


def test_every_kind_of_effect_is_covered_here() -> None:
    assert {type(effect) for effect in HIDDEN} == {kind for kind in EFFECTS if not issubclass(kind, ColumnEffect)}
    for kind in EFFECTS:
        if issubclass(kind, ColumnEffect):  # the stream knows their quantity, and how they all respond to it
            assert (kind.response, kind.strength) == (ColumnEffect.response, ColumnEffect.strength)


@pytest.mark.parametrize("effects", [(), PACED, HIDDEN], ids=["bare", "paced", "hidden"])
def test_shipped_profiles_stream_and_go_on_like_the_batch_call(effects: tuple[Effect, ...]) -> None:
    profile = replace(read_profile("motorway"), effects=effects)
    assert profile.model.kind == "autoregressive"
    columns = make_contexts(500)
    contexts = rows(columns)
    stream = OffsetStream(profile, 9, start=0.2)
    first = [stream.step(context) for context in contexts[:201]]
    stream = OffsetStream.from_dict(profile, json.loads(json.dumps(stream.to_dict())))
    rest = [stream.step(context) for context in contexts[201:]]
    expected = sample_offsets(profile, segment(columns), 9, start=0.2)
    np.testing.assert_allclose([*first, *rest], expected, rtol=0, atol=1e-13)


def test_the_state_of_another_profile_is_refused() -> None:
    state = OffsetStream(make_profile(), 1).to_dict()
    with pytest.raises(DriverProfileError, match="another profile"):
        OffsetStream.from_dict(make_profile(Drift(size=0.1)), state)
    with pytest.raises(DriverProfileError, match="not a state"):
        OffsetStream.from_dict(make_profile(), {})


def test_a_state_that_is_not_what_was_written_is_refused() -> None:
    profile = make_profile(*HIDDEN)
    stream = OffsetStream(profile, 1)
    for _ in range(30):
        stream.step({"speed": 30.0})
    state = json.loads(json.dumps(stream.to_dict(), indent=1, sort_keys=True))
    OffsetStream.from_dict(profile, state)
    for name, value in (("row", state["row"] + 1), ("samples", []), ("process", None), ("sha256", "0" * 64)):
        with pytest.raises(DriverProfileError, match="damaged"):
            OffsetStream.from_dict(profile, {**state, name: value})
    for version in (3, "2", None, [2]):
        with pytest.raises(DriverProfileError, match="another version"):
            OffsetStream.from_dict(profile, {**state, "version": version})


def test_nothing_grows() -> None:
    profile, contexts = make_profile(*COLUMNED, *HIDDEN), rows(make_contexts(500))
    stream = OffsetStream(profile, 2, rate=50.0)
    for context in contexts:
        stream.step(context)
    size = len(json.dumps(stream.to_dict()))
    tracemalloc.start()
    for context in contexts:
        stream.step(context)
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(4):
        for context in contexts:
            stream.step(context)
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert after - before < 20_000
    assert len(json.dumps(stream.to_dict())) < 1.2 * size


def test_without_a_look_ahead_what_is_random_is_the_same() -> None:
    profile = make_profile(*COLUMNED)
    constant = {"speed": 30.0, "lane_width": 3.5, "curvature": 1e-3, "lead_distance": float("nan"), "lane_index": 0.0}
    stream = OffsetStream(profile, 4, rate=100.0)
    offsets = [stream.step(constant) for _ in range(2000)]
    columns = {name: np.full(100, value) for name, value in constant.items()}
    np.testing.assert_allclose(offsets[::20], sample_offsets(profile, segment(columns), 4), atol=1e-13)


def test_a_column_unknown_from_the_start_is_neutral_and_one_that_vanishes_an_error() -> None:
    profile = make_profile(*COLUMNED)
    stream = OffsetStream(profile, 1)
    plain = OffsetStream(make_profile(), 1)
    assert [stream.step({"lane_width": 3.5}) for _ in range(50)] == [plain.step({"lane_width": 3.5}) for _ in range(50)]
    stream = OffsetStream(profile, 1)
    stream.step({"speed": 30.0})
    with pytest.raises(ValueError, match="no 'speed', which the first one had"):
        stream.step({})


def test_wrong_use_is_refused() -> None:
    profile = make_profile(*COLUMNED)
    with pytest.raises(ValueError, match="rate 24 Hz, expected a whole multiple of the model's 5 Hz"):
        OffsetStream(profile, 1, rate=24.0)
    stream = OffsetStream(profile, 1)
    stream.look({})
    with pytest.raises(ValueError, match="given 1 steps, expected 7 or none"):
        stream.step({})
    stream = OffsetStream(profile, 1)
    stream.step({})
    with pytest.raises(ValueError, match="before the first `step`"):
        stream.look({})
    with pytest.raises(ValueError, match="lane_width -1"):
        stream.step({"lane_width": -1.0})


# ---- states that somebody edited and sealed anew ---------------------------------------------------------------------
ROAD_CONTEXT = {"speed": 30.0, "lane_width": 3.7, "lane_index": 1.0, "is_truck": 0.0, "left_distance": 20.0}


def _leaves(values: object, path: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
    items = values.items() if isinstance(values, dict) else enumerate(values[:4]) if isinstance(values, list) else ()
    below = [leaf for key, item in items for leaf in _leaves(item, (*path, key))]
    return below + ([path] if not isinstance(values, dict) else [])


@pytest.mark.pages
@pytest.mark.parametrize("rate", [None, 50.0])
def test_an_edited_state_is_refused_or_leads_to_offsets_of_a_lane(rate: float | None) -> None:
    profile, chance = read_profile(REFINED), random.Random(7)
    stream = OffsetStream(profile, 3, rate=rate)
    for _ in range(33):
        stream.step(ROAD_CONTEXT)
    whole = unsealed(stream.to_dict())
    leaves = [path for path in _leaves(whole) if path and path[0] != "profile"]
    outcomes = Counter[str]()
    for _ in range(30):
        values = json.loads(json.dumps(whole))
        *above, last = chance.choice(leaves)
        owner = values
        for key in above:
            owner = owner[key]
        old = owner[last]
        if isinstance(old, list):
            owner[last] = chance.choice([[], old[:-1], old + old, [None], [[]], [1e9] * len(old)])
        else:
            owner[last] = chance.choice([1e300, -1e6, 34.0, 10**30, 2**63, None, "x", -1, 0])
        try:
            edited = OffsetStream.from_dict(profile, sealed(values))
        except DriverProfileError:
            outcomes["refused"] += 1
            continue
        offsets = [edited.step(ROAD_CONTEXT) for _ in range(60)]
        assert np.abs(offsets).max() < 1.5 * 3.7, (above, last, owner[last])
        outcomes["fine"] += 1
    assert min(outcomes.values()) > 3


def test_a_state_of_a_driver_far_out_or_not_begun_goes_on() -> None:
    profile = read_profile("motorway")
    for stream, steps in ((OffsetStream(profile, 1, start=1.6), 1), (OffsetStream(profile, 1, rate=20.0), 0)):
        for _ in range(steps):
            stream.step(ROAD_CONTEXT)
        state = stream.to_dict()
        again = OffsetStream.from_dict(profile, sealed(unsealed(state)))
        assert [again.step(ROAD_CONTEXT) for _ in range(9)] == [stream.step(ROAD_CONTEXT) for _ in range(9)]


@pytest.mark.parametrize(
    "timing", [{"lag_s": -1e6}, {"response_s": 1e7}, {"course": ((1e6, 1.0),)}, {"course": ((0.0, 0.1),) * 500}]
)
def test_an_effect_that_looks_days_ahead_is_refused(timing: dict[str, Any]) -> None:
    with pytest.raises(DriverProfileError, match="at most"):
        Linear(acts=Acts.LOCATION, column="x", coefficients=(0.1,), errors=(0.1,), reference=(0.0,), **timing)
