"""Import, reconstruction, detectors and fit know one answer to when a vehicle changes lanes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.lane_tracks import LANE, lane_change, track
from xosc_lateral.drivers.drives.drive import Drive, lane_change_rows
from xosc_lateral.extras.detect.tracks import truth_of
from xosc_lateral.extras.recordings.cuts import CutSettings, lane_changes

STEP = 0.1
TIME = STEP * np.arange(600)
BEGIN = 25.0


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("sway", [0.0, 0.25])
@pytest.mark.parametrize("duration", [3.0, 5.0, 8.0, 12.0, 16.0])
def test_whoever_asks_gets_the_same_lane_change(duration: float, sway: float, noise: float) -> None:
    y = lane_change(TIME, BEGIN, duration) + sway * np.sin(2.0 * np.pi * TIME / 9.0)
    y = y + noise * np.random.default_rng(1).normal(size=len(TIME))
    lane = np.round(y / LANE)
    offset, one = y - LANE * lane, np.zeros(len(TIME), dtype=np.int64)
    (detected,) = truth_of(track(y)).changes
    cut = TIME[lane_changes(y, offset, lane.astype(np.int64), one, STEP, CutSettings(margin=0.0))]
    left_out = TIME[lane_change_rows(Drive("a", TIME, offset, np.full(len(TIME), LANE)))]
    begin, end = (track(y).time[row] for row in (detected.begin, detected.end))
    assert cut[[0, -1]] == pytest.approx([begin, end], abs=0.7)
    assert left_out[0] <= cut[0] + 1e-9 and left_out[-1] >= cut[-1] - 1e-9
    assert np.diff(cut).max() < 1.5 * STEP, "the rest of the drive is lane keeping"
