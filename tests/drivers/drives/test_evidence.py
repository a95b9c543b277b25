"""What recordings say against themselves: planted faults are named with their cure, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.drives import evidence
from xosc_lateral.extras.recordings.evidence import of_sizes, of_vehicles

WIDTH = 3.6


def changing(rng: np.random.Generator, seconds: float = 60.0, step: float = 0.1) -> tuple[np.ndarray, ...]:
    """Time, offset and lane (from the right) of a driver who changes to the left and back."""
    time = np.arange(0.0, seconds, step)
    move = lambda at: 0.5 - 0.5 * np.cos(np.pi * np.clip((time - at) / 5.0, 0.0, 1.0))  # noqa: E731
    y = (
        WIDTH * (move(15.0) - move(40.0))
        + 0.2 * np.sin(time / 3.0 + rng.uniform(0, 6))
        + 0.02 * rng.normal(size=len(time))
    )
    lane = np.round(y / WIDTH)
    return time, y - WIDTH * lane, lane


@pytest.mark.parametrize(("turned", "factor", "words"), [
    (1.0, 1.0, None), (-1.0, 1.0, "positive to the right"), (1.0, 1.0 / 0.3048, "it is in ft"),
    (1.0, 100.0, "it is in cm"), (1.0, 1.0 / WIDTH, "offset=COLUMN:3.6 m"),
])  # fmt: skip
def test_lane_changes_prove_side_and_unit(turned: float, factor: float, words: str | None) -> None:
    time, offset, lane = changing(np.random.default_rng(1))
    offset = turned * factor * offset
    assert says(time, offset, lane) is None if words is None else words in (says(time, offset, lane) or "")


@pytest.mark.parametrize(("factor", "words"), [
    (1.1, None), (0.9, None), (100.0, None), (1.0 / 0.3048, None),  # units are said elsewhere
    (1.4, "lane_width=COLUMN:0.714 m"), (0.7, "lane_width=COLUMN:1.43 m"),
])  # fmt: skip
def test_lane_changes_prove_the_width_of_lanes_at_any_rate(factor: float, words: str | None) -> None:
    for step in (0.04, 0.1, 0.4):  # in the last, vehicles pass half a metre from row to row
        said = says(*changing(np.random.default_rng(1), step=step), factor * WIDTH)
        assert said is None if words is None else words[:-4] in (said or "")


def test_lanes_of_two_widths_contradict_nothing() -> None:
    time, offset, lane = changing(np.random.default_rng(1))
    rare = np.r_[np.full(len(time), 1.0), np.full(2 * len(time), 1.3)]  # those without lane changes are wider
    offset, lane = (np.r_[each, np.full(2 * len(time), each[-1])] for each in (offset, lane))
    jumps = evidence.jumps_of(0.1 * np.arange(len(rare)), offset, rare * WIDTH, lane)
    assert len(jumps[0]) == 2 and evidence.of_lane_changes(jumps, 1.8) is None


def says(time: np.ndarray, offset: np.ndarray, lane: np.ndarray | None, width: float = WIDTH) -> str | None:
    jumps = evidence.jumps_of(time, offset, np.full(len(time), width), lane)
    return evidence.of_lane_changes(jumps, float(np.quantile(np.abs(offset), 0.999)))


@pytest.mark.parametrize(("origin", "sign", "options"), [
    (0.5, -1.0, "(distance_left=COLUMN)"), (0.5, 1.0, "(distance_left=COLUMN:-m)"),
    (-0.5, 1.0, "(distance_right=COLUMN)"), (-0.5, -1.0, "(distance_right=COLUMN:-m)"),
])  # fmt: skip
def test_an_offset_from_a_marking_is_told_with_its_side(origin: float, sign: float, options: str) -> None:
    time, offset, lane = changing(np.random.default_rng(1))
    counted = sign * (offset - origin * WIDTH)
    assert options in (says(time, counted, lane) or "")
    both = says(time, counted, None) or ""
    assert "distance_left" in both and "distance_right" in both


def test_an_offset_from_a_marking_is_told_without_lane_changes() -> None:
    rng = np.random.default_rng(2)
    offset = 0.3 * np.sin(np.arange(600) / 30.0) + 0.02 * rng.normal(size=600)
    width = np.full(600, WIDTH)
    assert "distance_left=COLUMN, or" in (evidence.of_places(0.5 * width - offset, width) or "")
    assert evidence.of_places(offset, width) is evidence.of_places(offset + 0.8, width) is None


@pytest.mark.parametrize("count", [1, 2, 3])
def test_rows_of_vehicles_in_turns_are_counted(count: int) -> None:
    rng = np.random.default_rng(2)
    rows = np.stack([changing(rng)[1][:200] + 0.3 * k for k in range(count)], axis=1).ravel()
    assert evidence.in_turns(rows) == count


@pytest.mark.parametrize(("step", "words"), [
    (0.04, None), (1.0, "frames"), (40.0, "the clock may be in"), (1e-5, "the clock may be in"),
])  # fmt: skip
def test_clocks_that_no_recording_has_are_told(step: float, words: str | None) -> None:
    said = evidence.of_clock(step * np.arange(500.0))
    assert said is None if words is None else words in (said or "")


@pytest.mark.parametrize("rate", [5.0, 10.0, 25.0])
def test_minutes_are_told_from_a_fast_sensor(rate: float) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 600.0, 1.0 / rate)
    knots = np.arange(-10.0, 611.0, 5.0)
    wander = np.interp(time, knots, 0.2 * rng.normal(size=len(knots))) + 0.05 * rng.normal(size=len(time))
    assert "time=COLUMN:min" in (evidence.of_wander(evidence.wander(time / 60.0, wander)) or "")
    fast = np.arange(0.0, 60.0, 0.005)  # 200 Hz
    offset = np.interp(fast, knots, 0.2 * rng.normal(size=len(knots))) + 0.05 * rng.normal(size=len(fast))
    assert evidence.of_wander(evidence.wander(fast, offset)) is None


def traffic(count: int, rng: np.random.Generator, east: float = 0.0, *, both: bool = True) -> tuple[np.ndarray, ...]:
    """Offset, width, vehicle and heading of vehicles on a road to the north, the map `east` m off."""
    vehicle = np.repeat(np.arange(count), 50)
    heading = np.where(both & (vehicle % 2 > 0), -0.5 * np.pi, 0.5 * np.pi)
    own = rng.normal(0.0, 0.21, count)[vehicle] + 0.1 * rng.normal(size=len(vehicle))
    offset = own - east * np.sin(heading)  # to the left of who drives north is west
    lane = np.round(offset / WIDTH)
    return offset - WIDTH * lane, np.full(len(vehicle), WIDTH), vehicle, heading


def test_a_map_beside_its_traffic_is_named_from_half_a_metre_on_where_traffic_goes_both_ways() -> None:
    def found(east: float, *, both: bool = True) -> int:
        made = (traffic(20, np.random.default_rng([4, k]), east, both=both) for k in range(40))
        return sum(evidence.of_registration(*one) is not None for one in made)

    assert [found(0.0), found(1.0), found(1.0, both=False)] == [0, 40, 40]
    assert found(0.5) >= 38
    said = evidence.of_registration(*traffic(20, np.random.default_rng(6), 0.5)) or ""
    assert "opposite directions" in said and "y +0.0" in said.replace("y -0.0", "y +0.0")


def test_sizes_and_the_same_vehicle_twice_are_named() -> None:
    long, wide = np.full(9, 4.6), np.full(9, 1.8)
    assert of_sizes(long, wide) is None
    assert "exchanged" in (of_sizes(wide, long) or "")
    assert "length=COLUMN:cm" in (of_sizes(100.0 * long, None) or "")
    unknown = np.where(np.arange(9) < 6, 0.0, long)  # a length of zero is none: nothing is wider than that
    assert of_sizes(unknown, wide) is None and of_sizes(np.zeros(9), wide) is None
    time = np.tile(np.arange(0.0, 10.0, 0.1), 3)
    vehicle, zero = np.repeat([0, 1, 2], 100), np.zeros(300)
    x = 30.0 * time + np.where(vehicle == 1, 0.5, 0.0)
    y = np.where(vehicle == 2, 3.6, 0.0)
    (line,) = of_vehicles(["a", "b", "c"], vehicle, time, x, y, zero, np.full(300, 4.6), None, 0.1)
    assert line.startswith("b lies in a for 10.0 s")


def test_drives_to_one_side_and_noise_are_named() -> None:
    rng = np.random.default_rng(7)
    drives = [0.2 * np.sin(np.arange(600) / 30.0 + k) + 0.02 * rng.normal(size=600) for k in range(6)]
    widths = [np.full(600, WIDTH)] * 6
    assert evidence.of_drives(drives, widths) == []
    assert "to the left" in evidence.of_drives([one + 0.8 for one in drives], widths)[0]
    assert "err by 0.3" in evidence.of_drives([one + 0.3 * rng.normal(size=600) for one in drives], widths)[0]


def test_offsets_that_lost_their_sign_are_told_and_one_sided_drivers_are_not() -> None:
    from xosc_lateral import sample

    for seed in range(3):
        offset = sample("motorway", duration=600.0, seed=seed).to_frame()["offset"].to_numpy()
        assert "their sign is lost" in (evidence.of_sides(np.abs(offset)) or "")
        assert evidence.of_sides(offset) is None
        assert evidence.of_sides(offset - offset.min() + 1e-3) is None  # keeps to the left, and just not beyond 0


def test_a_drive_that_is_there_twice_is_told() -> None:
    one, other = np.sin(np.arange(50.0)), np.cos(np.arange(50.0))
    width = np.full(50, WIDTH)
    assert not evidence.of_drives([one, other], [width] * 2)
    (said,) = evidence.of_drives([one, other, one], [width] * 3)
    assert said.startswith("1 of 3 drives repeat another one")


def test_a_number_that_stands_for_no_value_is_told_where_it_comes_again_and_again() -> None:
    rng = np.random.default_rng(3)
    offset = 0.3 * np.sin(np.arange(3000) / 80.0) + 0.005 * rng.normal(size=3000)
    rounded = np.round(offset, 1)  # a coarse sensor repeats itself, too
    assert evidence.of_marker(offset) is evidence.of_marker(rounded) is None
    for value in (-1.0, 0.0):
        gone = np.where(np.arange(3000) % 700 < 40, value, offset)
        assert f"missing = [{value:g}]" in (evidence.of_marker(gone) or ""), value


def test_sizes_in_feet_are_told_by_the_width() -> None:
    long, wide = np.full(9, 4.6), np.full(9, 1.8)
    assert "length=COLUMN:ft, width=COLUMN:ft" in (of_sizes(long / 0.3048, wide / 0.3048) or "")
