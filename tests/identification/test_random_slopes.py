"""Drivers that differ in their response: the spread of their slopes is recovered; where there is none, none is seen."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from tests.identification.test_between import STEP, wander
from xosc_lateral.driver.effects import Linear
from xosc_lateral.drives.drive import Drive
from xosc_lateral.identification.regression import Coarse, fit_model
from xosc_lateral.identification.terms.mean import MeanTerm, slope_deviation
from xosc_lateral.identification.timeline import join_drives


def responding(deviation: float, smooth: float = 0.0, movement: float = 0.1, memory: float = 4.0) -> Coarse:
    """Drivers who move by 0.15 m for a unit of `near`, give or take `deviation`; tracks through a Gaussian [rows]."""
    rng = np.random.default_rng(11)
    made = []
    for index in range(60):
        n = round(60.0 / STEP)
        near = wander(rng, n, 8.0)
        slope = 0.15 + deviation * rng.normal()
        offset = 0.1 * rng.normal() + slope * near + movement * wander(rng, n, memory)
        if smooth:
            offset = gaussian_filter1d(offset, smooth, mode="nearest")
        context = {"near": near, "speed": np.full(n, 30.0)}
        made.append(Drive(f"drive-{index:02d}", STEP * np.arange(n), offset, np.full(n, 3.6), context))
    return Coarse.of(join_drives(made))


@pytest.mark.parametrize("deviation", [0.0, 0.08], ids=["alike", "different"])
def test_the_spread_of_slopes_is_recovered(deviation: float) -> None:
    term = MeanTerm.of(Linear(acts="location", column="near"))  # type: ignore[arg-type]
    found = slope_deviation(fit_model(responding(deviation), (term,)), term)
    assert found == pytest.approx(deviation, rel=0.3)


def test_drivers_who_are_alike_stay_so_although_their_tracks_were_smoothed() -> None:
    """A floor leaves memory in the whitened rows: taken for independent, they would be drivers that differ."""
    term = MeanTerm.of(Linear(acts="location", column="near", response_s=0.3))  # type: ignore[arg-type]
    coarse = responding(0.0, smooth=0.7 / STEP, movement=0.05, memory=8.0)
    assert slope_deviation(fit_model(coarse, (term,)), term) == 0.0
