"""Places in lanelets, against geometry by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from xosc_lateral.extras.recordings.importers.commonroad import _Lanelet


def test_places_in_a_lanelet_are_known_from_its_first_point_to_its_last() -> None:
    """4 m wide, 100 m along x, with a point on either bound every 10 m; what is beyond its ends has no way along it."""
    along = np.arange(0.0, 101.0, 10.0)
    bounds = {f"{side}_vertices": np.stack([along, y * np.ones(11)], 1) for side, y in (("left", 2.0), ("right", -2.0))}
    x, y = np.array([-0.02, 0.02, 34.5, 99.98, 100.02]), np.array([0.0, 0.3, -1.5, 1.0, 0.0])
    way, offset, width, direction, curvature = _Lanelet(SimpleNamespace(**bounds)).place(x, y)
    np.testing.assert_allclose(way, [np.nan, 0.02, 34.5, 99.98, np.nan], atol=1e-9)
    np.testing.assert_allclose([offset, width], [y, np.full(5, 4.0)], atol=1e-9)
    np.testing.assert_allclose([direction, curvature], 0.0, atol=1e-9)
