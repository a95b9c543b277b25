"""One drive recorded in several ways: mirrored, by another clock, backwards, at another rate. Its runs follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drivers.drives.test_drives import drive, jittered
from xosc_lateral.drivers.drives.drive import STEP, Drive, Run, average, cut_runs, nearest, resample


@pytest.fixture(scope="module")
def recorded() -> Drive:
    """Three minutes at 25 Hz: a lane change to the left and one back, a jam, a gap."""
    rng = np.random.default_rng(51)
    time = np.delete(np.arange(0.0, 180.0, 0.04), np.arange(2600, 2650))
    lane = ((time > 40.0) & (time < 80.0)).astype(float)
    offset = 0.3 * np.sin(2.0 * np.pi * time / 11.0) + 0.1 * np.sin(2.0 * np.pi * time / 1.7) + 0.1
    speed = np.where((time > 130.0) & (time < 140.0), 5.0, 28.0)
    return drive(time, offset, speed=speed, lane_index=lane, curvature=0.001 * rng.standard_normal(len(time)))


def the_same(one: list[Run], other: list[Run], *, shift: float = 0.0, sign: float = 1.0) -> None:
    assert len(one) == len(other) > 2
    for a, b in zip(one, other, strict=True):
        assert len(a) == len(b) and b.time == pytest.approx(a.time + shift, abs=1e-6)
        assert b.offset == pytest.approx(sign * a.offset, abs=1e-6)
        assert b.context["curvature"] == pytest.approx(a.context["curvature"], abs=1e-9)


def test_a_mirrored_drive_is_cut_at_the_same_places(recorded):
    """Lanes are counted from the other side then, and changes to the left are changes to the right."""
    lanes = {**recorded.context, "lane_index": 1.0 - recorded.context["lane_index"]}
    the_same(cut_runs(recorded), cut_runs(replace(recorded, offset=-recorded.offset, context=lanes)), sign=-1.0)


@pytest.mark.parametrize("shift", [-3600.0, 0.13, 1.7e9])
def test_a_clock_that_began_elsewhere_changes_nothing(recorded, shift):
    """Recorders count from their start, from midnight or from 1970."""
    there = cut_runs(replace(recorded, time=recorded.time + shift))
    if shift < 1e6:
        the_same(cut_runs(recorded), there, shift=shift)
        return
    assert [len(run) for run in there] == [len(run) for run in cut_runs(recorded)]
    for a, b in zip(cut_runs(recorded), there, strict=True):  # a clock of 1970 is known to 0.24 microseconds
        assert b.offset == pytest.approx(a.offset, abs=1e-5)


def test_two_halves_of_a_drive_have_the_runs_of_the_whole(recorded):
    """Parted at the gap, where nothing is counted across anyway."""
    gap = int(np.argmax(np.diff(recorded.time)) + 1)
    halves = [
        replace(
            recorded,
            time=recorded.time[rows],
            offset=recorded.offset[rows],
            lane_width=recorded.lane_width[rows],
            context={name: values[rows] for name, values in recorded.context.items()},
        )
        for rows in (slice(None, gap), slice(gap, None))
    ]
    the_same(cut_runs(recorded), [run for half in halves for run in cut_runs(half)])


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_a_movement_is_the_same_whatever_it_was_recorded_at(rate):
    grid = np.arange(2.0, 58.0, STEP)

    def path(time: np.ndarray) -> np.ndarray:
        return 0.4 * np.sin(2.0 * np.pi * time / 9.0) + 0.05 * np.sin(2.0 * np.pi * time / 1.5)

    time = jittered(60.0, rate, np.random.default_rng(52))
    assert resample(time, path(time), grid)[5:-5] == pytest.approx(path(grid)[5:-5], abs=0.008)


def test_a_path_driven_backwards_in_time_is_resampled_backwards():
    """No phase: what the filter does to the past it does to the future."""
    time, rng = np.arange(0.0, 40.0, 0.05), np.random.default_rng(53)
    values = np.cumsum(rng.standard_normal(len(time))) * 0.01
    grid = np.arange(0.0, 39.8, STEP)
    forth = resample(time, values, grid)
    back = resample(-time[::-1], values[::-1], -grid[::-1])[::-1]
    assert back == pytest.approx(forth, abs=1e-9)


def test_averages_of_a_context_lie_between_its_values_and_are_linear():
    rng = np.random.default_rng(54)
    time, grid = np.arange(0.0, 30.0, 0.05), np.arange(0.4, 29.4, STEP)
    one, other = rng.uniform(3.0, 9.0, (2, len(time)))
    first, second = average(time, one, grid), average(time, other, grid)
    assert first.min() >= 3.0 and first.max() <= 9.0
    assert average(time, 2.0 * one - other, grid) == pytest.approx(2.0 * first - second)
    assert average(time, np.full(len(time), 4.2), grid) == pytest.approx(np.full(len(grid), 4.2))


def test_the_nearest_row_is_the_one_before_where_two_are_as_near():
    time, values = np.array([0.0, 1.0, 3.0]), np.array([10.0, 20.0, 30.0])
    assert nearest(time, values, np.array([-5.0, 0.5, 0.51, 1.9, 2.0, 2.1, 9.0])).tolist() == [
        10.0, 10.0, 20.0, 20.0, 20.0, 30.0, 30.0]  # fmt: skip
    assert nearest(time[:1], values[:1], np.array([-1.0, 7.0])).tolist() == [10.0, 10.0]
