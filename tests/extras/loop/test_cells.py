"""Cells of summary statistics: a column that is constant within drives has as many as it has values."""

import numpy as np
import pytest

from tests.kit.coarse import timeline_of
from xosc_lateral.drivers.model.effects import Acts, Linear, Proximity
from xosc_lateral.extras.loop.residual import statistics_of
from xosc_lateral.extras.loop.timeline import Coarse


def test_what_is_left_of_the_drive_before_is_no_cell_of_its_own() -> None:
    widths = np.array([3.6834, 3.8597, 3.6834, 3.8597, 3.8597, 3.6834])
    timeline = timeline_of(np.zeros(6 * 450), drives=6)
    statistics = statistics_of(timeline, {"lane_width": widths[timeline.drive]})
    assert len(statistics.middles["lane_width"]) == 2
    label = statistics.labels["lane_width"][timeline.valid]
    assert (np.unique(label, return_counts=True)[1] == 3 * 300).all()
    assert (label == (widths > 3.7)[timeline.drive][timeline.valid]).all()


def test_where_there_is_none_is_a_cell_of_its_own_and_nobody_within_reach_is_far_away() -> None:
    """A car in the left lane has no lane on its left; one in the right lane with nobody there has a distance."""
    n = 5 * 600
    distance = np.concatenate(
        [np.linspace(5.0, 195.0, n // 2), np.full(n // 4, np.inf), np.full(n - n // 2 - n // 4, np.nan)]
    )
    offset = np.where(np.isnan(distance), 0.3, np.where(np.isinf(distance), -0.2, 0.0))
    timeline = timeline_of(offset, {"left_distance": distance}, drives=1)
    statistics = statistics_of(timeline, {"left_distance": distance})
    label = statistics.labels["left_distance"]
    none = timeline.valid & np.isnan(distance)
    assert (
        np.isnan(statistics.middles["left_distance"][-1])
        and np.isfinite(statistics.middles["left_distance"][:-1]).all()
    )
    assert (label[none] == label.max()).all() and (label[timeline.valid & ~np.isnan(distance)] < label.max()).all()
    means = statistics.describe(timeline.offset, timeline.valid)["mean by left_distance"]
    assert means[-1] == pytest.approx(0.3) and means[-2] < -0.1 and means[0] == pytest.approx(0.0)


def test_infinity_stays_what_it_is_by_the_second() -> None:
    distance = np.concatenate([np.full(1500, 40.0), np.full(1500, np.inf)])
    coarse = Coarse.of(timeline_of(np.zeros(3000), {"left_distance": distance}))
    assert np.isposinf(coarse.context["left_distance"][1500:]).all()
    near = Proximity(acts=Acts.LOCATION, column="left_distance", scale=20.0)
    line = Linear(acts=Acts.LOCATION, column="left_distance")
    assert near.seen(coarse.context)[-1] == 0.0, "a limit far out"
    assert np.isnan(line.seen(coarse.context)[-1]), "a line has none: nothing changes there"
