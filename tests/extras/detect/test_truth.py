"""Lane changes and lane keeping against planted ones."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.lane_tracks import LANE, WIDTH, lane_change, track
from xosc_lateral.extras.detect.tracks import STEP, moves_in_lane, truth_of

TIME = 0.1 * np.arange(600)


@pytest.mark.parametrize("side", [1, -1])
def test_a_planted_lane_change_has_its_moments_by_closed_form(side):
    begin, duration = 25.0, 6.0
    made = track(lane_change(TIME, begin, duration, side))
    (found,) = truth_of(made).changes
    assert found.side == side
    half_sine = duration / np.pi
    slow = half_sine * np.arcsin(0.1 / (0.5 * LANE / half_sine))  # until 0.1 m/s, by whose fall below it is cut
    crossing = half_sine * np.arccos(1.0 - 2.0 * (0.5 * LANE - 0.5 * WIDTH) / LANE)
    assert found.begin * STEP == pytest.approx(begin + slow, abs=0.15)
    assert found.crossing * STEP == pytest.approx(begin + crossing, abs=0.06)
    assert found.centre * STEP == pytest.approx(begin + 0.5 * duration, abs=0.11)
    assert found.end * STEP == pytest.approx(begin + duration - slow, abs=0.15)


def test_no_lane_keeping_within_a_second_of_a_lane_change_nor_at_the_ends():
    truth = truth_of(track(lane_change(TIME, 25.0, 6.0)))
    (found,) = truth.changes
    keeping = np.flatnonzero(truth.keeping)
    margin, edge = round(1.0 / STEP), round(2.0 / STEP)
    inside = (keeping >= found.begin - margin) & (keeping <= found.end + margin)
    assert not inside.any()
    assert keeping[0] == edge and len(truth.keeping) - keeping[-1] == edge + 1
    assert len(keeping) == len(truth.keeping) - 2 * edge - (found.end - found.begin + 2 * margin + 1)


def test_an_excursion_that_comes_back_is_neither_a_lane_change_nor_lane_keeping():
    out_and_back = lane_change(TIME, 20.0, 5.0) - lane_change(TIME, 25.0, 5.0)
    truth = truth_of(track(0.6 * out_and_back))
    assert truth.changes == ()
    assert not truth.keeping[round(23.0 / STEP) : round(27.0 / STEP)].any()
    assert truth.keeping[round(10.0 / STEP)] and truth.keeping[round(45.0 / STEP)]


def test_who_drives_slowly_keeps_no_lane():
    made = track(np.zeros(400))
    made = made.having(following=np.zeros(len(made), dtype=np.bool_))
    assert not truth_of(made).keeping.any()


def test_lane_centre_traffic_is_told_from_a_weave_of_centimetres():
    for lateral, moves in ((np.zeros(600), False), (lane_change(TIME, 25.0, 6.0), False), (0.05 * np.sin(TIME), True)):
        made = track(lateral)
        assert moves_in_lane(made, truth_of(made)) is moves
