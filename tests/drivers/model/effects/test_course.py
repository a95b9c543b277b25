"""A response may be a weighted sum of shifts in time: a course."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.drivers.model.effects.response import Response, respond

STEP = 0.2
COURSE = ((-3.0, 0.5), (0.0, -1.0), (1.3, 0.25), (12.0, 0.25))
VALUES = np.random.default_rng(7).normal(size=400).cumsum()[:, None]


def test_a_course_is_the_sum_of_its_shifts() -> None:
    parts = [weight * respond(VALUES, STEP, 0.4 + late, 1.0) for late, weight in COURSE]
    assert respond(VALUES, STEP, 0.4, 1.0, course=COURSE) == pytest.approx(np.sum(parts, axis=0), abs=1e-12)


def test_one_shift_of_weight_one_is_a_delay() -> None:
    assert np.array_equal(respond(VALUES, STEP, 0.4, 1.0, course=[(0.0, 1.0)]), respond(VALUES, STEP, 0.4, 1.0))


@pytest.mark.parametrize("length", [1, 7, 90])
def test_in_blocks_it_is_the_same_to_the_bit(length: int) -> None:
    response = Response(STEP, 0.0, 1.0, course=COURSE)
    parts = [response.take(VALUES[at : at + length]) for at in range(0, len(VALUES), length)]
    parts.append(response.finish(VALUES[:0]))
    assert np.array_equal(np.concatenate(parts), respond(VALUES, STEP, 0.0, 1.0, course=COURSE))


def test_its_preview_is_the_earliest_shift() -> None:
    assert Response(STEP, 0.0, 1.0, course=COURSE).ahead == 15


def test_a_profile_without_a_course_has_none_in_its_file() -> None:
    plain = Linear(acts=Acts.LOCATION, column="curvature")
    assert "course" not in plain.to_dict()
    with pytest.raises(DriverProfileError, match="course"):
        Linear(acts=Acts.LOCATION, column="curvature", course=((np.nan, 1.0),))
