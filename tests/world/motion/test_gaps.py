"""Distances between boxes, against hand-made cases and a brute-force sampling of the boxes' edges."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.motion import box_path
from xosc_lateral.world.motion.gaps import box_distance, corners, smallest_gaps
from xosc_lateral.world.motion.nominal import EntityMotion


def _box(x: float, y: float, heading: float = 0.0, length: float = 5.0, width: float = 2.0) -> EntityMotion:
    return box_path(np.zeros(1), np.array([x]), np.array([y]), np.array([heading]), length, width, 0.0)


def _corners(box: EntityMotion) -> np.ndarray:
    return corners([(box, np.arange(len(box.x)))])


def _edge_points(corners: np.ndarray, share: np.ndarray) -> np.ndarray:
    return np.concatenate([p + share * (q - p) for p, q in zip(corners, np.roll(corners, -1, 0), strict=True)])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (_box(10.0, 0.0), 5.0),
        (_box(0.0, 3.5), 1.5),
        (_box(8.0, 6.0), 5.0),
        (_box(10.0, 0.0, np.pi / 2), 6.5),
        (_box(4.9, 1.9), 0.0),
        (_box(0.0, 0.0, 0.3, 1.0, 0.5), 0.0),
        (_box(0.0, 0.0, np.pi / 2, 20.0, 0.5), 0.0),
    ],
    ids=["ahead", "beside", "diagonal", "across", "overlapping corners", "one inside the other", "crossing"],
)
def test_distance_of_hand_made_boxes(other: EntityMotion, expected: float) -> None:
    assert box_distance(_corners(_box(0.0, 0.0)), _corners(other))[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.pages
def test_distance_of_random_boxes_is_that_between_points_on_their_edges() -> None:
    rng = np.random.default_rng(5)
    share = np.linspace(0.0, 1.0, 400)[:, None]
    for _ in range(30):
        a = _box(0.0, 0.0, rng.uniform(0, 6), rng.uniform(2, 18), rng.uniform(1, 3))
        b = _box(rng.uniform(12, 20), rng.uniform(12, 20), rng.uniform(0, 6), rng.uniform(2, 8), rng.uniform(1, 3))
        edges = [_edge_points(_corners(box)[0], share) for box in (a, b)]
        brute = np.linalg.norm(edges[0][:, None] - edges[1][None], axis=-1).min()
        assert box_distance(_corners(a), _corners(b))[0] == pytest.approx(brute, abs=2e-3)


def test_the_smallest_gap_names_pair_and_moment_and_absent_vehicles_do_not_count() -> None:
    time = np.linspace(0.0, 10.0, 101)
    still, zero = np.zeros_like(time), np.zeros_like(time)
    coming = np.linspace(60.0, 10.0, 101)
    a = box_path(time, still, zero, zero, 4.0, 2.0, 0.0, name="a")
    b = box_path(time, coming, zero, zero, 4.0, 2.0, 1.0, name="b")
    gone = box_path(time, np.where(time < 5.0, np.nan, 300.0), zero, zero, 4.0, 2.0, 0.0, name="gone")
    (gap,) = smallest_gaps([a, b, gone])
    assert gap.names == ("a", "b")
    assert gap.distance == pytest.approx(7.0)
    assert gap.time == pytest.approx(10.0)
