"""Metres along parametric cubics, against quadrature; and lanes of a section, against a ruler."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from xosc_lateral.files.opendrive.plan_view import PIECES_PER_ELEMENT, end_parameter, parameter_pieces
from xosc_lateral.world.road.lanes import LaneRecord, LaneSection, build_section
from xosc_lateral.world.road.piecewise import Cubic, PiecewiseCubic, shift

small = st.floats(-0.4, 0.4)


def run(u: tuple[float, ...], v: tuple[float, ...], p: float) -> float:
    """Arc length from 0 to p."""

    def speed(q: float) -> float:
        return float(np.hypot(*(c[1] + 2.0 * c[2] * q + 3.0 * c[3] * q * q for c in (u, v))))

    return quad(speed, 0.0, p, epsabs=1e-12, limit=200)[0]


def p_at(pieces: np.ndarray, length: float, ds: float) -> float:
    k = min(int(ds / (length / PIECES_PER_ELEMENT)), PIECES_PER_ELEMENT - 1)
    h = ds - k * length / PIECES_PER_ELEMENT
    a, b, c, d = pieces[k]
    return float(a + h * (b + h * (c + h * d)))


# ---- arc length ------------------------------------------------------------------------------------------------------
@given(small, small, small, small)
def test_the_parameter_after_some_metres_is_where_the_curve_has_run_them(
    cu: float, du: float, cv: float, dv: float
) -> None:
    u, v = (0.0, 20.0, 20.0 * cu, 20.0 * du), (0.0, 0.0, 20.0 * cv, 20.0 * dv)
    assume(min(20.0 + 40.0 * cu * p + 60.0 * du * p * p for p in np.linspace(0.0, 1.0, 11)) > 4.0)
    length = run(u, v, 1.0)
    pieces = parameter_pieces(np.array([u]), np.array([v]), np.array([1.0]), np.array([length]))[0]
    for ds in np.linspace(0.0, length, 7):
        assert run(u, v, p_at(pieces, length, float(ds))) == pytest.approx(ds, abs=1e-4)


def test_a_length_that_differs_by_rounding_is_met_at_the_end() -> None:
    u, v = (0.0, 10.0, 0.0, 0.0), (0.0, 0.0, 3.0, 0.0)
    length = run(u, v, 1.0) + 0.01
    pieces = parameter_pieces(np.array([u]), np.array([v]), np.array([1.0]), np.array([length]))[0]
    assert p_at(pieces, length, length) == pytest.approx(1.0, abs=1e-12)
    assert pieces[0, 0] == 0.0


def test_a_curve_that_stands_still_runs_evenly() -> None:
    nothing = np.zeros((1, 4))
    pieces = parameter_pieces(nothing, nothing, np.array([1.0]), np.array([8.0]))[0]
    assert [p_at(pieces, 8.0, ds) for ds in (0.0, 2.0, 8.0)] == pytest.approx([0.0, 0.25, 1.0])


def test_the_parameter_never_runs_back_even_about_a_cusp() -> None:
    """u = p - 2 p^2 turns round at p = 1/4, where the curve stands."""
    u, v = np.array([[0.0, 10.0, -20.0, 0.0]]), np.array([[0.0, 0.0, 0.0, 0.0]])
    length = 2.5 + 11.25 + 1.25
    pieces = parameter_pieces(u, v, np.array([1.0]), np.array([length]))[0]
    parameters = [p_at(pieces, length, ds) for ds in np.linspace(0.0, length, 400)]
    assert np.diff(parameters).min() >= -1e-12


@pytest.mark.parametrize("v", [(0.0, 0.0, 0.0, 0.0), (1.0, 0.3, 0.0, 0.0), (0.0, 0.0, 0.01, -0.0002)])
def test_a_poly3_ends_where_it_has_run_its_length(v: Cubic) -> None:
    end = end_parameter(v, 60.0)
    assert run((0.0, 1.0, 0.0, 0.0), v, end) == pytest.approx(60.0, abs=1e-9)


# ---- cubics ----------------------------------------------------------------------------------------------------------
@given(st.tuples(*[st.floats(-2, 2)] * 4), st.floats(-10, 10), st.floats(-10, 10))
def test_a_shifted_cubic_is_the_same_function_from_elsewhere(cubic: Cubic, by: float, at: float) -> None:
    def value(c: Cubic, x: float) -> float:
        return c[0] + x * (c[1] + x * (c[2] + x * c[3]))

    assert value(shift(cubic, by), at) == pytest.approx(value(cubic, at + by), abs=1e-7)


# ---- lanes -----------------------------------------------------------------------------------------------------------
def record(number: int, *widths: tuple[float, Cubic], borders: tuple[tuple[float, Cubic], ...] = ()) -> LaneRecord:
    return LaneRecord(number, "driving", widths=widths, borders=borders)


def section(*records: LaneRecord, offset: Cubic = (0.0, 0.0, 0.0, 0.0)) -> LaneSection:
    directions = {one.id: -1 if one.id > 0 else 1 for one in records}
    lane_offset = PiecewiseCubic.from_records(((0.0, offset),), begin=0.0)
    return build_section(records, 0.0, 100.0, lane_offset=lane_offset, directions=directions)


def flat(width: float, s: float = 0.0) -> tuple[float, Cubic]:
    return s, (width, 0.0, 0.0, 0.0)


def test_lanes_lie_beside_each_other_outwards_from_the_centre() -> None:
    made = section(record(-1, flat(3.0)), record(-2, flat(4.0)), record(1, flat(2.0)))
    assert [lane.id for lane in made.lanes] == [1, -1, -2]
    assert [lane.state_at(50.0).centre_t for lane in made.lanes] == [1.0, -1.5, -5.0]
    assert [lane.state_at(50.0).width for lane in made.lanes] == [2.0, 3.0, 4.0]
    assert made.by_id[0].state_at(50.0).width == 0.0


def test_a_lane_offset_moves_all_lanes_and_leans_them() -> None:
    made = section(record(-1, flat(3.0)), record(1, flat(3.0)), offset=(1.0, 0.02, 0.0, 0.0))
    assert made.by_id[-1].state_at(50.0) == pytest.approx((0.5, 0.02, 3.0))
    assert made.by_id[1].state_at(50.0) == pytest.approx((3.5, 0.02, 3.0))


def test_a_lane_that_opens_pushes_those_outside_of_it() -> None:
    """From 0 to 3 m over 100 m: its own centre moves by half of that, the next lane's by all."""
    made = section(record(-1, (0.0, (0.0, 0.03, 0.0, 0.0))), record(-2, flat(3.5)))
    assert made.by_id[-1].state_at(100.0) == pytest.approx((-1.5, -0.015, 3.0))
    assert made.by_id[-2].state_at(100.0) == pytest.approx((-4.75, -0.03, 3.5))
    assert made.by_id[-2].state_at(0.0) == pytest.approx((-1.75, -0.03, 3.5))


def test_borders_are_edges_themselves() -> None:
    made = section(record(-1, borders=(flat(-3.0),)), record(-2, borders=(flat(-7.0),)), offset=(0.0, 0.0, 0.0, 0.0))
    assert [made.by_id[n].state_at(10.0).width for n in (-1, -2)] == [3.0, 4.0]
    assert [made.by_id[n].state_at(10.0).centre_t for n in (-1, -2)] == [-1.5, -5.0]


def test_a_width_that_begins_late_holds_before_its_first_record() -> None:
    made = section(record(-1, (20.0, (3.0, 0.1, 0.0, 0.0))))
    assert [made.by_id[-1].state_at(s).width for s in (0.0, 20.0, 30.0)] == pytest.approx([3.0, 3.0, 4.0])


def test_a_lane_without_widths_or_borders_has_none() -> None:
    made = section(record(-1), record(-2, flat(3.0)))
    assert made.by_id[-1].state_at(5.0).width == 0.0
    assert made.by_id[-2].state_at(5.0).centre_t == -1.5
