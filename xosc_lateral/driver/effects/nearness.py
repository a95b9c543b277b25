"""A neighbour's influence: none where there is none, and the stronger the nearer it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect

FloatArray = NDArray[np.float64]


class Nearness(SingleColumnEffect, frozen=True, kw_only=True):
    """scale / max(|distance|, scale): 1 from touching up to `scale`, fading beyond, 0 where there is none (NaN).

    Parameters
    ----------
    column : str
        A distance; NaN: there is none.
    scale : float
        In the column's unit. Infinite is not allowed; a very large one makes it "there is one" (see `presence`).
        [unit of the column]
    presence : bool
        True: 1 wherever there is one, at whatever distance.
    """

    scale: float = 1.0
    presence: bool = False

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "presence" if self.presence else "nearness (1 / distance)"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """From 0 (none) to 1, shape (n, 1). [-]"""
        distance = np.abs(context[self.column])
        there = np.isfinite(distance)
        if self.presence:
            return there.astype(np.float64)[:, None]
        near = self.scale / np.maximum(np.where(there, distance, 1.0), self.scale)
        return np.where(there, near, 0.0)[:, None]
