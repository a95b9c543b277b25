"""What a column is: by declaration, by name, by its values."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import movement, timeline_of, wander
from xosc_lateral.base.errors import FormatError
from xosc_lateral.extras.loop.columns import Role, is_clock, proposed_role, roles_of
from xosc_lateral.extras.loop.timeline import Timeline

SECONDS = 1500.0
N = round(SECONDS / 0.2)


def timeline(**context: np.ndarray) -> Timeline:
    return timeline_of(movement(np.random.default_rng(1), SECONDS), context)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("curvature", Role.ROAD),
        ("RoadCurvature", Role.ROAD),
        ("lane_width", Role.ROAD),
        ("guardrail_right", Role.ROAD),
        ("wind_speed", Role.WEATHER),
        ("lateral_wind", Role.WEATHER),
        ("air_temperature", Role.WEATHER),
        ("cabin_temperature", Role.UNKNOWN),
        ("lead_distance", Role.TRAFFIC),
        ("left_is_truck", Role.TRAFFIC),
        ("time_headway", Role.TRAFFIC),
        ("lane_departure_warning", Role.OWN),
        ("time_to_line_crossing", Role.OWN),
        ("yaw_rate", Role.OWN),
        ("lateral_speed", Role.OWN),
        ("speed", Role.DRIVER),
        ("battery_soc", Role.TIME),
        ("frame_id", Role.TIME),
        ("time_of_day", Role.UNKNOWN),
        ("x17", Role.UNKNOWN),
    ],
)
def test_a_name_says_what_a_column_is(name: str, role: Role) -> None:
    assert proposed_role(name) is role


def test_what_is_declared_counts_whatever_the_name() -> None:
    rng = np.random.default_rng(2)
    found = roles_of(timeline(yaw_rate=wander(rng, N, 10.0)), ["yaw_rate"], {"yaw_rate": "road"})["yaw_rate"]
    assert (found.role, found.declared) == (Role.ROAD, True)


@pytest.mark.parametrize("declared", [{"x": "weather "}, {"y": "road"}])
def test_a_role_that_there_is_not_or_of_no_column_is_refused(declared: dict[str, str]) -> None:
    with pytest.raises(FormatError, match="role of"):
        roles_of(timeline(x=np.zeros(N)), ["x"], declared)


def test_clocks_are_known_by_their_values() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(N) * 0.2
    columns = {
        "counts": np.floor(time * 10.0),
        "charge": np.round(90.0 - time / 60.0 + 0.05 * wander(rng, N, 5.0), 1),
        "walk": np.cumsum(rng.normal(size=N)) / np.sqrt(N),
        "slow": wander(rng, N, 300.0),
        "once": (time > 700.0).astype(float),
        "gone": np.where(time > 700.0, np.nan, time),
    }
    assert {name for name in columns if is_clock(timeline(**columns), name)} == {"counts", "charge"}


def test_weather_that_only_rises_is_weather() -> None:
    rising = timeline(air_temperature=np.linspace(10.0, 20.0, N))
    assert roles_of(rising, ["air_temperature"], {})["air_temperature"].role is Role.WEATHER


def test_a_minute_tells_no_clock() -> None:
    short = timeline_of(movement(np.random.default_rng(4), 100.0), {"x": np.arange(500.0)})
    assert not is_clock(short, "x")


def test_counters_of_short_drives_are_clocks_and_what_turns_is_not() -> None:
    """Three drives of five minutes, whose counters begin anew."""
    rng, n = np.random.default_rng(5), round(330.0 / 0.2)
    time = 0.2 * np.arange(n)
    rising = np.floor(time * 3.0)
    columns = {
        "trip": np.tile(rising, 3),
        "charge": np.tile(80.0 - 0.01 * time, 3),
        "turns": np.concatenate([rising, rising, rising[::-1]]),
        "walk": np.cumsum(rng.normal(size=3 * n)) / np.sqrt(n),
    }
    short = timeline_of(np.zeros(3 * n), columns, drives=3)
    assert {name for name in columns if is_clock(short, name)} == {"trip", "charge"}
