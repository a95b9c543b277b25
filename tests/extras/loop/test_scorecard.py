"""The ten metrics on held-out blocks: nothing for the same runs, much for others, a floor of the drives' own."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import movement, timeline_of
from xosc_lateral.drivers.evaluation.metrics import METRICS, snippet_metrics
from xosc_lateral.extras.loop.held_out import SNIPPET_ROWS, Scorecard, _starts, score_runs
from xosc_lateral.extras.loop.identify import hold_out_blocks
from xosc_lateral.extras.loop.timeline import Timeline

SECONDS = 1800.0


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    return timeline_of(movement(np.random.default_rng(1), SECONDS))


def runs(*scales: float, seed: int = 2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([scale * movement(rng, SECONDS) for scale in scales])


def scored(timeline: Timeline, before: np.ndarray, after: np.ndarray, seed: int = 3) -> Scorecard:
    return score_runs(timeline, before, after, hold_out_blocks(timeline), np.random.default_rng(seed))


def mean_of(distances: object) -> float:
    return float(distances.mean)  # type: ignore[attr-defined]


def test_snippets_stand_side_by_side_and_never_hold_a_gap() -> None:
    offset = np.zeros(2000)
    valid = np.ones(2000, dtype=bool)
    valid[500:520] = False
    timeline = timeline_of(offset, valid=valid)
    starts = _starts(timeline)
    assert all(timeline.valid[start : start + SNIPPET_ROWS].all() for start in starts)
    assert (np.diff(starts) >= SNIPPET_ROWS).all()
    longest = [(500 - 75) // SNIPPET_ROWS, (2000 - 75 - 520) // SNIPPET_ROWS]
    assert len(starts) == sum(longest)
    assert 520 in starts  # the next begins where the gap ends


def test_the_same_runs_before_and_after_are_as_far_away(timeline: Timeline) -> None:
    same = runs(1.0, 1.0)
    card = scored(timeline, same, same)
    assert card.before is not None
    assert mean_of(card.before) == mean_of(card.after)
    np.testing.assert_array_equal(card.sampled_before, card.sampled_after)


def test_runs_that_move_as_the_drives_do_are_near_the_floor_and_others_are_not(timeline: Timeline) -> None:
    card = scored(timeline, runs(2.0, 2.0), runs(1.0, 1.0))
    assert mean_of(card.after) < 2.0 * mean_of(card.floor)
    assert mean_of(card.before) > 3.0 * mean_of(card.floor)


def test_the_floor_knows_nothing_of_the_runs(timeline: Timeline) -> None:
    one, other = scored(timeline, runs(1.0), runs(1.0)), scored(timeline, runs(5.0, seed=9), runs(0.1, seed=8))
    assert mean_of(one.floor) == mean_of(other.floor)


def test_metrics_are_those_of_the_snippets(timeline: Timeline) -> None:
    card = scored(timeline, runs(1.0), runs(1.0))
    rows = _starts(timeline)[:, None] + np.arange(SNIPPET_ROWS)
    np.testing.assert_array_equal(card.real, snippet_metrics(timeline.offset[rows]))
    assert card.real.shape == (len(rows), len(METRICS))


def test_metres_or_centimetres_are_as_far_apart(timeline: Timeline) -> None:
    from dataclasses import replace

    before, after = runs(1.5), runs(1.0)
    larger = replace(timeline, offset=100.0 * timeline.offset)
    one, other = scored(timeline, before, after), scored(larger, 100.0 * before, 100.0 * after)
    assert mean_of(one.before) == pytest.approx(mean_of(other.before), rel=1e-9)


def test_too_few_snippets_score_nothing() -> None:
    short = timeline_of(np.zeros(500))  # 70 s within
    card = scored(short, np.zeros((1, 500)), np.zeros((1, 500)))
    assert (card.before, card.after, card.floor) == (None, None, None)
    assert card.real.shape == (0, len(METRICS))


def test_one_block_has_no_half_to_be_held_against() -> None:
    timeline = timeline_of(movement(np.random.default_rng(4), 400.0))  # shorter than three blocks
    card = scored(timeline, timeline.offset[None], timeline.offset[None])
    assert card.before is None
    assert len(card.real) >= 8
