"""Cells of summary statistics: a column that is constant within drives has as many as it has values."""

import numpy as np

from tests.identification.made_coarse import timeline_of
from xosc_lateral.identification.residual import statistics_of


def test_what_is_left_of_the_drive_before_is_no_cell_of_its_own() -> None:
    widths = np.array([3.6834, 3.8597, 3.6834, 3.8597, 3.8597, 3.6834])
    timeline = timeline_of(np.zeros(6 * 450), drives=6)
    statistics = statistics_of(timeline, {"lane_width": widths[timeline.drive]})
    assert len(statistics.middles["lane_width"]) == 2
    label = statistics.labels["lane_width"][timeline.valid]
    assert (np.unique(label, return_counts=True)[1] == 3 * 300).all()
    assert (label == (widths > 3.7)[timeline.drive][timeline.valid]).all()
