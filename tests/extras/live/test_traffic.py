"""Drivers in somebody else's simulation: the same numbers as elsewhere, no kinks, and nobody's simulation harmed."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.kit.upsampled import upsample
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.segment import LARGEST_HEADING, Segment, own_time
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.stream import sealed
from xosc_lateral.extras.live.loop import UnderTest
from xosc_lateral.extras.live.moment import Moves
from xosc_lateral.extras.live.traffic import FORMAT, Moment, Traffic
from xosc_lateral.workflows.profiles.profiles import read_profile
from xosc_lateral.world.motion.driver_clock import LARGEST_TURN_RATE

DT = 0.01


@pytest.fixture(scope="module")
def profile() -> DriverProfile:
    return read_profile("motorway")


def moment(names: tuple[str, ...] = ("a", "b"), **changes: Any) -> Moment:
    n = len(names)
    values: dict[str, Any] = {
        "speed": np.full(n, 28.0), "lane_width": np.full(n, 3.6), "offset": np.zeros(n),
        "following": np.ones(n, dtype=bool), "driven": np.ones(n, dtype=bool), "is_truck": np.zeros(n, dtype=bool),
    }  # fmt: skip
    return Moment(names, **(values | changes))


def drive(traffic: Traffic, seconds: float, start: float = 0.0, **changes: Any) -> list[Moves]:
    """Even steps; the vehicle is where the driver said a step ago."""
    found: list[Moves] = []
    for k in range(round(start / DT), round((start + seconds) / DT)):
        offset = found[-1].offset if found else changes.get("offset", np.zeros(2))
        found.append(traffic.step(k * DT, moment(**(changes | {"offset": offset}))))
    return found


def column(moves: list[Moves], name: str, row: int = 0) -> NDArray[np.float64]:
    return np.array([getattr(one, name)[row] for one in moves])


def test_each_drives_what_is_sampled_for_his_seed_in_even_traffic(profile: DriverProfile) -> None:
    traffic = Traffic(profile, seed=5)
    moves = drive(traffic, 30.0)
    segment = Segment.even(32.0, 0.2, 3.6, 28.0)
    context = {"is_truck": np.zeros(len(segment)), "acceleration": np.zeros(len(segment))}
    for row, name in enumerate("ab"):
        known = Segment(segment.time, segment.lane_width, segment.speed, context)
        wanted = upsample(sample_offsets(profile, known, traffic.seed_of(name)), 20)[: len(moves)]
        np.testing.assert_allclose(column(moves, "offset", row), wanted, atol=1e-9, rtol=0.0)
        np.testing.assert_allclose(np.gradient(wanted, DT)[1:-1], column(moves, "rate", row)[1:-1], atol=2e-3)
    assert column(moves, "heading")[500] == pytest.approx(column(moves, "rate")[500] / 28.0, rel=1e-3)


def test_who_drives_beside_him_changes_nobodys_random_numbers(profile: DriverProfile) -> None:
    together = column(drive(Traffic(profile, seed=5), 5.0), "offset", 1)
    alone = Traffic(profile, seed=5)
    found = [alone.step(k * DT, moment(("b",))).offset[0] for k in range(500)]
    np.testing.assert_allclose(together, found, atol=1e-12)


def turns(moves: list[Moves], speed: float) -> NDArray[np.float64]:
    """Change of the path's direction per step. [rad]"""
    return np.abs(np.diff(np.arctan2(np.diff(column(moves, "offset")), speed * DT)))


@pytest.mark.parametrize(("speed", "where"), [(28.0, -0.6), (12.0, 0.7), (45.0, 1.2)])
def test_a_maneuver_gives_the_car_back_without_a_kink(profile: DriverProfile, speed: float, where: float) -> None:
    traffic = Traffic(profile, seed=2)
    fast = {"speed": np.full(2, speed)}
    drive(traffic, 4.0, **fast)
    held = drive(traffic, 3.0, 4.0, following=np.array([False, True]), **fast)
    assert not held[-1].steered[0] and held[-1].steered[1]
    at = {"offset": np.array([where, held[-1].offset[1]])}
    last = traffic.step(7.0, moment(following=np.array([False, True]), **at, **fast))
    back = drive(traffic, 12.0, 7.01, **at, **fast)
    assert last.offset[0] == where
    assert abs(back[0].offset[0] - where) < 2e-3
    assert turns([last, *back], speed).max() < LARGEST_TURN_RATE * DT
    other = drive(Traffic(profile, seed=2), 19.01, **fast)  # and the driver is where he had been without a maneuver
    np.testing.assert_allclose(column(back, "offset")[-200:], column(other, "offset")[-200:], atol=1e-9)


def test_a_nominal_offset_is_kept_and_the_driver_is_added(profile: DriverProfile) -> None:
    plain = column(drive(Traffic(profile, seed=2), 2.0), "offset")
    moved = column(drive(Traffic(profile, seed=2), 2.0, base=np.array([0.5, 0.0])), "offset")
    np.testing.assert_allclose(moved, plain + 0.5, atol=1e-12)


@pytest.mark.pages
def test_slow_cars_move_less_and_standing_ones_not_at_all(profile: DriverProfile) -> None:
    traffic = Traffic(profile, seed=4)
    moves = drive(traffic, 5.0)
    time, speed, k = 5.0, 28.0, 500
    speeds = [28.0] * 500
    while time < 34.0:  # brakes to a stop, stands, drives on
        speed = max(speed - 3.0 * DT, 0.0) if time < 18.0 else min(speed + 2.0 * DT, 28.0)
        speeds.append(speed)
        moves.append(traffic.step(time, moment(speed=np.full(2, speed), offset=moves[-1].offset)))
        if 15.0 < time < 18.0:
            assert moves[-1].rate[0] == 0.0
            assert moves[-1].offset[0] == moves[-2].offset[0]
            assert moves[-1].heading[0] == moves[-2].heading[0]  # turned as it came to rest
        k += 1
        time = k * DT
    assert np.abs(np.diff(column(moves, "offset"))).max() < 0.01
    turning, fast = np.abs(np.diff(column(moves, "heading"))), np.array(speeds)[1:] > 40.0 / 3.6
    assert turning[fast].max() < LARGEST_TURN_RATE * DT
    assert turning.max() < 0.2 * DT  # a slow car turns sharply, without a jump
    assert np.abs(column(moves, "heading")).max() <= LARGEST_HEADING
    other = drive(Traffic(profile, seed=4), 40.0)
    rest = drive(traffic, 6.0, time, offset=moves[-1].offset)
    own = own_time(DT * np.arange(len(speeds)), np.array(speeds))[-1]  # the same movement, later by what he stood
    there = column(other, "offset")[round((own + 6.0) / DT) - 1]
    assert column(rest, "offset")[-1] == pytest.approx(there, abs=0.05)  # speed 6 s ago


def test_vehicles_come_and_go_and_the_others_drive_on(profile: DriverProfile) -> None:
    alone = column(drive(Traffic(profile, seed=9), 8.0), "offset")
    traffic = Traffic(profile, seed=9)
    found, late = [], []
    for k in range(800):
        names = ("c", "a", "b") if 300 <= k < 600 else ("a",)
        offset = np.array([late[-1] if late else 0.4, 0.0, 0.0]) if len(names) > 1 else np.zeros(1)
        moves = traffic.step(k * DT, moment(names, offset=offset))
        found.append(moves.offset[names.index("a")])
        if len(names) > 1:
            late.append(moves.offset[0])
    np.testing.assert_allclose(found, alone, atol=1e-12)
    assert late[0] == pytest.approx(0.4, abs=2e-3)  # taken over where it came from
    assert len(traffic) == 1


def test_the_state_goes_through_a_file_and_on(profile: DriverProfile) -> None:
    traffic = Traffic(profile, seed=6)
    drive(traffic, 3.5)
    drive(traffic, 0.5, 3.5, following=np.array([False, True]), offset=np.array([0.5, 0.0]))
    drive(traffic, 0.33, 4.0, offset=np.array([0.5, 0.0]))
    state = json.loads(json.dumps(traffic.to_dict()))
    other = Traffic(profile, seed=0)
    other.restore(state)
    for there, here in zip(*(drive(one, 6.0, 4.33) for one in (traffic, other)), strict=True):
        np.testing.assert_array_equal(here.offset, there.offset)
    with pytest.raises(SimulationError, match="other profiles"):
        Traffic(read_profile("motorway-vehicle-1")).restore(state)
    with pytest.raises(SimulationError, match="not a state"):
        Traffic(profile).restore({"format": "x"})


def test_when_all_have_gone_the_next_ones_drive_as_if_they_were_the_first(profile: DriverProfile) -> None:
    around = {name: np.full(2, value) for name, value in (("left_distance", 30.0), ("right_distance", np.inf))}
    traffic, fresh = Traffic(profile, seed=9), Traffic(profile, seed=9)
    drive(traffic, 3.0, context=around)
    found = []
    for one in (traffic, fresh):
        one.step(3.0, moment((), context={name: np.empty(0) for name in around}))
        moves = [one.step(3.2 + 0.2 * k, moment(("c", "d"), context=around)) for k in range(60)]
        found.append(column(moves, "rate"))
    np.testing.assert_allclose(*found, atol=1e-9)
    assert np.std(found[0]) > 1e-3


@pytest.mark.parametrize(
    ("place", "value"),
    [(("knots",), -(10**9)), (("time",), None), (("time",), "3"), (("drivers", "a", 0), [1e300] * 6),
     (("drivers", "z"), []), (("groups", "", "members"), ["a", "c"]), (("groups", "", "drives"), []),
     (("groups", "", "drives", 0, "command", "samples"), [float("nan")] * 4), (("groups", "", "responses"), []),
     (("groups", "", "drives", 0, "drawn", 0, 0), 1e300), (("columns",), 5), (("seed",), -1), (("knots",), None),
     (("groups", "", "drives", 0, "process", "core", "factors", "quick", "values", 1, 0), 1e12)],
)  # fmt: skip
def test_a_damaged_state_is_refused_though_sealed_anew_and_the_drive_goes_on(
    profile: DriverProfile, place: tuple[Any, ...], value: object
) -> None:
    traffic = Traffic(profile, seed=6)
    drive(traffic, 1.0)
    state = json.loads(json.dumps(traffic.to_dict()))
    holder = state
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = value
    before = json.dumps(traffic.to_dict())
    for damaged in (state, sealed({key: own for key, own in state.items() if key != "sha256"}, FORMAT)):
        with pytest.raises(SimulationError, match="damaged") as caught:
            traffic.restore(damaged)
        assert "\n" not in str(caught.value)
    assert json.dumps(traffic.to_dict()) == before


def test_times_that_are_added_up_step_by_step_hit_model_steps_as_well_as_round_ones(profile: DriverProfile) -> None:
    traffic = Traffic(profile, seed=6)
    for k, off in enumerate((-2e-9, -9e-10, -3e-10, -1e-10, 0.0, 3e-10, 9e-10), start=1):
        for at in (0.2 * k + off - 1.0, 0.2 * k - 0.9):  # a simulation may begin before 0
            assert np.isfinite(traffic.step(at, moment()).offset).all()


def test_a_leap_in_time_and_a_vehicle_named_twice_are_refused(profile: DriverProfile) -> None:
    traffic = Traffic(profile, seed=6)
    drive(traffic, 1.0)
    with pytest.raises(SimulationError, match=r"simulation: 1e\+09 s, at most 60 s"):
        traffic.step(1e9, moment())
    with pytest.raises(ValueError, match="named twice"):
        traffic.step(1.0, moment(("a", "a")))
    with pytest.raises(ValueError, match="driven: 1 rows for 2 vehicles"):
        traffic.step(1.0, moment(driven=np.ones(1, dtype=bool)))
    drive(traffic, 1.0, 1.0)


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"speed": np.array([28.0, np.nan])}, "vehicle 'b' at 2 s: speed is nan"),
        ({"offset": np.array([np.inf, 0.0])}, "vehicle 'a' at 2 s: offset is inf"),
        ({"lane_width": np.array([3.5, 0.0])}, "lane width is 0"),
        ({"speed": np.array([28.0, 900.0])}, "vehicle 'b': speed 900"),
    ],
)
def test_nonsense_is_refused_in_a_line_and_the_drive_goes_on(
    profile: DriverProfile, changes: dict[str, Any], what: str
) -> None:
    traffic, undisturbed = Traffic(profile, seed=1), Traffic(profile, seed=1)
    drive(traffic, 2.0)
    drive(undisturbed, 2.0)
    with pytest.raises(SimulationError, match=what) as caught:
        traffic.step(2.0, moment(**changes))
    assert "\n" not in str(caught.value)
    for one, other in zip(drive(traffic, 1.0, 2.0), drive(undisturbed, 1.0, 2.0), strict=True):
        np.testing.assert_array_equal(one.offset, other.offset)
    with pytest.raises(SimulationError, match=r"time is 1 s after 2\.99 s"):
        traffic.step(1.0, moment())


def test_on_the_other_side_of_the_road_he_does_the_mirror_image(profile: DriverProfile) -> None:
    right = column(drive(Traffic(profile, seed=3), 3.0), "offset")
    left = column(drive(Traffic(profile, seed=3, left_hand=True), 3.0), "offset")
    np.testing.assert_allclose(left, -right, atol=1e-12)


@pytest.mark.parametrize(
    ("stated", "driven", "name", "is_under_test"),
    [
        (None, (), "Ego", True),
        (None, (), "hero_2", True),
        (None, (), "Egon", False),
        (None, ("Ego",), "Ego", False),  # -p Ego=PROFILE
        ("none", (), "Ego", False),
        (["none"], (), "Ego", False),
        ((), (), "Ego", False),
        (["Truck"], (), "Ego", False),
        ("Truck", (), "Truck", True),
    ],
)
def test_who_is_called_like_an_ego_is_under_test_unless_said_otherwise(stated, driven, name, is_under_test):
    assert (name in UnderTest(stated, driven)) == is_under_test


def test_others_beside_none_are_refused():
    with pytest.raises(ValueError, match="stands alone"):
        UnderTest(["none", "Ego"])


@pytest.mark.parametrize("rate", [-2.0, 0.7])
def test_acceleration_is_the_speeds_change_in_a_second(profile: DriverProfile, rate: float) -> None:
    """Constant acceleration is seen as such, whatever the model's step."""
    traffic = Traffic(profile, seed=5)
    for k in range(300):
        traffic.step(k * DT, moment(speed=np.full(2, 20.0 + rate * k * DT)))
    seen = traffic._context(moment(speed=np.full(2, 20.0 + rate * 3.0)))["acceleration"]
    np.testing.assert_allclose(seen, rate, atol=1e-9)
