"""One column, one finding: a course over time is found where there is no gain, and takes a simpler term's place."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.passage import BEFORE_S, typical_passage
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, Selection, select
from xosc_lateral.extras.loop.terms.mean import CourseTerm, MeanTerm
from xosc_lateral.extras.loop.timeline import Coarse

SECONDS, SIZE = 1500.0, 0.08


def bends(rng: np.random.Generator, n: int) -> np.ndarray:
    """Of 8 s and more, between straights, to both sides, with ramps of 3 s."""
    time, at, column = STEP * np.arange(n), 20.0, np.zeros(n)
    while at < SECONDS:
        length = rng.uniform(8.0, 20.0)
        column += rng.choice([-1.0, 1.0]) * np.clip(np.minimum((time - at) / 3.0, (at + length - time) / 3.0), 0.0, 1.0)
        at += length + rng.uniform(8.0, 40.0)
    return column


def drive(seed: int, gain: float) -> Coarse:
    """Out before a bend and back 3 s after it has begun; and with a gain, to one side as long as it lasts."""
    rng = np.random.default_rng(seed)
    n = round(SECONDS / STEP)
    x, idle = bends(rng, n), wander(rng, n, 10.0)
    course = np.roll(x, -round(1.5 / STEP)) - np.roll(x, round(3.0 / STEP))
    return coarse_of(SIZE * course + gain * x + movement(rng, SECONDS), {"x": x, "idle": idle})


def selected(coarse: Coarse) -> Selection:
    columns = [Column(name, Values.NUMBER, False) for name in ("idle", "x")]
    with threadpool_limits(1, user_api="blas"):
        return select(Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET))


@pytest.fixture(scope="module")
def entry() -> Selection:
    return selected(drive(41, 0.0))


def test_a_response_to_entry_and_exit_alone_is_found(entry: Selection) -> None:
    (one,) = entry.accepted
    assert isinstance(one.term, CourseTerm)
    assert one.term.columns == ("x",)
    assert one.p_value < ERROR_BUDGET["course"]


def test_its_size_is_what_the_car_does_in_a_bend(entry: Selection) -> None:
    ((key, (term, effects)),) = entry.final.estimates.items()
    described = term.describe(entry.final, effects, key)
    passage = described.passage
    assert passage is not None
    assert abs(described.size_m) == pytest.approx(SIZE, abs=2.5 * described.size_error)
    # out before the bend's middle, and to the other side after its end
    assert passage.path[round(BEFORE_S) + 1] * passage.path[round(BEFORE_S + passage.lasts_s) + 4] < 0.0


def test_the_profiles_effect_does_what_the_fit_says(entry: Selection) -> None:
    ((_, (_term, effects)),) = entry.final.estimates.items()
    effect = effects[0]
    assert isinstance(effect, Linear) and effect.course
    coarse = entry.final.coarse
    sampled = effect.strength(STEP, coarse.context)
    assert sampled is not None
    inside = coarse.timeline.valid
    assert np.corrcoef(sampled[inside], coarse.strength(effect)[inside])[0, 1] == pytest.approx(1.0, abs=1e-3)


def test_a_column_is_found_once_whatever_it_does() -> None:
    found = selected(drive(43, 0.15))
    assert [one.term.columns for one in found.accepted].count(("x",)) == 1
    assert all(isinstance(one.term, MeanTerm) for one in found.accepted)


def test_a_typical_passage_is_as_high_and_as_long_as_bends_are() -> None:
    passage = typical_passage(drive(47, 0.0), Linear(acts=Acts.LOCATION, column="x"))
    assert (passage.usual, passage.high) == (0.0, 1.0)
    assert 8.0 < passage.lasts_s < 17.0
    assert np.flatnonzero(passage.column)[0] * STEP == pytest.approx(BEFORE_S, abs=0.3)
