"""Profiles along s for arrays of places: piecewise cubics of roads, heights of lanes.

References
----------
.. [1] ASAM OpenDRIVE 1.8, section 10.5 (elevation, superelevation) and section 11.6 (height of lanes).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.road.lanes import Lane
from xosc_lateral.road.lookup import IndexLike, Lookup
from xosc_lateral.road.piecewise import PiecewiseCubic
from xosc_lateral.road.positions import FloatArray


class Cubics:
    """Piecewise cubics of several owners."""

    def __init__(self, functions: Sequence[PiecewiseCubic]) -> None:
        """Gather the pieces."""
        self._lookup = Lookup([function.starts for function in functions])
        self._table = np.array([cubic for function in functions for cubic in function.cubics]).T.copy()
        self.is_zero = not self._table.any()

    def at(self, owner: IndexLike, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and derivatives. Shape as `s`. [m]"""
        piece = self._lookup.find(owner, s)
        ds = s - self._lookup.starts[piece]
        a, b, c, d = (values[piece] for values in self._table)
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + (3.0 * ds) * d)


class HeightTable:
    """Heights of lanes over the road surface (kerbs), linear from one record to the next."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        """Gather the records of all lanes; a lane without any lies on the road."""
        records = [lane.heights or ((0.0, 0.0, 0.0),) for lane in lanes]
        self.any = any(lane.heights for lane in lanes)
        self._lookup = Lookup([[s for s, _, _ in own] for own in records])
        self._table = np.array([piece for own in records for piece in _linear_pieces(own)]).T.copy()

    def at(
        self, row: IndexLike, s: FloatArray, from_centre: FloatArray, width: FloatArray, lane: IndexLike
    ) -> FloatArray:
        """Height `from_centre` (along t) of lanes of this width and id, linear across the lane. Shape as `s`. [m]"""
        piece = self._lookup.find(row, s)
        ds = np.maximum(s - self._lookup.starts[piece], 0.0)
        inner, inner_slope, outer, outer_slope = (values[piece] for values in self._table)
        low, high = inner + ds * inner_slope, outer + ds * outer_slope
        # a lane of no width has no inside: its inner edge counts
        narrow = width <= 0.0
        outwards = np.sign(lane) * from_centre / np.where(narrow, 1.0, width)
        across = np.where(narrow, 0.0, np.clip(0.5 + outwards, 0.0, 1.0))
        return np.asarray(low + across * (high - low))


def _linear_pieces(records: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float, float]]:
    """Inner height and its slope, outer height and its slope, from each record to the next."""
    pieces = []
    for (s, inner, outer), (end, inner_end, outer_end) in zip(records, [*records[1:], records[-1]], strict=True):
        length = end - s if end > s else np.inf
        pieces.append((inner, (inner_end - inner) / length, outer, (outer_end - outer) / length))
    return pieces
