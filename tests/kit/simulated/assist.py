"""Drives of which a lane-keeping assist steers a part, in the layout of openpilot logs, with known truth.

The assist is a controller in the same car: it lets hardly any error pass, its hand does not shake, it does not change
its mind about the middle, and it holds a place of its own. That assists keep to one place where humans move about is
what logs of production cars show [1]_.

References
----------
.. [1] "Empirical Performance Evaluation of Lane Keeping Assist on Modern Production Vehicles", arXiv:2505.11534; logs:
   github.com/OpenLKA/OpenLKA, whose columns are the ones written here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from examples.driver_simulator.motorway import STEP
from examples.driver_simulator.plants import Context, Intent

FLAG = "op_lat_enable"
"""Column that says who steers, as OpenLKA calls it."""


@dataclass(frozen=True)
class LaneKeepingAssist:
    """Switched on and off by the driver, for minutes at a time.

    Parameters
    ----------
    place : float
        Where the assist holds the car, less where the driver would; positive: to the left. [m]
    tightness : float
        Error that it lets pass, over what the driver does; its noise likewise. 1: no tighter than the driver. [-]
    spell : float
        Mean time for which it stays on, or off. [s]
    """

    place: float = 0.2
    tightness: float = 0.4
    spell: float = 120.0
    kind: str = "location"
    columns: tuple[str, ...] = (FLAG,)

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Steer while it is on, and log whether it is."""
        on = _spells(len(intent.target), self.spell, rng)
        intent.target += self.place * on
        factor = np.where(on, self.tightness, 1.0)
        intent.tolerance *= factor
        intent.noise *= factor
        context[FLAG] = on.astype(float)


def _spells(n: int, mean: float, rng: np.random.Generator) -> np.ndarray:
    on, start, state = np.zeros(n, dtype=bool), 0, bool(rng.integers(2))
    while start < n:
        stop = start + max(1, round(rng.exponential(mean) / STEP))
        on[start:stop] = state
        start, state = stop, not state
    return on


def openlka_layout(table: pd.DataFrame) -> pd.DataFrame:
    """A simulated drive as OpenLKA writes one: lane lines from the car's middle, right positive; lists as text."""
    return pd.DataFrame(
        {
            "Time": table["time"],
            FLAG: table[FLAG] > 0.5,
            "vEgo": table["speed"],
            "vision_dist": table["lead_distance"],
            "op_curvature_actual": table["yaw_rate"] / table["speed"],
            "op_state_steer_angle": table["steering_wheel_angle"],
            "op_lane_change_state": "off",
            "op_laneline_t": "[0, 0.0127, 0.0510]",
            "op_left_laneline": -table["distance_left"],
            "op_right_laneline": table["distance_right"],
        }
    )


OPENLKA_MAP = ("time=Time", "distance_left=op_left_laneline:-m", "distance_right=op_right_laneline", "speed=vEgo")
"""What ``--map`` needs for such a table."""
