"""The index of near vehicles against looking at every pair."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from tests.kit.motion import box_path
from xosc_lateral.world.motion import gaps
from xosc_lateral.world.motion.gaps import smallest_gaps
from xosc_lateral.world.surroundings.around import stretches_within


def paths(count: int, seed: int, turn: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Points that wander along a line, some of them absent for a while."""
    rng = np.random.default_rng(seed)
    n = 300
    along = rng.uniform(0, 2000, count)[:, None] + np.cumsum(rng.normal(0.5, 1.0, (count, n)), axis=1)
    across = rng.uniform(-10, 10, count)[:, None] + np.cumsum(rng.normal(0, 0.05, (count, n)), axis=1)
    for k in range(0, count, 4):
        along[k, : int(rng.integers(n))] = np.nan
    along[1] = np.nan
    x, y = np.cos(turn) * along - np.sin(turn) * across, np.sin(turn) * along + np.cos(turn) * across
    return list(x), list(y)


@pytest.mark.parametrize("turn", [0.0, 0.8, 1.6])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_pair_that_comes_near_is_missing_and_few_others_are_there(seed: int, turn: float) -> None:
    x, y = paths(40, seed, turn)
    reach = 25.0
    near = {
        (a, b)
        for a, b in combinations(range(len(x)), 2)
        if np.nanmin([np.inf, *np.hypot(x[a] - x[b], y[a] - y[b])]) <= reach
    }
    stretches = [pairs for _, pairs in stretches_within(x, y, reach)]
    found = set().union(*stretches)
    assert near and near <= found
    assert all(pairs == sorted(pairs) for pairs in stretches)
    assert len(found) < 0.5 * len(x) * (len(x) - 1) / 2


def test_gaps_are_those_of_all_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    x, y = paths(25, 3, 0.3)
    time, turned = np.arange(300) / 50, np.full(300, 0.3)
    boxes = [box_path(time, x[k], y[k], turned, 4.0 + k % 9, 2.0, 1.0, name=f"v{k}") for k in range(len(x))]
    indexed = smallest_gaps(boxes)
    monkeypatch.setattr(
        gaps, "stretches_within", lambda x, y, reach: [(slice(0, len(x[0])), list(combinations(range(len(x)), 2)))]
    )
    assert indexed == smallest_gaps(boxes)
    assert len(indexed) > 5


def test_nobody_is_near_nobody() -> None:
    assert list(stretches_within([], [], 1.0)) == []
    assert list(stretches_within([np.zeros(3)], [np.zeros(3)], 1.0)) == []
