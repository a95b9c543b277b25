"""Drives on the model's grid: room around each, offsets where road-following, context throughout."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import next_fast_len

from xosc_lateral.drivers.drives.drive import STEP, CutRules, Drive
from xosc_lateral.extras.loop.gridding import circular_columns, grid_drives

PAD, MULTIPLE = 75, 5
RULES = CutRules()


def drive(seconds: float, *, step: float = STEP, start: float = 0.0, levels: frozenset[str] = frozenset(),
          **context: np.ndarray) -> Drive:  # fmt: skip
    """Straight lines in time, which every linear way of resampling keeps."""
    time = start + np.arange(0.0, seconds + 1e-9, step)
    held = {"speed": np.full(len(time), 30.0), **context}
    return Drive("made", time, 0.3 - 0.002 * time, np.full(len(time), 3.6), held, levels)


@pytest.mark.parametrize("step", [0.04, 0.1, 0.2])
@pytest.mark.parametrize("start", [-3.07, 0.0, 1234.56])
def test_a_straight_drift_comes_out_on_the_drives_own_clock(step: float, start: float) -> None:
    (part,), _ = grid_drives([drive(60.0, step=step, start=start)], RULES, pad=PAD, multiple=MULTIPLE)
    np.testing.assert_allclose(np.diff(part.time), STEP, atol=1e-9)
    assert part.time[PAD] == start
    np.testing.assert_allclose(part.offset[part.valid], 0.3 - 0.002 * part.time[part.valid], atol=1e-9)
    assert part.valid.sum() == pytest.approx(60.0 / STEP + 1, abs=1)


@given(st.lists(st.floats(11.0, 40.0), min_size=1, max_size=4), st.integers(1, 7), st.integers(0, 80))
def test_rows_are_multiples_and_their_sum_is_quick_to_transform(lengths: list[float], multiple: int, pad: int) -> None:
    parts, _ = grid_drives([drive(seconds) for seconds in lengths], RULES, pad=pad, multiple=multiple)
    assert all(len(part) % multiple == 0 for part in parts)
    coarse = sum(map(len, parts)) // multiple
    assert coarse == next_fast_len(coarse, real=True)
    for part in parts:
        inside = np.flatnonzero(part.valid)
        assert inside[0] >= pad
        assert len(part) - 1 - inside[-1] >= pad
        assert not part.offset[~part.valid].any()


def test_pads_hold_the_outermost_value_and_nothing_is_driven_there() -> None:
    speed = np.linspace(20.0, 40.0, 301)
    (part,), _ = grid_drives([drive(60.0, speed=speed)], RULES, pad=PAD, multiple=MULTIPLE)
    assert not part.valid[:PAD].any()
    assert set(part.context["speed"][:PAD]) == {part.context["speed"][PAD]}
    assert set(part.context["speed"][-PAD:]) == {part.context["speed"][-1]}
    assert part.context["speed"][-1] == pytest.approx(40.0, abs=0.1)


def test_levels_and_directions_are_never_averaged_other_columns_are() -> None:
    """At 25 Hz, five rows a step: a switch's mean would be none of its levels, a direction's across north is south."""
    time = np.arange(0.0, 80.0 + 1e-9, 0.04)
    switch, heading = (time % 7.0 > 3.5).astype(float), (20.0 * time) % 360.0
    made = drive(80.0, step=0.04, levels=frozenset({"wipers"}), wipers=switch, heading=heading, rain=switch)
    (part,), periods = grid_drives([made], RULES, pad=PAD, multiple=MULTIPLE)
    assert periods == {"heading": 360.0}
    assert set(part.context["wipers"]) == {0.0, 1.0}
    assert np.isin(part.context["heading"], heading).all()
    assert ((part.context["rain"] > 0.1) & (part.context["rain"] < 0.9)).any()


def test_a_circle_is_one_only_if_every_drive_has_it_and_none_calls_it_levels() -> None:
    heading = (20.0 * np.arange(0.0, 80.0 + 1e-9, STEP)) % 360.0
    full = drive(80.0, heading=heading)
    assert circular_columns([full, full]) == {"heading": 360.0}
    assert circular_columns([full, drive(80.0)]) == {}
    assert circular_columns([full, drive(80.0, heading=heading, levels=frozenset({"heading"}))]) == {}


def test_a_lane_change_is_no_road_following_but_its_context_stays() -> None:
    lane = np.where(np.arange(401) < 200, 1.0, 2.0)
    made = drive(80.0, lane_index=lane, levels=frozenset({"lane_index"}))
    (part,), _ = grid_drives([made], RULES, pad=PAD, multiple=MULTIPLE)
    moment = (part.time > 40.0 - RULES.lane_change_margin + STEP) & (part.time < 40.0 + RULES.lane_change_margin - STEP)
    assert not part.valid[moment].any()
    assert np.isfinite(part.context["speed"]).all()


def test_each_run_is_resampled_from_its_own_rows() -> None:
    """Where an import has cut the drive, the next row may be in another lane; nothing of it may ring into the run."""
    time = np.arange(0.0, 80.0 + 1e-9, 0.04)
    run = (time >= 40.0).astype(np.int64)
    context = {"speed": np.full(len(time), 30.0)}
    made = Drive("made", time, np.where(run == 0, 1.7, -1.7), np.full(len(time), 3.6), context, run=run)
    (part,), _ = grid_drives([made], RULES, pad=PAD, multiple=MULTIPLE)
    assert part.valid.sum() > 395  # up to the very cut
    np.testing.assert_allclose(part.offset[part.valid & (part.time < 39.9)], 1.7, atol=1e-12)
    np.testing.assert_allclose(part.offset[part.valid & (part.time > 40.1)], -1.7, atol=1e-12)


def test_a_drive_without_road_following_is_left_out() -> None:
    slow = drive(60.0, speed=np.full(301, 5.0))
    parts, _ = grid_drives([slow, drive(60.0)], RULES, pad=PAD, multiple=MULTIPLE)
    assert len(parts) == 1
    assert grid_drives([slow], RULES, pad=PAD, multiple=MULTIPLE) == ([], {})
