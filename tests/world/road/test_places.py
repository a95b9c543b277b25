"""Turns within a sloped surface against rotations of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from xosc_lateral.world.road.road import turn_for_heading, turned_in_surface

SLOPES = [(0.0, 0.0), (0.1, 0.0), (0.0, -0.1), (0.3, -0.2), (-0.2, 1.05)]
TURNS = [0.0, 0.05, -1.2, 1.6, 3.0, -3.1]


@pytest.mark.parametrize(("pitch", "roll"), SLOPES)
@pytest.mark.parametrize("turn", TURNS)
def test_a_turn_in_a_surface_is_a_rotation_about_its_normal(turn: float, pitch: float, roll: float) -> None:
    surface = Rotation.from_euler("ZYX", [0.0, pitch, roll])
    turned = Rotation.from_euler("ZYX", turned_in_surface(turn, pitch, roll))
    np.testing.assert_allclose(turned.as_matrix(), (surface * Rotation.from_euler("Z", turn)).as_matrix(), atol=1e-12)


@pytest.mark.parametrize(("pitch", "roll"), SLOPES)
@pytest.mark.parametrize("turn", TURNS)
def test_the_turn_for_a_heading_leads_to_that_heading(turn: float, pitch: float, roll: float) -> None:
    change, _, _ = turned_in_surface(turn, pitch, roll)
    assert turn_for_heading(change, pitch, roll) == pytest.approx(turn, abs=1e-12)
