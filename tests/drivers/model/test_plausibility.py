"""What no driver and no road does is refused, with the value and the limit."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import OFFSET_LANES
from xosc_lateral.drivers.model.plausibility import (
    MINIMUM_LANE_WIDTH,
    check_context,
    check_offsets,
    first_implausible,
    implausible,
)

REACH = OFFSET_LANES.value


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("width", [3.5, 2.75])
def test_offsets_up_to_the_limit_pass_and_beyond_it_are_refused_to_either_side(sign: float, width: float) -> None:
    check_offsets(np.array([0.0, sign * REACH * width]), width, "x")
    with pytest.raises(DriverProfileError, match=r"^x: an offset of .* m; .*at most 1\.5"):
        check_offsets(np.array([0.0, sign * (REACH * width + 0.01)]), width, "x")


def test_a_lane_that_opens_is_held_against_a_narrow_one() -> None:
    check_offsets(np.array([REACH * MINIMUM_LANE_WIDTH - 0.01]), np.array([0.1]), "x")
    with pytest.raises(DriverProfileError):
        check_offsets(np.array([REACH * MINIMUM_LANE_WIDTH + 0.01]), np.array([0.1]), "x")


def test_the_first_bad_row_is_named_with_its_time() -> None:
    offset, time = np.array([0.1, 9.0, -20.0]), np.array([10.0, 10.2, 10.4])
    with pytest.raises(DriverProfileError, match=r"an offset of 9 m at 10\.2 s; .*: 2\.57143, at most 1\.5"):
        check_offsets(offset, np.full(3, 3.5), "profile p", time)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_refused(bad: float) -> None:
    with pytest.raises(DriverProfileError):
        check_offsets(np.array([0.0, bad]), 3.5, "x")


def test_no_offsets_are_fine() -> None:
    check_offsets(np.empty(0), 3.5, "x")


@pytest.mark.parametrize(
    ("name", "value"), [("speed", -1e4), ("speed", 1e4), ("lane_width", 500.0), ("curvature", 50.0)]
)
def test_context_that_no_road_has_is_refused_by_name_value_and_range(name: str, value: float) -> None:
    why = implausible(name, value)
    assert why is not None
    assert why.startswith(f"{name} {value:.6g} is not within [")
    with pytest.raises(ValueError, match=f"^step 3: {name} "):
        check_context({"time_of_day": 1.0, name: value}, "step 3")


@pytest.mark.parametrize(
    ("name", "value"), [("speed", 30.0), ("speed", np.nan), ("curvature", -0.02), ("anything", 1e5)]
)
def test_context_that_roads_have_passes(name: str, value: float) -> None:
    assert implausible(name, value) is None
    check_context({name: value}, "x")


def test_the_row_of_the_first_bad_value_is_told() -> None:
    assert first_implausible("speed", np.array([30.0, np.nan, 1e4, -1e4])) == 2
    assert first_implausible("speed", np.array([30.0, np.nan])) is None
    assert first_implausible("speed", np.empty(0)) is None
