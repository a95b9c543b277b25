"""Whitening by the autoregression of the movement, for generalised least squares.

Exact within each run: the first rows use the lower-order predictors of the same process, and runs are independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.movement_process import (
    MovementProcess,
    moving_sum,
    positions_in_run,
)
from xosc_lateral.mask import stretches_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Whitener:
    """Turns series on the grid into independent rows of variance 1, the drives' own levels taken out.

    Parameters
    ----------
    process : MovementProcess
        Of the movement divided by `scale`.
    valid : bool array, shape (n,)
    drive : int array, shape (n,)
        Which level a row has; increasing.
    scale : array, shape (n,)
        Factor on the movement at each row.
    runs : tuple of slice, optional
        Rows of each run, where they stand side by side without anything invalid in between.
    """

    process: MovementProcess
    valid: BoolArray
    drive: IntArray
    scale: FloatArray
    runs: tuple[slice, ...] = ()

    @cached_property
    def compact(self) -> Whitener:
        """The same for the valid rows alone, put side by side: half the work where drives are short."""
        ends = np.cumsum([run.stop - run.start for run in self._runs])
        runs = tuple(
            slice(int(end) - (run.stop - run.start), int(end)) for run, end in zip(self._runs, ends, strict=True)
        )
        _, drive = np.unique(self.drive[self.valid], return_inverse=True)
        valid = np.ones(int(self.valid.sum()), dtype=np.bool_)
        return Whitener(self.process, valid, drive.astype(np.intp), self.scale[self.valid], runs)

    @cached_property
    def _runs(self) -> list[slice]:
        if self.runs:
            return list(self.runs)
        return stretches_of(self.valid)

    @cached_property
    def _edges(self) -> IntArray:
        return np.searchsorted(self.drive, np.arange(int(self.drive.max()) + 1)).astype(np.intp)

    def by_position(self, values: FloatArray) -> FloatArray:
        """What belongs to a row by its place in its run, shape (n,); `values`: shape (order + 1,), the last for all
        later rows."""
        return values[np.clip(positions_in_run(self.valid), 0, self.process.order)]

    @property
    def deviations(self) -> FloatArray:
        """What each row is divided by, predictor and scale, shape (n,). [m]"""
        return self.by_position(self.process.deviations) * self.scale

    @cached_property
    def ones(self) -> FloatArray:
        """A level of 1 m, whitened, shape (n,). [-]"""
        return self.white(np.ones(len(self.valid)))

    @cached_property
    def power(self) -> FloatArray:
        """What every drive tells of its level: 1 / variance, > 0, shape (drives,). [1/m2]"""
        return np.add.reduceat(self.ones**2, self._edges)

    def white(self, values: FloatArray) -> FloatArray:
        """Whitened, levels still in; 0 at invalid rows; shape and precision of `values`, (n,) or (n, k)."""
        columns = values[:, None] if values.ndim == 1 else values
        scaled = columns / self.scale[:, None].astype(columns.dtype)
        start = self.process.start.astype(columns.dtype)
        if not self.runs:
            scaled = np.where(self.valid[:, None], scaled, 0.0)
        result = moving_sum(self.process.polynomial, scaled)
        for run in self._runs:
            stop = min(run.stop, run.start + self.process.order)
            known = stop - run.start
            result[run.start : stop] = start[:known, :known] @ scaled[run.start : stop]
        if not self.runs:
            result[~self.valid] = 0.0
        return np.asarray(result[:, 0] if values.ndim == 1 else result)

    def without_levels(self, white: FloatArray) -> FloatArray:
        """Take the drives' levels out of whitened rows [-], shape (n,) or (n, k)."""
        columns = white[:, None] if white.ndim == 1 else white
        ones, power = (of.astype(columns.dtype)[:, None] for of in (self.ones, np.maximum(self.power, 1e-30)))
        mean = np.add.reduceat(ones * columns, self._edges, axis=0) / power
        result = columns - ones * mean[self.drive]
        return np.asarray(result[:, 0] if white.ndim == 1 else result)

    def levels(self, values: FloatArray) -> FloatArray:
        """Level of every drive by generalised least squares, shape (drives,). [m]"""
        sums = np.add.reduceat(self.ones * self.white(values), self._edges)
        return np.asarray(sums / np.maximum(self.power, 1e-300))

    def rows(self, values: FloatArray) -> FloatArray:
        """Whitened, levels out; shape of `values` [m], the rows of variance 1. [-]"""
        return self.without_levels(self.white(values))
