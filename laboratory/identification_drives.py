"""Drives with planted effects for the protocol of proof (docs/validation/identification.toml).

Effects are planted on the table itself: what the car does is a movement that knows nothing of the context, plus the
response to a quantity through a delay and two first-order lags, which no candidate of the method is.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from examples.driver_simulator import simulate_drive
from tests.kit.simulated.movements import (
    bursts,
    clustered,
    delayed_control,
    free_play,
    heavy_tailed,
    long_memory,
    lopsided,
    ornstein_uhlenbeck,
    oscillating,
    pursuit,
    rate_limited,
    record_movement,
    reflected,
    sawtooth,
    zigzag,
)

Values = np.ndarray
MOVEMENTS = {
    "wandering": ornstein_uhlenbeck,
    "heavy_tailed": heavy_tailed,
    "reflected": reflected,
    "delayed_control": delayed_control,
    "clustered": clustered,
    "bursts": bursts,
    "lopsided": lopsided,
    "pursuit": pursuit,
    "oscillating": oscillating,
    "sawtooth": sawtooth,
    "long_memory": long_memory,
    "free_play": free_play,
    "zigzag": zigzag,
    "rate_limited": rate_limited,
}
FOLLOWING = ["steering_wheel_angle", "yaw_rate"]


def long_drive(movement: str, duration: float, seed: int) -> pd.DataFrame:
    """A drive on which nothing acts."""
    if movement == "steering":
        return simulate_drive(duration, seed).table.drop(columns=FOLLOWING)
    table = record_movement(MOVEMENTS[movement], duration, seed)
    return table.drop(columns=[name for name in FOLLOWING if name in table])


def offset_of(table: pd.DataFrame) -> Values:
    """Offset from the lane centre [m]."""
    return 0.5 * (table["distance_right"] - table["distance_left"]).to_numpy()


def moved(table: pd.DataFrame, shift: Values) -> pd.DataFrame:
    """The car that much further left."""
    return table.assign(distance_left=table["distance_left"] - shift, distance_right=table["distance_right"] + shift)


def smoothed_tracks(table: pd.DataFrame) -> pd.DataFrame:
    """Offsets as a provider of tracks delivers them, effects and all: through a Gaussian of 0.7 s in both directions of
    time, which leaves 42 % of the amplitude at 0.3 Hz and 9 % at 0.5 Hz."""
    step, late = 0.1, 0.7
    places = table["offset"].to_numpy() if "offset" in table else offset_of(table)
    drives = table["drive"].to_numpy() if "drive" in table else np.zeros(len(table), dtype=int)
    smooth = np.empty(len(table))
    for name in pd.unique(drives):
        rows = drives == name
        time = table["time"].to_numpy()[rows]
        grid = np.arange(time[0], time[-1] + step, step)
        even = np.interp(grid, time, places[rows])
        smooth[rows] = np.interp(time, grid, gaussian_filter1d(even, late / step, mode="nearest"))
    return table.assign(offset=smooth) if "offset" in table else moved(table, smooth - places)


def quantity(name: str, table: pd.DataFrame) -> Values:
    """Driving quantity of a kind, shape (n,)."""
    column = {key: table[key].to_numpy(dtype=float) for key in table if key != "drive"}
    lead = column.get("lead_distance", np.full(len(table), np.nan))

    def near(distance: Values, scale: float) -> Values:
        return np.nan_to_num(np.exp(-distance / scale), nan=0.0)

    if name == "cross wind":
        return column["wind_speed"] * np.sin(np.radians(column["wind_direction"]))
    if name == "leader, saturating":
        return np.nan_to_num(np.tanh(np.maximum(1.0 - lead / 90.0, -1.0)), nan=0.0)
    if name == "sign changes with speed":
        return column["crossfall"] * (column["speed"] - np.median(column["speed"]))
    if name == "leader in one lane only":
        return near(lead, 40.0) * (column["lane_index"] == 0)
    if name == "grade, threshold":
        return (column["grade"] > np.quantile(column["grade"], 0.7)).astype(float)
    if name == "crossfall, levelling off":
        return np.tanh(column["crossfall"] / 1.5)
    if name == "spread by leader":
        return near(lead, 40.0)
    if name == "neighbour on the right, left lane":
        return near(column["right_distance"], 25.0)
    if name == "both neighbours":
        return near(column["right_distance"], 25.0) - 0.5 * near(column["left_distance"], 25.0)
    plain = {
        "curvature": "curvature",
        "truck alongside": "truck_right",
        "spread by rain": "rain",
        "spread by speed": "speed",
    }
    return column[plain.get(name, "right_is_truck")]


def unit(values: Values) -> Values:
    """Changes by 1 between its 5 % and 95 % quantile, about its median."""
    return np.asarray((values - np.quantile(values, 0.5)) / range_of(values))


def range_of(values: Values) -> float:
    """Between the 5 % and 95 % quantile; of what is nearly always the same, from end to end."""
    low, high = np.quantile(values, [0.05, 0.95])
    if high <= low:
        low, high = values.min(), values.max()
    return max(float(high - low), 1e-12)


def responded(values: Values, time: Values, rng: np.random.Generator) -> Values:
    """Through a delay between 1.5 s ahead and 0.8 s behind, and lags of 0.8-3 s and 0.3 s."""
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + step, step)
    series = np.interp(grid + rng.uniform(-0.8, 1.5), time, values)
    for constant in (rng.uniform(0.8, 3.0), 0.3):
        keep = np.exp(-step / constant)
        series = lfilter([1.0 - keep], [1.0, -keep], series, zi=[keep * series[0]])[0]
    return np.interp(time, grid, series)


def parts_of(name: str, table: pd.DataFrame) -> tuple[Values, ...]:
    """What a kind's driving quantity is the sum of: columns of its own act in each part."""
    if name != "both neighbours":
        return (quantity(name, table),)
    right = quantity("neighbour on the right, left lane", table)
    return right, quantity(name, table) - right


def with_mean(table: pd.DataFrame, kind: str, size: float, seed: int, part: Values | None = None) -> pd.DataFrame:
    """Plant an effect on the mean, drive by drive with one driver's response; or a part of it alone."""
    shift = np.zeros(len(table))
    whole = quantity(kind, table)
    values = unit(whole) if part is None else part / range_of(whole)
    drives = table["drive"].to_numpy() if "drive" in table else np.zeros(len(table), dtype=int)
    for name in pd.unique(drives):
        rows = drives == name
        shift[rows] = size * responded(values[rows], table["time"].to_numpy()[rows], np.random.default_rng([7, seed]))
    return table.assign(offset=table["offset"] + shift) if "offset" in table else moved(table, shift)


def with_spread(table: pd.DataFrame, kind: str, factor: float, seed: int) -> pd.DataFrame:
    """Plant an effect on the size of the movement."""
    time, rng = table["time"].to_numpy(), np.random.default_rng([8, seed])
    strength = np.log(factor) * unit(responded(unit(quantity(kind, table)), time, rng))
    offset = offset_of(table)
    return moved(table, (offset - np.median(offset)) * (np.exp(strength) - 1.0))


def baited(table: pd.DataFrame, bait: str, seed: int) -> pd.DataFrame:
    """Add a column that follows from the movement, or invites a mistake; nothing acts."""
    rng, offset, time = np.random.default_rng([9, seed]), offset_of(table), table["time"].to_numpy()
    step = float(np.median(np.diff(time)))

    def low_pass(values: Values, constant: float) -> Values:
        keep = np.exp(-step / constant)
        return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values))

    if bait.startswith("torque"):
        beyond = np.sign(offset) * np.maximum(np.abs(offset) - 0.25, 0.0)
        torque = -3.0 * low_pass(beyond, 0.4) + 0.02 * rng.normal(size=len(time))
        return table.assign(assist_torque=torque)
    if bait.startswith("lane width"):
        noise = [low_pass(rng.normal(size=len(time)), 2.0) for _ in range(2)]
        left, right = (0.03 * one / one.std() for one in noise)
        return table.assign(distance_left=table["distance_left"] + left, distance_right=table["distance_right"] + right)
    if bait.startswith("filtered"):
        late = round(0.5 / step)
        copy = np.roll(low_pass(offset, 3.0), late)
        return table.assign(channel_7=40.0 * copy + 40.0 * 0.01 * rng.normal(size=len(time)))
    return table


def short_drives(vehicles: int, lengths: tuple[float, float], seed: int) -> pd.DataFrame:
    """Vehicles on two lanes, each seen for about a minute, with the neighbours that they pass and are passed by."""
    rng = np.random.default_rng([10, seed])
    return pd.concat([_vehicle(f"v{number:03d}", lengths, rng) for number in range(vehicles)], ignore_index=True)


def _vehicle(name: str, lengths: tuple[float, float], rng: np.random.Generator) -> pd.DataFrame:
    step = 0.1
    n = round(rng.uniform(*lengths) / step)
    time, lane = step * np.arange(n), int(rng.random() < 0.4)
    speed = (33.0 if lane else 26.0) + 3.0 * rng.normal() + 0.5 * _noise(n, 10.0, step, rng)
    ahead, truck = _neighbours(time, rng)
    other, _ = _neighbours(time, rng)
    own: Mapping[str, Values] = {
        "right_distance": ahead if lane else np.full(n, np.nan),
        "left_distance": np.full(n, np.nan) if lane else ahead,
        "right_is_truck": truck * lane,
        "left_is_truck": truck * (1 - lane) * (rng.random() < 0.2),
        "lead_distance": other,
    }
    place = 0.16 * rng.normal() - 0.08 * lane
    size = np.exp(0.23 * rng.normal())
    movement = size * (0.10 * _noise(n, 3.0, step, rng) + 0.10 * _noise(n, 20.0, step, rng))
    return pd.DataFrame(
        {
            "drive": name,
            "time": time,
            "offset": place + _smooth(movement, step),
            "lane_width": 3.7 + 0.15 * lane,
            "speed": speed,
            "acceleration": np.gradient(speed, step),
            "lane_index": lane,
            "curvature": 2e-4 * np.sin(2.0 * np.pi * (rng.random() + np.cumsum(speed) * step / 2500.0)),
            **own,
        }
    )


def _neighbours(time: Values, rng: np.random.Generator) -> tuple[Values, Values]:
    """Distance to the nearest of a row of vehicles that is passed, 0 while it overlaps, infinite beyond 200 m."""
    places = np.cumsum(rng.exponential(90.0, 12)) - rng.uniform(0.0, 500.0)
    trucks = rng.random(len(places)) < 0.3
    gaps = places[:, None] - rng.uniform(1.0, 7.0) * time
    nearest = np.argmin(np.abs(gaps), axis=0)
    length = np.where(trucks, 16.0, 4.5)[nearest]
    distance = np.maximum(np.abs(gaps[nearest, np.arange(len(time))]) - 0.5 * (length + 4.5), 0.0)
    near = distance < 200.0
    return np.where(near, distance, np.inf), (trucks[nearest] & near).astype(float)


def _noise(n: int, constant: float, step: float, rng: np.random.Generator) -> Values:
    keep = np.exp(-step / constant)
    drawn = rng.normal(size=n) * np.sqrt(1.0 - keep**2)
    drawn[0] = rng.normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], drawn))


def _smooth(values: Values, step: float) -> Values:
    """Content above 0.3 Hz taken away, as a provider of tracks does."""
    keep = np.exp(-step / 0.5)
    return np.asarray(
        lfilter([(1.0 - keep) ** 2], np.convolve([1.0, -keep], [1.0, -keep]), values - values[0]) + values[0]
    )
