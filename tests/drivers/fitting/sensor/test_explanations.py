"""Which colour of noise is taken, where nothing is random."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drivers.fitting.sensor.test_likelihood import COLOURED, driver_density, measured
from xosc_lateral.drivers.fitting.sensor.likelihood import Colour, SensorData
from xosc_lateral.drivers.fitting.sensor.periodogram import Periodogram
from xosc_lateral.drivers.fitting.sensor.separation import explanations


def best_of(data: Periodogram):  # type: ignore[no-untyped-def]
    return min(explanations(SensorData(data, np.zeros(len(data.frequency)))), key=lambda one: one.criterion)


@pytest.mark.parametrize(("order", "corner"), [(1, 0.32), (1, 0.92), (2, 0.51)])
def test_a_low_passed_sensor_needs_no_white_noise_and_its_corner_is_found(order: int, corner: float) -> None:
    frequency = np.geomspace(0.02, 1.5, 90)
    density = driver_density(frequency) + 0.02 * Colour(order, corner).shape(frequency)
    found = best_of(Periodogram(frequency, density, np.full(90, 2000.0)))
    assert found.colour.order == order
    assert found.colour.alone
    assert found.colour.corner == pytest.approx(corner, rel=0.05)
    assert np.exp(found.solution.colour) == pytest.approx(0.02, rel=0.1)


def test_white_noise_beside_a_low_passed_part_is_seen_and_white_noise_alone_too() -> None:
    both = best_of(measured(Colour(2, 0.6), weight=2000.0))
    assert (both.colour.order, both.colour.alone) == (2, False)
    assert both.colour.corner == pytest.approx(0.6, rel=0.1)
    assert np.exp(both.solution.colour) == pytest.approx(COLOURED, rel=0.3)
    assert best_of(measured()).colour == Colour()
