"""Rings of moves beside the paths that they follow."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.world.motion.offset_chain import GRID, REST_TIME, Ring, closed, joints_of, ring_along

FRAME = 0.01


def followed(ring: Ring) -> np.ndarray:
    """One turn of a ring in a player's frames: each move stands still in the first and begins two after the last."""
    path = [ring.origin]
    for move in ring.moves:
        path += [path[-1]] * round((move.wait + REST_TIME) / FRAME)
        share = FRAME * np.arange(1, round(move.duration / FRAME) + 1) / move.duration
        path += (path[-1] + move.change * 0.5 * (1.0 - np.cos(np.pi * share))).tolist()
    return np.array(path)


def wandering(seed: int, seconds: float = 80.0) -> tuple[np.ndarray, np.ndarray]:
    """A path like a driver's: 15 cm within 20 s, 6 cm/s, nothing above 0.5 Hz."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, seconds, GRID)
    frequency = np.linspace(0.02, 0.5, 40)
    size = 0.05 / (1.0 + (frequency / 0.08) ** 2)
    phase = rng.uniform(0.0, 2 * np.pi, 40)
    return time, (size * np.cos(2 * np.pi * frequency * time[:, None] + phase)).sum(axis=1)


def test_moves_of_half_cosines_are_found_again() -> None:
    """Planted joints at the turns of a path made of moves: the same joints, the same places."""
    places, steps = [0.1, -0.2, 0.15, -0.05, 0.25, 0.1], [30, 25, 40, 20, 35]
    path = []
    for a, b, count in zip(places[:-1], places[1:], steps, strict=True):
        path += (a + (b - a) * 0.5 * (1.0 - np.cos(np.pi * np.arange(count) / count))).tolist()
    joints = joints_of(np.array(path))
    assert joints.tolist() == pytest.approx(np.append(0, np.cumsum(steps)[:-1]).tolist(), abs=1)


@pytest.mark.parametrize("from_middle", [False, True])
def test_a_ring_moves_as_the_path_does(from_middle: bool) -> None:
    """Over many paths: lateral speed within 5 %, acceleration at most a quarter more, fewer than 30 moves a minute."""
    sums, moves, seconds = np.zeros((2, 2)), 0, 0.0
    for seed in range(12):
        time, path = wandering(seed)
        ring = ring_along(time, path, from_middle=from_middle)
        turn = followed(ring)
        moves, seconds = moves + len(ring.moves), seconds + FRAME * len(turn)
        fine = np.interp(np.arange(0.0, GRID * (len(closed(path)) - 1), FRAME), time, path)
        for row, values in enumerate((turn, fine)):
            speed = np.gradient(values[:: round(0.1 / FRAME)], 0.1)
            sums[row] += np.mean(speed**2), np.mean(np.gradient(speed, 0.1) ** 2)
    ratio = np.sqrt(sums[0] / sums[1])
    assert 0.95 < ratio[0] < 1.05
    assert ratio[1] < 1.25
    assert moves / seconds < 30.0 / 60.0


def test_a_ring_leads_back_to_where_it_began_to_the_last_decimal() -> None:
    for seed in range(5):
        ring = ring_along(*wandering(seed), from_middle=True)
        assert round(sum(round(1e4 * move.change) for move in ring.moves)) == 0
        assert abs(ring.origin) < 0.02


def test_a_calm_driver_moves_on_a_small_scale() -> None:
    """A tenth of the movement is followed as well as all of it."""
    time, path = wandering(3)
    large, small = (ring_along(time, factor * path, from_middle=False) for factor in (1.0, 0.1))
    assert len(small.moves) == pytest.approx(len(large.moves), abs=2)
    assert [m.change for m in small.moves[:5]] == pytest.approx([0.1 * m.change for m in large.moves[:5]], abs=3e-3)


def test_a_path_that_does_not_move_has_no_moves() -> None:
    assert ring_along(np.arange(0.0, 20.0, GRID), np.full(200, 0.3), from_middle=False) == Ring(0.3, ())
