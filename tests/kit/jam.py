"""Stop and go on a curve, as a sensor sees it: positions with noise, headings and speeds not measured."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tests.kit.stage import WIDTH, arc, map_of, road

RADIUS = 1200.0
"""Of the reference line, which turns to the left. [m]"""

ROAD = map_of(road("1", arc(1.0 / RADIUS, length=1500.0), 1500.0))

LENGTH = 4.5
"""Of all vehicles. [m]"""


def jam(seed: int, noise: float, *, vehicles: int = 5, lasting: float = 80.0) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tracks of the vehicles' middles with white noise [m] in x and y, and where they truly are.

    Speeds go linearly from one to the next of 0 (half of them) and 2 to 12 m/s, every 4 to 9 s.
    """
    rng = np.random.default_rng([53, seed])
    time = np.arange(0.0, lasting, 0.1)
    rows = []
    for number in range(vehicles):
        moments = np.r_[0.0, np.cumsum(rng.uniform(4.0, 9.0, 20))]
        speeds = np.where(rng.random(len(moments)) < 0.5, 0.0, rng.uniform(2.0, 12.0, len(moments)))
        speed = np.interp(time, moments, speeds)
        s = 200.0 + 20.0 * number + np.r_[0.0, np.cumsum(0.05 * (speed[1:] + speed[:-1]))]
        t = (-1.5 if number % 2 else -0.5) * WIDTH + 0.15 * np.sin(2.0 * np.pi * s / 90.0)
        x, y = (RADIUS - t) * np.sin(s / RADIUS), RADIUS - (RADIUS - t) * np.cos(s / RADIUS)
        rows.append(pd.DataFrame({"id": f"j{number}", "time": time, "x": x, "y": y, "length": LENGTH, "width": 1.8}))
    truth = pd.concat(rows, ignore_index=True)
    return truth.assign(**{axis: truth[axis] + rng.normal(0.0, noise, len(truth)) for axis in "xy"}), truth
