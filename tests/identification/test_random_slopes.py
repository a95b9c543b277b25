"""Drivers that differ in their answer: the spread of their slopes is recovered, and is not seen where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from tests.identification.test_between import STEP, wander
from xosc_lateral.driver.effects import Linear
from xosc_lateral.drives.drive import Drive
from xosc_lateral.identification.random_slopes import slope_deviation
from xosc_lateral.identification.regression import Coarse, fit_model
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.timeline import join_drives


def answering(deviation: float, number: int = 60, seconds: float = 60.0) -> Coarse:
    """Drivers who move by 0.15 m for a unit of `near`, give or take `deviation`."""
    rng = np.random.default_rng(11)
    made = []
    for index in range(number):
        n = round(seconds / STEP)
        near = wander(rng, n, 8.0)
        slope = 0.15 + deviation * rng.normal()
        offset = 0.1 * rng.normal() + slope * near + 0.1 * wander(rng, n, 4.0)
        context = {"near": near, "speed": np.full(n, 30.0)}
        made.append(Drive(f"drive-{index:02d}", STEP * np.arange(n), offset, np.full(n, 3.6), context))
    return Coarse.of(join_drives(made))


@pytest.mark.parametrize("deviation", [0.0, 0.08], ids=["alike", "different"])
def test_the_spread_of_slopes_is_recovered(deviation: float) -> None:
    term = MeanTerm.of(Linear(acts="location", column="near"))  # type: ignore[arg-type]
    found = slope_deviation(fit_model(answering(deviation), (term,)), term)
    assert found == pytest.approx(deviation, rel=0.3)
