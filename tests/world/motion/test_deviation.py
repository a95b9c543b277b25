"""The deviation as a function of the distance driven, against scipy's spline and by its derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from xosc_lateral.world.motion.trajectory import SampledDeviation, deviation_through


def _segment(rng: np.random.Generator, start: float, n: int) -> SampledDeviation:
    distance = start + np.cumsum(rng.uniform(2.0, 7.0, n))
    return SampledDeviation(distance, np.cumsum(rng.normal(0.0, 0.02, n)), (60.0, 60.0))


def test_inside_a_segment_it_is_the_natural_cubic_spline_through_the_samples() -> None:
    segment = _segment(np.random.default_rng(1), 10.0, 60)
    at = np.linspace(segment.distance[0], segment.distance[-1], 999)
    oracle = CubicSpline(segment.distance, segment.deviation, bc_type="natural")
    np.testing.assert_allclose(deviation_through([segment])(at), oracle(at), atol=1e-13)


@pytest.mark.parametrize("gap", [0.5, 8.0, 90.0, 1000.0])
def test_between_segments_value_slope_and_bend_are_continuous(gap: float) -> None:
    rng = np.random.default_rng(2)
    first = _segment(rng, 100.0, 40)
    second = _segment(rng, first.distance[-1] + gap - 2.0, 40)
    deviation = deviation_through([first, second])
    for border in (first.distance[0], first.distance[-1], second.distance[0], second.distance[-1]):
        h = 1e-4
        left = deviation(border - h * np.arange(4.0))
        right = deviation(border + h * np.arange(4.0))
        slope_left, slope_right = (left[0] - left[1]) / h, (right[1] - right[0]) / h
        bend_left = (left[0] - 2 * left[1] + left[2]) / h**2
        bend_right = (right[0] - 2 * right[1] + right[2]) / h**2
        assert slope_left == pytest.approx(slope_right, abs=1e-4)
        assert bend_left == pytest.approx(bend_right, abs=2e-3)


def test_it_stays_between_the_levels_of_the_segments_that_it_leads_over() -> None:
    rng = np.random.default_rng(3)
    first, second = _segment(rng, 0.0, 30), _segment(rng, 900.0, 30)
    between = deviation_through([first, second])(np.linspace(first.distance[-1], second.distance[0], 2001))
    levels = first.deviation[-1], second.deviation[0]
    assert between.max() < max(levels) + 0.25
    assert between.min() > min(levels) - 0.25


def test_before_the_first_and_after_the_last_sample_it_settles_to_a_level() -> None:
    segment = _segment(np.random.default_rng(4), 500.0, 30)
    deviation = deviation_through([segment])
    ahead = deviation(np.array([0.0, 100.0, 300.0]))
    behind = deviation(segment.distance[-1] + np.array([60.0, 80.0, 2000.0]))
    assert np.ptp(ahead) == 0.0
    assert np.ptp(behind) == 0.0
    assert ahead[0] == pytest.approx(segment.deviation[0])
    assert behind[0] == pytest.approx(segment.deviation[-1])


def test_without_a_segment_there_is_no_deviation() -> None:
    assert not deviation_through([])(np.array([0.0, 5.0])).any()


def test_samples_at_the_same_distance_are_refused() -> None:
    with pytest.raises(ValueError, match="strictly increasing"):
        deviation_through([SampledDeviation(np.array([1.0, 1.0]), np.array([0.0, 0.1]), (1.0, 1.0))])
