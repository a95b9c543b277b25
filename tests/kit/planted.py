"""Half an hour of a movement that no driver model made, with columns that nobody responds to and effects of them."""

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from examples.driver_simulator.motorway import first_order
from tests.kit.simulated.movements import ornstein_uhlenbeck, record_movement
from xosc_lateral.extras.loop.timeline import Coarse, join_drives
from xosc_lateral.files.drives import drives_of_table

FloatArray = NDArray[np.float64]
STEP = 0.1

Shift = Callable[[Mapping[str, FloatArray]], FloatArray]


def planted_drive(shift: Shift, seed: int, names: tuple[str, ...] = ("gust",), smooth: int = 0) -> Coarse:
    """Offsets moved by what `shift` makes of the columns, each of unit variance with a memory of 10 s, as a driver
    responds within 2 s; smoothed by a Gaussian of so many steps in the end."""
    from scipy.ndimage import gaussian_filter1d

    table = record_movement(ornstein_uhlenbeck, 1800.0, seed)
    time = table["time"].to_numpy()
    grid = np.arange(time[0], time[-1] + STEP, STEP)
    columns = {}
    for name, rng in zip(names, np.random.default_rng(seed).spawn(len(names)), strict=True):
        column = first_order(rng.normal(size=len(grid)), np.exp(-STEP / 10.0))
        columns[name] = (column - column.mean()) / column.std()
    keep = np.exp(-STEP / 2.0)
    offset = np.interp(grid, time, 0.5 * (table["distance_right"] - table["distance_left"]).to_numpy())
    offset = offset + first_order(shift(columns), keep, gain=1.0 - keep)
    if smooth:
        offset = gaussian_filter1d(offset, float(smooth), mode="nearest")
    moved = pd.DataFrame({"time": grid, "offset": offset, "lane_width": 3.6, **columns})
    return Coarse.of(join_drives(drives_of_table(moved, {})))
