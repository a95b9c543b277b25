"""Ways over random nets of roads against scipy's shortest paths, which know nothing of roads."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import shortest_path

from xosc_lateral.world.road.links import End
from xosc_lateral.world.road.routes import Routes

ROADS = 14


class _Road:
    def __init__(self, length: float) -> None:
        self.length = length


class Net(Routes):
    """Roads between crossings, at which whoever arrives may enter every road but the one that he comes from.

    Parameters
    ----------
    ends : array of int, shape (n, 2)
        Crossing at each road's start and at its end.
    lengths : array, shape (n,)
        [m]
    """

    def __init__(self, ends: np.ndarray, lengths: np.ndarray) -> None:
        self.ends, self.roads = ends, [_Road(float(length)) for length in lengths]

    def next_roads(self, road: int, direction: int) -> tuple[End, ...]:
        here, others = self.ends[road, 1 if direction > 0 else 0], [one for one in range(len(self.ends)) if one != road]
        return tuple((one, entry) for entry, end in ((1, 0), (-1, 1)) for one in others if self.ends[one, end] == here)

    def entered(self, road: int, way: int) -> np.ndarray:
        """Way [m] from where a road is left to where every road is entered, from its start and from its end."""
        number = {(index, entry): 2 * index + (entry < 0) for index in range(len(self.ends)) for entry in (1, -1)}
        size = len(number)
        cost = np.zeros((size + 1, size + 1))
        for (index, entry), row in number.items():
            for end in self.next_roads(index, entry):
                cost[row, number[end]] = self.roads[index].length
        for end in self.next_roads(road, way):
            cost[size, number[end]] = 1.0  # scipy takes 0 for "no edge"
        return np.asarray(shortest_path(csr_matrix(cost), indices=size)[:size].reshape(-1, 2) - 1.0)


def net(seed: int) -> Net:
    rng = np.random.default_rng(seed)
    return Net(rng.integers(0, 7, size=(ROADS, 2)), rng.uniform(20.0, 300.0, size=ROADS))


def shortest(roads: Net, start: tuple[int, float], end: tuple[int, float]) -> float:
    """The same by scipy. [m]"""
    (road, s), (goal, goal_s) = start, end
    found = [abs(goal_s - s)] if road == goal else []
    for way in (1, -1):
        room = roads.roads[road].length - s if way > 0 else s
        from_start, from_end = roads.entered(road, way)[goal]
        found += [room + from_start + goal_s, room + from_end + roads.roads[goal].length - goal_s]
    return min(found)


@pytest.mark.parametrize("seed", range(8))
def test_the_way_is_the_shortest_there_is(seed: int) -> None:
    roads, rng = net(seed), np.random.default_rng([1, seed])
    lengths = [road.length for road in roads.roads]
    for _ in range(12):
        road, goal = (int(one) for one in rng.integers(0, ROADS, size=2))
        start, end = (road, rng.uniform(0.0, lengths[road])), (goal, rng.uniform(0.0, lengths[goal]))
        found, expected = roads.path_between(start, end), shortest(roads, start, end)
        if found is None:
            assert expected == np.inf
        else:
            assert abs(found.ds) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_the_way_that_is_told_is_linked_and_as_long_as_it_says(seed: int) -> None:
    roads, rng = net(seed), np.random.default_rng([2, seed])
    for _ in range(12):
        road, goal = (int(one) for one in rng.choice(ROADS, size=2, replace=False))
        s, goal_s = (rng.uniform(0.0, roads.roads[one].length) for one in (road, goal))
        found = roads.path_between((road, s), (goal, goal_s))
        if found is None:
            continue
        length, here = roads.roads[road].length - s if found.way > 0 else s, (road, found.way)
        for end in found.entered:
            assert end in roads.next_roads(*here)
            here, length = end, length + roads.roads[end[0]].length
        last, entry = here
        length -= roads.roads[last].length - goal_s if entry > 0 else goal_s
        assert last == goal
        assert found.ds == pytest.approx(length * found.way, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_there_and_back_is_as_far_and_turned_round_it_has_the_other_sign(seed: int) -> None:
    roads, rng = net(seed), np.random.default_rng([3, seed])
    for _ in range(12):
        road, goal = (int(one) for one in rng.choice(ROADS, size=2, replace=False))
        start, end = ((one, rng.uniform(0.0, roads.roads[one].length)) for one in (road, goal))
        there, back, turned = (
            roads.path_between(start, end),
            roads.path_between(end, start),
            roads.path_between(start, end, direction=-1),
        )
        if there is None:
            assert back is None and turned is None
            continue
        assert back is not None and turned is not None
        assert abs(back.ds) == pytest.approx(abs(there.ds), abs=1e-9)
        assert turned.ds == pytest.approx(-there.ds)


@pytest.mark.parametrize("seed", range(4))
def test_a_limit_lets_through_what_is_within_it_and_nothing_else(seed: int) -> None:
    roads, rng = net(seed), np.random.default_rng([4, seed])
    for _ in range(12):
        road, goal = (int(one) for one in rng.integers(0, ROADS, size=2))
        start, end = ((one, rng.uniform(0.0, roads.roads[one].length)) for one in (road, goal))
        free = roads.path_between(start, end)
        if free is not None:
            assert roads.path_between(start, end, limit=abs(free.ds) + 1e-6) == free
            assert roads.path_between(start, end, limit=abs(free.ds) - 1e-6) is None
