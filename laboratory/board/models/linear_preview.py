"""The linear driver model with curvature nodes: where in the lane a driver wants to be, from the road ahead.

After Ignéczi and Horváth, 2024; see `source`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.simulated import SimulatedModel, driver_means_of
from xosc_lateral.drivers.drives.drive import STEP, Run

FloatArray = NDArray[np.float64]

NODES = (0.0, 25.0, 50.0, 75.0)
"""The vehicle and three nodes ahead of it; curvature is averaged between neighbours. [m]"""

SMALLEST = 0.05
"""Singular values below this share of the largest are left out: on a motorway the curvatures between the nodes are
nearly the same, and their difference would be fitted to noise. [-]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearPreview(SimulatedModel):
    """Offset = the vehicle's mean + gains for left curves, or for right curves, times the mean curvatures ahead.

    Parameters
    ----------
    left, right : array, shape (3,)
        Gains on the mean curvature (its part > 0 and < 0) between the nodes. [m2]
    """

    left: FloatArray = field(default_factory=lambda: np.zeros(3))
    right: FloatArray = field(default_factory=lambda: np.zeros(3))

    title: ClassVar[str] = "linear preview (Győr)"
    source: ClassVar[str] = (
        "G. Ignéczi, E. Horváth, linear driver model: Automotive Innovation 2024, doi:10.1007/s42154-023-00259-8; "
        "Modeling Human Lane Following Behavior, IEEE Access 13, 2025, doi:10.1109/ACCESS.2025.3646260; nodes: "
        "launch/plan_lat_lane_follow_ldm.launch.py in github.com/jkk-research/plan_lateral_planner_ldm"
    )
    departures: ClassVar[str] = (
        "the offset is the model's at the vehicle, not a clothoid through three node points; each driver's offset on "
        "the straight is its own: what its start leaves once the curve is taken off"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Least squares within drivers."""
        rows, values = [], []
        for name in sorted({run.drive for run in runs}):
            own = [run for run in runs if run.drive == name]
            columns = np.concatenate([_columns(*_road(run)) for run in own])
            offset = np.concatenate([run.offset for run in own])
            rows.append(columns - columns.mean(axis=0))
            values.append(offset - offset.mean())
        x, y = np.concatenate(rows), np.concatenate(values)
        scale = np.sqrt((x**2).mean(axis=0))
        used = scale > 1e-9
        gains = np.zeros(6)
        if used.any():
            gains[used] = np.linalg.lstsq(x[:, used] / scale[used], y, rcond=SMALLEST)[0] / scale[used]
        return cls(driver_means=driver_means_of(runs), left=gains[:3], right=gains[3:])

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """See `SimulatedModel.simulate`."""
        plan = np.array([self.plan(c, v) for c, v in zip(batch.curvature, batch.speed, strict=True)])
        return np.asarray(plan - plan[:, :1] + batch.start[:, None])

    def plan(self, curvature: FloatArray, speed: FloatArray) -> FloatArray:
        """Offset from the vehicle's mean, shape (m,). [m]"""
        return np.asarray(_columns(curvature, speed) @ np.concatenate([self.left, self.right]))

    @property
    def settings(self) -> Mapping[str, float]:
        """Gains for the curvature between the nodes. [m2]"""
        names = [f"{side}_{a:g}_{b:g}_m2" for side in ("left", "right") for a, b in pairwise(NODES)]
        return dict(zip(names, [*self.left.tolist(), *self.right.tolist()], strict=True))


def _road(run: Run) -> tuple[FloatArray, FloatArray]:
    curvature = run.context.get("curvature")
    speed = np.full(len(run), 30.0) if run.speed is None else np.nan_to_num(run.speed, nan=30.0)
    return np.zeros(len(run)) if curvature is None else np.nan_to_num(curvature), speed


def _columns(curvature: FloatArray, speed: FloatArray) -> FloatArray:
    """Mean curvature between the nodes ahead of each row, left curves and right curves apart, shape (m, 6). [1/m]

    Beyond the end of what is known the road goes on as it is there.
    """
    place = np.concatenate([[0.0], np.cumsum(np.maximum(speed[:-1], 0.1) * STEP)])
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * np.diff(place))])
    beyond = place[-1] + NODES[-1] + 1.0
    place, turned = np.append(place, beyond), np.append(turned, turned[-1] + curvature[-1] * (beyond - place[-1]))
    heads = [np.interp(place[:-1] + node, place, turned) for node in NODES]
    spans = pairwise(NODES)
    means = np.column_stack([(b - a) / (y - x) for (a, b), (x, y) in zip(pairwise(heads), spans, strict=True)])
    return np.hstack([np.maximum(means, 0.0), np.minimum(means, 0.0)])
