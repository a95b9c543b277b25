"""Cutting drives into runs, and bringing them to 5 Hz."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import PAPER_RULES, STEP, Drive, all_runs, average, cut_runs, resample, whole_run


def jittered(seconds: float, rate: float, rng: np.random.Generator) -> np.ndarray:
    time = np.arange(0.0, seconds, 1.0 / rate) + rng.uniform(-0.2, 0.2, int(np.ceil(seconds * rate))) / rate
    return np.delete(time, rng.choice(len(time), len(time) // 50, replace=False))


def drive(time: np.ndarray, offset: np.ndarray, **context: np.ndarray) -> Drive:
    levels = frozenset({"lane_index"} & context.keys())
    return Drive("d", time, offset, np.full(len(time), 3.5), context, levels)


@pytest.mark.parametrize("rate", [18.0, 20.0, 25.0, 50.0])
def test_slow_movement_passes_and_fast_movement_does_not_fold_back(rate: float) -> None:
    time = jittered(120.0, rate, np.random.default_rng(1))
    grid = np.arange(2.0, 118.0, STEP)
    inner = slice(10, -10)
    slow = resample(time, np.sin(2 * np.pi * 0.5 * time), grid)
    assert np.std((slow - np.sin(2 * np.pi * 0.5 * grid))[inner]) < 0.003
    for frequency in (3.0, 4.5):  # would show up at 2.0 and 0.5 Hz with a standard deviation of 0.7
        assert np.std(resample(time, np.sin(2 * np.pi * frequency * time), grid)[inner]) < 0.05
        even = np.arange(0.0, 120.0, 1.0 / rate)
        assert np.std(resample(even, np.sin(2 * np.pi * frequency * even), grid)[inner]) < 0.02


def test_a_straight_line_stays_straight_up_to_its_ends() -> None:
    time = jittered(30.0, 23.0, np.random.default_rng(2))
    grid = np.arange(time[0], time[-1], STEP)
    assert np.abs(resample(time, 0.3 - 0.02 * time, grid) - (0.3 - 0.02 * grid)).max() < 1e-9


def test_rows_at_5_hz_are_left_as_they_are() -> None:
    time = np.arange(100) * STEP + 7.3
    values = np.random.default_rng(3).normal(size=100)
    assert np.allclose(resample(time, values, time), values, atol=1e-12)


def test_a_context_that_appears_does_not_ring() -> None:
    time = np.arange(0.0, 20.0, 0.04)
    distance = np.where(time < 10.0, np.nan, 80.0)
    found = average(time, distance, np.arange(0.0, 19.8, STEP))
    assert np.isnan(found[:49]).all()
    assert np.allclose(found[51:], 80.0)
    far = average(time, np.where(time < 10.0, np.inf, 80.0), np.arange(0.0, 19.8, STEP))
    assert np.isposinf(far[:49]).all() and np.allclose(far[51:], 80.0), "nobody within reach is in no average"
    step = average(time, np.where(time < 10.0, 0.0, 80.0), np.arange(0.0, 19.8, STEP))
    assert step.min() >= 0.0
    assert step.max() <= 80.0


@pytest.mark.parametrize("how", ["lane_index", "jump"])
def test_lane_changes_are_cut_with_their_margin(how: str) -> None:
    time = np.arange(0.0, 60.0, 0.05)
    offset = np.where(time < 30.0, 0.4, -0.4) if how == "lane_index" else np.where(time < 30.0, 1.7, -1.7)
    context = {"lane_index": np.where(time < 30.0, 0.0, 1.0)} if how == "lane_index" else {}
    runs = cut_runs(drive(time, offset, **context))
    assert len(runs) == 2
    assert runs[0].time[-1] < 30.0 - PAPER_RULES.lane_change_margin + 0.06
    assert runs[1].time[0] > 30.0 + PAPER_RULES.lane_change_margin - 0.06
    assert all(len(set(run.offset.round(6))) == 1 for run in runs)  # nothing leaked across the cut


def test_slow_driving_and_gaps_end_a_run_and_short_gaps_do_not() -> None:
    time = np.arange(0.0, 100.0, 0.05)
    speed = np.where((time > 30.0) & (time < 40.0), 10.0, 30.0)
    keep = ~((time > 60.0) & (time < 61.0)) & ~((time > 80.0) & (time < 80.4))
    runs = cut_runs(drive(time[keep], np.zeros(keep.sum()), speed=speed[keep]))
    spans = [(run.time[0], run.time[-1]) for run in runs]
    assert np.allclose(spans, [(0.0, 30.0), (40.0, 60.0), (61.0, 99.95)], atol=STEP)
    assert all(np.allclose(np.diff(run.time), STEP) for run in runs)


def test_a_drive_without_speed_is_not_cut_for_speed() -> None:
    time = np.arange(0.0, 20.0, 0.05)
    (run,) = cut_runs(drive(time, np.zeros(len(time))))
    assert run.speed is None
    assert len(run) == 100


def test_levels_are_never_averaged() -> None:
    time = np.arange(0.0, 40.0, 0.043)
    lane = np.where((time // 7) % 2 == 0, 0.0, 2.0)
    assert set(whole_run(drive(time, np.zeros(len(time)), lane_index=lane)).context["lane_index"]) == {0.0, 2.0}


def test_too_little_is_refused_with_what_was_found() -> None:
    time = np.arange(0.0, 8.0, 0.05)
    with pytest.raises(
        NotEnoughDataError, match=r"no run of 10 s is left in 8\.0 s.*100 % of the rows are below 40 km/h"
    ):
        all_runs([drive(time, np.zeros(len(time)), speed=np.full(len(time), 5.0))])


def test_what_an_import_has_cut_is_not_cut_again() -> None:
    time = np.arange(0.0, 60.0, 0.05)
    kept = (time < 25) | (time > 31)  # a lane change was cut between
    lane = np.where(time < 28, 0.0, 1.0)
    drive = Drive(
        "d",
        time[kept],
        0.1 * np.sin(time[kept]),
        np.full(kept.sum(), 3.75),
        {"lane_index": lane[kept]},
        run=np.where(time[kept] < 28, 0, 1),
    )
    first, second = cut_runs(drive)
    assert (first.time[-1], second.time[0]) == pytest.approx((24.8, 31.2))
    again = cut_runs(Drive("d", drive.time, drive.offset, drive.lane_width, drive.context))
    assert again[0].time[-1] < 21.1, "without the mark the change is looked for"


def test_all_that_is_cut_from_a_drive_lies_on_one_grid_with_the_whole_of_it() -> None:
    time = np.arange(0.0, 120.0, 0.043)
    speed = np.where((time > 31.0) & (time < 37.77), 5.0, 30.0)
    one = drive(time, np.sin(0.3 * time), speed=speed)
    runs, whole = cut_runs(one), whole_run(one)
    assert len(runs) == 2
    assert runs[1].time[0] - time[speed == 5.0][-1] < STEP + 0.05
    for run in runs:
        at = np.searchsorted(whole.time, run.time - 1e-9)
        np.testing.assert_allclose(whole.time[at], run.time, atol=1e-9)
        np.testing.assert_allclose(whole.offset[at], run.offset, atol=5e-3)
        assert (len(run) - 0.5) * STEP >= 10.0
