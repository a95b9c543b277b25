"""What recorded traffic says of its own vehicles, as `drivers.drives.evidence` of drives.

The same vehicle twice: middles in each other's boxes for half of the time; driven through: by two vehicles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from xosc_lateral.base.arrays import BLOCK, FloatArray, IntArray
from xosc_lateral.base.lazy import spatial
from xosc_lateral.drivers.drives.evidence import UNIT_SIZES, noisy

USUAL_WIDTH = 1.8  # [m]
USUAL_WIDTHS = 1.4, 2.7  # of cars to trucks in the median, with what errs [m]
MOST_WIDTH = 3.5  # median: 2.55 m are allowed (directive 96/53/EC), boxes err by decimetres [m]


def of_noise(x: FloatArray, y: FloatArray, heading: FloatArray, vehicle: IntArray) -> str | None:
    """Whether places are too noisy for lane changes: who is settled looks as if not, in 3 rows of 1000."""
    if len(x) < 100:
        return None
    way = heading[1:-2]
    third = (np.cos(way) * np.diff(y, 3) - np.sin(way) * np.diff(x, 3))[vehicle[3:] == vehicle[:-3]]
    return noisy(1.4826 * float(np.nanmedian(np.abs(third))) / np.sqrt(20.0) if np.isfinite(third).any() else 0.0)


def of_sizes(length: FloatArray, width: FloatArray | None) -> str | None:
    """Whether lengths and widths are exchanged, or in another unit."""
    known = np.isfinite(length) & (length > 0.0)
    wide = np.full_like(length, np.nan) if width is None else width
    both = known & np.isfinite(wide) & (wide > 0.0)
    if both.any() and (share := float((wide[both] > length[both]).mean())) > 0.5:
        return f"{100 * share:.0f} % of the vehicles are wider than long: length and width are exchanged"
    if known.any() and (median := float(np.median(length[known]))) > 60.0:
        return f"vehicles are {median:.4g} m long: length=COLUMN:{'cm' if median < 6000.0 else 'mm'}"
    broad = float(np.median(wide[both])) if both.any() else 0.0
    unit = next((unit for unit, by in UNIT_SIZES.items() if USUAL_WIDTHS[0] < broad / by < USUAL_WIDTHS[1]), None)
    if broad > MOST_WIDTH and unit:
        sizes, places = (f"{a}=COLUMN:{unit}, {b}=COLUMN:{unit}" for a, b in (("length", "width"), ("x", "y")))
        return f"vehicles are {broad:.3g} m wide: {sizes}; and {places}, if these are too"
    return None


def overlaps(
    time: FloatArray, x: FloatArray, y: FloatArray, heading: FloatArray, length: FloatArray, width: FloatArray,
    vehicle: IntArray, step: float,
) -> Mapping[tuple[int, int], float]:  # fmt: skip
    """Pairs of vehicles of which one's middle lies in the other, and how long: sizes may be wrong by half. [s]"""
    good = np.flatnonzero(np.isfinite(time + x + y + heading))
    good = good[np.argsort(time[good], kind="stable")]
    instant, near = np.round((time[good] - time.min()) / step), [np.zeros((0, 2), dtype=np.intp)]
    for part in np.split(np.arange(len(good)), np.searchsorted(instant, instant[BLOCK::BLOCK])):  # instants are whole
        places = np.column_stack([x[good[part]], y[good[part]], 1e3 * instant[part]])
        near.append(good[part[spatial.cKDTree(places - places[:1]).query_pairs(8.0, output_type="ndarray")]])
    first, second = np.concatenate(near).T
    other = vehicle[first] != vehicle[second]
    first, second = first[other], second[other]
    over = np.zeros(len(first), dtype=np.bool_)
    for row, other_row in ((first, second), (second, first)):
        c, s = np.cos(heading[row]), np.sin(heading[row])
        dx, dy = x[other_row] - x[row], y[other_row] - y[row]
        over |= (np.abs(c * dx + s * dy) < 0.5 * length[row]) & (np.abs(c * dy - s * dx) < 0.5 * width[row])
    a, b = np.minimum(vehicle[first], vehicle[second])[over], np.maximum(vehicle[first], vehicle[second])[over]
    pairs, count = np.unique(np.column_stack([a, b]), axis=0, return_counts=True)
    return {(int(i), int(j)): n * step for (i, j), n in zip(pairs.tolist(), count.tolist(), strict=True)}


def of_vehicles(
    names: Sequence[str], vehicle: IntArray, time: FloatArray, x: FloatArray, y: FloatArray, heading: FloatArray,
    length: FloatArray, width: FloatArray | None, step: float,
) -> list[str]:  # fmt: skip
    """Who is there twice, who drives through whom, and noise: a line each."""
    wide = np.full(len(x), USUAL_WIDTH) if width is None else width
    lines = [line] if (line := of_noise(x, y, heading, vehicle)) else []
    begin, end = (np.searchsorted(vehicle, np.arange(len(names)), side=side) for side in ("left", "right"))
    lasting = time[end - 1] - time[begin]
    pairs = overlaps(time, x, y, heading, length, wide, vehicle, step)
    twice = {pair for pair, seconds in pairs.items() if seconds > 0.5 * min(lasting[k] for k in pair)}
    lines += [
        f"{names[b]} lies in {names[a]} for {pairs[a, b]:.1f} s: the same vehicle twice" for a, b in sorted(twice)
    ]
    met = Counter(k for pair in pairs.keys() - twice for k in pair)
    return lines + [f"{n} vehicles drive through {names[k]}: no vehicle is there" for k, n in met.items() if n > 1]
