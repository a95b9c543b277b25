"""Elements of reference lines against closed forms and against scipy's Fresnel integrals."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import fresnel

from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.road.geometry import Arc, Line, Spiral, clothoid_pieces, tangent_series

VALID = Path(__file__).parents[2] / "data" / "xodr" / "valid"


def clothoid_end(k0: float, k1: float, length: float) -> complex:
    """x + i y of a clothoid from the origin along x, by Fresnel integrals about the point of no curvature."""
    sharpness = (k1 - k0) / length
    scale = sqrt(pi / abs(sharpness))

    def from_inflection(k: float) -> complex:
        sine, cosine = fresnel(k / sharpness / scale)
        return scale * complex(cosine, np.sign(sharpness) * sine)

    turn = -(k0**2) / (2.0 * sharpness)
    # the tangent at the inflection has turned by -k0^2 / (2 c) from the start
    return (from_inflection(k1) - from_inflection(k0)) * complex(cos(turn), sin(turn))


def test_a_line_ends_where_it_points():
    x, y, heading = Line.of(1.0, 2.0, pi / 6, 100.0).at(100.0)
    assert (x, y, heading) == pytest.approx((1.0 + 50.0 * sqrt(3.0), 52.0, pi / 6), abs=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_quarter_circle_ends_one_radius_ahead_and_one_aside(side):
    x, y, heading = Arc(0.0, 0.0, 0.0, 50.0 * pi, side / 100.0).at(50.0 * pi)
    assert (x, y, heading) == pytest.approx((100.0, side * 100.0, side * pi / 2), abs=1e-12)


def test_an_arc_of_hardly_any_curvature_is_a_parabola_to_the_last_digits():
    x, y, _ = Arc(0.0, 0.0, 0.0, 1000.0, 1e-12).at(1000.0)
    assert x == pytest.approx(1000.0, abs=1e-10)
    assert y == pytest.approx(0.5 * 1e-12 * 1000.0**2, rel=1e-9)


@pytest.mark.parametrize(
    ("k0", "k1", "length"),
    [(0.0, 0.01, 200.0), (0.008, -0.004, 300.0), (0.3, 0.0, 100.0), (-0.002, -0.0005, 80.0), (0.05, 0.2, 40.0)],
)
@pytest.mark.parametrize("share", [0.1, 0.37, 0.5, 1.0])
def test_a_clothoid_agrees_with_fresnel_integrals_and_with_quadrature(k0, k1, length, share):
    s = share * length
    x, y, heading = Spiral.of(0.0, 0.0, 0.0, length, k0, k1).at(s)
    k = k0 + share * (k1 - k0)
    # scipy's Fresnel integrals are true to 1e-15 of a scale of 280 m, and two of them are subtracted
    expected = clothoid_end(k0, k, s)
    assert hypot(x - expected.real, y - expected.imag) < 1e-10
    node, weight = np.polynomial.legendre.leggauss(200)
    u = 0.5 * s * (node + 1.0)
    end = 0.5 * s * np.sum(weight * np.exp(1j * (k0 * u + 0.5 * (k1 - k0) / length * u * u)))
    assert hypot(x - end.real, y - end.imag) < 1e-12
    assert heading == pytest.approx(0.5 * (k0 + k) * share * length, abs=1e-13)


def test_a_clothoid_whose_curvature_does_not_change_is_an_arc():
    spiral, arc = Spiral.of(5.0, 6.0, 1.0, 100.0, -0.02, -0.02), Arc(5.0, 6.0, 1.0, 100.0, -0.02)
    for ds in np.linspace(0.0, 100.0, 7):
        assert spiral.at(ds) == pytest.approx(arc.at(ds), abs=1e-12)


def test_a_clothoid_with_a_curvature_change_near_zero_loses_nothing():
    # Fresnel integrals would need arguments of 1e9 here; the small-angle integral is exact to 1e-20
    x, y, _ = Spiral.of(0.0, 0.0, 0.0, 200.0, 1e-9, -1e-9).at(200.0)
    expected, _ = quad(lambda u: 1e-9 * u - 0.5 * 1e-11 * u * u, 0.0, 200.0)
    assert x == pytest.approx(200.0, abs=1e-12)
    assert y == pytest.approx(expected, abs=1e-12)


def test_the_power_series_obeys_the_differential_equation():
    series = tangent_series(0.3, -0.2, 12)
    u = 0.5
    tangent = sum(a * u**n for n, a in enumerate(series))
    phase = 0.3 * u - 0.1 * u * u
    assert tangent == pytest.approx(complex(cos(phase), sin(phase)), abs=1e-12)


def test_pieces_join_and_turn_little():
    pieces = clothoid_pieces(0.0, 0.0, 0.0, 100.0, 0.3, -0.003)
    for before, after in pairwise(pieces):
        ends = []
        for piece, s in ((before, before.end), (after, after.start)):
            u = s - piece.middle
            ends.append([sum(a * u**n for n, a in enumerate(series)) for series in (piece.x_series, piece.y_series)])
        assert ends[0] == pytest.approx(ends[1], abs=1e-12)
        assert abs(before.curvature) * (before.end - before.start) <= 0.5


def parabola(u: float) -> tuple[float, float]:
    """The curve of cubics.xodr in the world."""
    v = 0.002 * u * u
    return 10.0 + u * cos(0.3) - v * sin(0.3), 20.0 + u * sin(0.3) + v * cos(0.3)


def parabola_arc(u: float) -> float:
    """Its arc length, in closed form: v' = q = 0.004 u."""
    q = 0.004 * u
    return (q * sqrt(1.0 + q * q) + np.arcsinh(q)) / 0.008


@pytest.mark.parametrize("road", ["poly3", "normalized"])
@pytest.mark.parametrize("u", [0.0, 1.0, 13.7, 50.0, 99.9])
def test_a_cubic_is_run_through_by_arc_length(road, u):
    network = read_opendrive(VALID / "cubics.xodr")
    x, y, heading = network.roads[network.index_of(road)].reference_at(parabola_arc(u))
    assert (x, y) == pytest.approx(parabola(u), abs=1e-7)
    assert heading == pytest.approx(0.3 + np.arctan(0.004 * u), abs=1e-9)


def test_a_parameter_range_in_metres_ends_at_the_length_and_is_scaled_to_it():
    network = read_opendrive(VALID / "cubics.xodr")
    road = network.roads[network.index_of("arcLength")]
    assert road.reference_at(100.0)[:2] == pytest.approx(parabola(100.0), abs=1e-12)
    # the curve is 102.6 m long, the road says 100: half of the road is half of the curve
    assert parabola_arc(100.0) == pytest.approx(102.60606304268447, abs=1e-9)
    x, y, _ = road.reference_at(50.0)
    u = (x - 10.0) * cos(0.3) + (y - 20.0) * sin(0.3)
    assert parabola_arc(u) == pytest.approx(0.5 * parabola_arc(100.0), abs=1e-6)


def test_the_curvature_of_a_cubic_is_that_of_its_curve():
    network = read_opendrive(VALID / "cubics.xodr")
    u = 42.0
    expected = 0.004 / (1.0 + (0.004 * u) ** 2) ** 1.5
    assert network.curvature_at(0, parabola_arc(u)) == pytest.approx(expected, rel=1e-9)


def test_metres_along_an_uneven_cubic_are_metres():
    network = read_opendrive(VALID / "cubics.xodr")
    index = network.index_of("bend")
    s = np.linspace(0.0, network.roads[index].length, 2001)
    poses = network.road_to_world(index, s)
    steps = np.hypot(np.diff(poses.x), np.diff(poses.y))
    # p(ds) is cubic between 32 nodes; the reference player's own table of 100 straight pieces is rougher
    assert np.ptp(steps) < 5e-4 * steps.mean()
