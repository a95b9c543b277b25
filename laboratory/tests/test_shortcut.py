"""The shortcut test finds a planted giveaway, and nothing where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from laboratory.shortcut import area, moments_of, told_before
from tests.kit.lane_tracks import lane_change, scene, track, weave
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, views_of

TIME = 0.1 * np.arange(1200)


@pytest.mark.parametrize("given_away", [True, False])
def test_a_driver_who_calms_down_before_a_lane_change_is_found(given_away):
    rng = np.random.default_rng(8)
    views = []
    for number in range(24):
        begin, movement = float(rng.uniform(40, 80)), np.zeros(len(TIME))
        for period in (6.0, 8.3, 11.9):
            movement += 0.1 * np.roll(weave(120.0, 1.0, period), int(rng.integers(100)))
        if given_away:
            movement *= 1.0 - 0.9 * np.exp(-(((TIME - begin + 2.0) / 3.0) ** 2))
        made = scene(track(movement + lane_change(TIME, begin, 5.0), name=f"v{number}"))
        views.append((made, views_of(made, PERFECT_SENSOR, 0)))
    written = {(f"v{number}", 1): [change.begin for change in found[0].truth.changes] for number, (_, found) in
               enumerate(views)}  # fmt: skip
    auc, low, high = told_before(moments_of(views, written))
    assert low < auc < high
    assert auc > 0.8 if given_away else 0.4 < auc < 0.65


def test_the_area_is_the_share_of_pairs_in_order():
    score, positive = np.array([0.1, 0.4, 0.35, 0.8]), np.array([False, False, True, True])
    assert area(score, positive) == pytest.approx(0.75)
    assert area(score, positive, np.array([1, 2, 1, 1])) == pytest.approx(4 / 6)
