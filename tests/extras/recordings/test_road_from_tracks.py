"""A reference line out of planted traffic: an arc is found as that arc, and lanes are as far apart as they were."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.extras.recordings.lines_from_tracks import fit_reference_line
from xosc_lateral.world.road.geometry import simplify

RADIUS = 4000.0
"""[m]"""


def traffic(length: float, turned: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions on an arc to the left about the origin, way of travel, and distance from the middle, left positive."""
    rows = []
    for k in range(80):
        s = np.arange(0.0, length, 8.0) + 0.1 * k
        forward, d = k % 2 == 0, (-1.0 if k % 2 == 0 else 1.0) * (4.0 + 3.5 * (k % 4 // 2))
        s = s if forward else s[::-1]
        angle = turned + s / RADIUS
        x, y = (RADIUS - d) * np.cos(angle), (RADIUS - d) * np.sin(angle)
        rows.append(np.column_stack([x, y, np.full(len(s), forward), np.full(len(s), d), s]))
    table = np.concatenate(rows)
    return table[:, :2], table[:, 2].astype(bool), table[:, 3:]


@pytest.mark.parametrize("turned", [0.3, 2.5, 4.0])
def test_an_arc_comes_out_as_that_arc(turned: float) -> None:
    xy, forward, truth = traffic(3000.0, turned)
    line, s, d = fit_reference_line(xy, forward)
    inside = (truth[:, 1] > 300.0) & (truth[:, 1] < 2700.0)
    np.testing.assert_allclose(d[inside], truth[inside, 0], atol=0.06)  # within a bin of 20 m the arc lies across
    along = s[inside] - truth[inside, 1]
    assert np.ptp(along) < 0.5 and np.median(np.diff(s[forward][:50])) > 0.0
    np.testing.assert_allclose(line.curvature(np.linspace(700.0, 2300.0, 9)), 1.0 / RADIUS, rtol=0.02)
    back = line.place(s[inside], 0) + d[inside, None] * np.column_stack(
        [-line.place(s[inside], 1)[:, 1], line.place(s[inside], 1)[:, 0]]
    ) / np.linalg.norm(line.place(s[inside], 1), axis=1, keepdims=True)
    np.testing.assert_allclose(back, xy[inside], atol=1e-6)


def test_a_kilometre_in_both_directions_is_needed() -> None:
    xy, forward, _ = traffic(900.0, 0.0)
    with pytest.raises(NotEnoughDataError, match="1000 m are needed"):
        fit_reference_line(xy, forward)


def test_a_polyline_keeps_the_points_that_it_can_not_do_without() -> None:
    x, y = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), np.array([0.0, 0.01, 0.0, 1.0, 2.01, 3.0])
    assert simplify(x, y, 0.05).tolist() == [0, 2, 5]
    assert simplify(x, y, 0.001).tolist() == [0, 1, 2, 3, 4, 5]
    assert simplify(x, y, 9.0).tolist() == [0, 5]
    round_ = np.array([0.0, 1.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0, 0.0])
    assert simplify(*round_, 0.1).tolist() == [0, 1, 2, 3, 4]
