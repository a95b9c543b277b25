"""What a recording says of its own signs, units, clock and places: asked once, by all doors.

Each question gives a line with the option that mends it, or None. What contradicts itself is refused by who asks; what
only makes results worse is a note. Limits are where the two readings part, not how far real driving goes:

- unit, side and origin of the offset, and the lanes' width: two lane changes that agree, within 15 % of a lane's width;
  of 130 motorway vehicles with two, 128 are found when turned or written in feet, 127 when lanes are 20 % wider or
  narrower, and none of 445 and 567 real ones is as it is;
- rows in turns: twice the change from row to row that there is over several; white noise gives 1;
- clock: 1 kHz to one row in 2 s; minutes: sideways at 0.3 m/s in the median, where drivers keep lanes at 0.1;
- shift of a map: two standard deviations of 445 real vehicles' mean offsets, 0.42 m, or half of it between the two
  directions of a road, beyond two standard errors;
- noise of positions: 0.23 m, from which a vehicle amid its lane seems to leave it in 3 rows of 1000.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray, white_noise
from xosc_lateral.drivers.drives.lane_changes import SETTLED_OFFSET

LEAST_JUMPS = 2  # lane changes that say the same
AGREED = 0.75  # of them, at least: cameras and maps that count lanes change at another row than the offset now and then
JUMP_WINDOW = 1.0  # lane numbers change up to so long before or after the offset jumps [s]
FASTEST_ASIDE = 3.0  # no vehicle moves sideways as fast: what does between two rows is another lane [m/s]
LEAST_LEAPS = 3  # stretches, and rows of each in the mean: a value that stands for none comes several times
BEYOND_NOISE = 10.0  # times as far as from row to row: 7 standard deviations of noise [-]
SYMMETRIC = 0.25  # the offset before a jump is that after it on the other side, give or take so much of the jump
WIDTH_KEPT = 0.1  # of a lane's width that it may change by where the lane does: else a marking was misjudged
SIZE_AGREED = 0.15  # a row's way aside in a lane change is no more of a lane's width; units are a factor of 3 apart
ON_MARKING = 0.35, 0.65
"""Medians of offset / lane width between the middle and a marking: 5 standard deviations of 445 vehicles' means. [-]"""
ONE_SIDED = 0.95
UNIT_SIZES = {"cm": 1e2, "mm": 1e3, "ft": 1.0 / 0.3048, "km": 1e-3}
ALTERNATING = 2.0
"""White noise differs from row to row as over several rows (1), driving less; two vehicles in turns more. [-]"""
MOST_IN_TURNS = 8
LEAST_APART = 0.05  # vehicles nearer to each other do little harm as one; the error of a filter may look like two [m]
FASTEST_STEP, SLOWEST_STEP = 9.5e-4, 2.0  # 1 kHz and its jitter; what comes every 2 s shows no movement in a lane [s]
FASTEST_CLOCK = 0.02  # rows farther apart are not minutes: they would be 1.2 s and more apart [s]
MINUTES_WINDOW = 0.25  # 15 s in minutes: noise is averaged out over it, and a driver has moved [s]
LEAST_WINDOWS = 8
WANDER_RATE = 0.3  # nobody who keeps a lane moves sideways as fast half of the time: 0.02 to 0.1 m/s do [m/s]
FARTHEST_MEAN = 0.42  # two standard deviations of the mean offsets of 445 vehicles on a motorway: no traffic's mean [m]
LEAST_VEHICLES = 5
NEAR_ZERO = 0.1  # of the standard deviation of an offset [-]
LEAST_VISITS = 10  # to 0; that none of them passes it is 1 in 1000
SURE_ERRORS = 2.0  # standard errors


# ---- signs and units, by lane changes --------------------------------------------------------------------------------
def jumps_of(time: FloatArray, offset: FloatArray, width: FloatArray, lane: FloatArray | None) -> FloatArray:
    """Jumps of one drive's offset from one marking to the other, to the left above 0 [m]; their middles [m]; how many
    lanes `lane` steps to the left about then (NaN: none, or several times); lanes' width there [m]. Shape (4, k)."""
    good = np.isfinite(time + offset + width)
    time, offset, width = time[good], offset[good], width[good]
    jump, step, middle = np.diff(offset), np.diff(time), 0.5 * (offset[1:] + offset[:-1])
    if not len(jump):
        return np.zeros((4, 0))
    least = np.maximum(FASTEST_ASIDE * step, BEYOND_NOISE * np.median(np.abs(jump)))
    leap = (np.abs(jump) > least) & (step <= JUMP_WINDOW)
    ends = np.abs(middle), np.abs(np.abs(middle) - 0.5 * np.abs(jump))  # from the middle, or from a marking
    leap &= np.minimum(*ends) < 0.5 * SYMMETRIC * np.abs(jump)
    leap &= np.abs(np.diff(width)) < WIDTH_KEPT * np.minimum(width[1:], width[:-1])
    at = np.flatnonzero(leap)
    steps = np.full(len(at), np.nan)
    if lane is not None and len(at):
        known = np.flatnonzero(np.isfinite(lane[good]))
        moved = np.r_[np.diff(lane[good][known]), np.nan]
        there = np.flatnonzero(moved[:-1])
        first, end = np.searchsorted(time[known[1:]][there], [time[at] - JUMP_WINDOW, time[at] + JUMP_WINDOW])
        steps = np.where(end - first == 1, moved[np.r_[there, -1][first]], np.nan)
    # less what it moves in a row, as before and after
    drift = np.interp(at, np.flatnonzero(~leap), (jump / np.maximum(step, 1e-9))[~leap])
    return np.stack([jump[at] - drift * step[at], middle[at], steps, 0.5 * (width[at] + width[at + 1])])


def of_lane_changes(changes: FloatArray, farthest: float) -> str | None:
    """What lane changes of all drives (`jumps_of`) say of the offset's unit, side and where it counts from, and of the
    lanes' width; `farthest`: the offset is hardly ever farther from 0. [m]"""
    jumps, middles, steps, widths = changes
    least = max(LEAST_JUMPS, AGREED * len(jumps))
    if len(jumps) < least:
        return None
    width, ratio = float(np.median(widths)), float(np.exp(np.median(np.log(np.abs(jumps) / widths))))
    sizes = {"m": width, "lane widths": 1.0, **{unit: width * by for unit, by in UNIT_SIZES.items()}}
    fits = {unit: np.abs(np.log(np.abs(jumps) / size)) < SIZE_AGREED for unit, size in sizes.items()}
    unit = max(fits, key=lambda name: int(fits[name].sum()))
    count = int(fits[unit].sum())
    if count < least:
        alike = int((np.abs(np.log(np.abs(jumps) / widths / ratio)) < SIZE_AGREED).sum())
        if alike < least or not SIZE_AGREED <= abs(np.log(ratio)) < 1.0:  # units are farther apart: the column's own
            return None
        what = f"{alike} lane changes move it by {ratio * width:.3g}, and lanes are {width:.3g} m wide"
        wheels = f", or, of distances, wheel_track = {(ratio - 1.0) * width:.2g}" if ratio > 1.0 else ""
        options = f"lane_width=COLUMN:{ratio:.3g} m or offset=COLUMN:{1.0 / ratio:.3g} m{wheels}"
        return f"{what}: one of both is wrong, {options}"
    side = (np.sign(jumps) * np.sign(steps))[fits[unit] & np.isfinite(steps)]
    wrong = int((side > 0.0).sum())  # to the left, by a lane more from the right, the offset jumps to the right
    aside = middles[fits[unit]] / sizes[unit]
    if (np.abs(aside) > 0.5 * SYMMETRIC).sum() >= AGREED * count:
        backwards = "-" if np.median(aside) < 0.0 else ""
        name = (unit if unit != "lane widths" else f"{width:.4g} m") if unit != "m" or backwards else ""
        from_left = None if not len(side) else (wrong > 0.5 * len(side)) != bool(backwards)
        return from_marking(f"{count} lane changes move it from 0 to {sizes[unit]:.3g}", from_left, backwards + name)
    if unit != "m":
        if farthest > (0.5 + WIDTH_KEPT) * sizes[unit]:
            return None
        option = f"{width:.4g} m" if unit == "lane widths" else unit
        what = f"{count} lane changes move it by {sizes[unit]:.3g}, in lanes of {width:.3g} m: it is in {unit}"
        return f"{what}, offset=COLUMN:{option}"
    if wrong < max(LEAST_JUMPS, AGREED * len(side)):
        return None
    what = f"in {wrong} of {len(side)} lane changes the offset jumps to the side that lane_index steps to"
    return f"{what}: it is positive to the right (offset=COLUMN:-m), or lane_index counts from the left"


def from_marking(what: str, from_left: bool | None = None, unit: str = "") -> str:
    """That an offset is the distance to a marking; `from_left`: to which, if that is known."""
    sides = ["left"] * (from_left is not False) + ["right"] * (not from_left)
    options = ", or ".join(f"distance_{side}=COLUMN{unit and f':{unit}'}" for side in sides)
    return f"{what}: it counts from the {' or '.join(sides)} marking ({options}), not from the lane's middle"


def of_places(offset: FloatArray, width: FloatArray) -> str | None:
    """Whether vehicles drive on a marking, all to the same side, as where offsets count from one."""
    good = np.isfinite(offset + width)
    place = offset[good] / width[good]
    if len(place) < 100 or not ON_MARKING[0] < abs(float(np.median(place))) < ON_MARKING[1]:
        return None
    if (np.sign(place) == np.sign(np.median(place))).mean() < ONE_SIDED:
        return None
    backwards = "-m" if np.median(place) < 0.0 else ""
    what = f"is {float(np.median(offset[good])):.3g} m (median): vehicles would drive on a marking"
    return f"{from_marking(what, None, backwards)}; if it does, offset=COLUMN:m"


# ---- who is who, and when --------------------------------------------------------------------------------------------
def in_turns(values: FloatArray) -> int:
    """How many vehicles rows come from in turns: 1, where neighbours are as alike as rows farther apart."""
    known = values[np.isfinite(values)]
    if len(known) < 100:
        return 1
    apart = [float(np.median(np.abs(known[k:] - known[:-k]))) for k in range(1, MOST_IN_TURNS + 1)]
    return next((k for k, change in enumerate(apart, start=1) if apart[0] > max(ALTERNATING * change, LEAST_APART)), 1)


def of_marker(values: FloatArray) -> str | None:
    """Whether one number stands for no value: sorted values leap to it and from it, again and again."""
    values = values[np.isfinite(values)]
    change = np.abs(np.diff(values))
    same = np.flatnonzero(change == 0.0)
    if not len(same) or len(same) > 0.5 * len(change):  # else it is one that repeats what it has
        return None
    known, count = np.unique(values[same], return_counts=True)
    value = float(known[count.argmax()])
    begins = np.flatnonzero((values[1:] == value) & (values[:-1] != value))
    leaps = change[begins] > BEYOND_NOISE * float(np.median(change[change > 0.0]))
    if leaps.sum() < LEAST_LEAPS or leaps.mean() < AGREED or count.max() < LEAST_LEAPS * len(begins):
        return None
    what = f"is exactly {value:g} in {len(begins)} stretches that it leaps to"
    return f"{what}: if that stands for no value, the mapping needs missing = [{value:g}], else missing = []"


def of_clock(time: FloatArray, slowest: float = SLOWEST_STEP, *, is_named: bool = False) -> str | None:
    """What sorted times, one vehicle after the other, say, at most `slowest` apart; `is_named`: with a unit. [s]"""
    step = np.diff(time)
    step = step[step > 0.0]
    if not len(step):
        return None
    usual = float(np.median(step))
    minutes = np.abs(step - 40.5) < 0.5 + 2.0 * usual  # from 59 to 100
    if usual < 1.0 and minutes.any() and time.min() > 1e3 and (np.mod(time, 100.0) < 60.0).all():
        return "never ends in 60 to 99: clock times such as HHMMSS; write 14:03:05.2, or count seconds"
    if not FASTEST_STEP <= usual <= slowest:
        units = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "86400 s": 86400.0}
        likely = min(units, key=lambda unit: abs(np.log(usual * units[unit] / 0.05)))
        frames = ", or count frames (time=COLUMN:1/25 s)" if usual >= 1.0 else ""
        known = f"rows are {usual:.4g} s apart (median), {FASTEST_STEP:g} to {slowest:g} s are read"
        return f"{known}; the clock may be in {likely} (time=COLUMN:{likely}){frames}"
    if not is_named and (step == 1.0).mean() > 0.9 and (time == np.round(time)).all():
        return "whole numbers one apart: frames (time=COLUMN:1/25 s), ms (time=COLUMN:ms), or seconds (time=COLUMN:s)"
    return None


def wander(time: FloatArray, offset: FloatArray) -> FloatArray:
    """Sideways speed between means over `MINUTES_WINDOW`, of a clock whose rows are so near that it may count minutes;
    shape (k,). [m/s]"""
    good = np.isfinite(time + offset)
    time, offset = time[good], offset[good]
    if len(time) < 2 or float(np.median(np.diff(time))) > FASTEST_CLOCK:
        return np.zeros(0)
    number = np.floor((time - time[0]) / MINUTES_WINDOW).astype(np.int64)
    count = np.bincount(number)
    full = count >= 0.9 * np.median(count)
    means = np.where(full, np.bincount(number, offset) / np.maximum(count, 1), np.nan)
    rates = np.abs(np.diff(means)) / MINUTES_WINDOW
    return np.asarray(rates[np.isfinite(rates)])


def of_wander(rates: FloatArray) -> str | None:
    """Whether drivers keep their lanes sixty times too fast; `rates`: of `wander`, of all drives. [m/s]"""
    if len(rates) < LEAST_WINDOWS or (median := float(np.median(rates))) < WANDER_RATE:
        return None
    return f"offsets move sideways at {median:.2g} m/s (median): the clock may be in min (time=COLUMN:min)"


# ---- places ----------------------------------------------------------------------------------------------------------
def of_registration(
    offset: FloatArray, width: FloatArray, vehicle: IntArray, heading: FloatArray | None = None
) -> str | None:
    """Whether all traffic lies to one side of its lanes, as far as the next lane, or, with headings, to one side of the
    compass, so that both directions of a road are to opposite sides: an error of the map."""
    good = np.isfinite(offset + width)
    turn = np.exp(2j * np.pi * offset[good] / width[good])
    names, whose = np.unique(vehicle[good], return_inverse=True)
    if len(names) < LEAST_VEHICLES:
        return None
    count = np.bincount(whose)
    mean = (np.bincount(whose, turn.real) + 1j * np.bincount(whose, turn.imag)) / count
    lane = float(np.median(width[good]))
    middle = float(np.angle(mean.mean()))
    each = (middle + np.angle(mean * np.exp(-1j * middle))) * lane / (2.0 * np.pi)
    shift, error = float(each.mean()), float(each.std()) / np.sqrt(len(each))
    what = "the map and the positions are shifted against one another, and lane changes are not to be believed"
    if abs(shift) - SURE_ERRORS * error > FARTHEST_MEAN:
        side = "left" if shift > 0.0 else "right"
        head = f"traffic of {len(names)} vehicles lies {abs(shift):.2f} +- {2.0 * error:.2f} m to the {side}"
        return f"{head} of its lanes' centres: {what}"
    if heading is None:
        return None
    left = np.exp(1j * heading[good])
    left = 1j * (np.bincount(whose, left.real) + 1j * np.bincount(whose, left.imag)) / count
    ways = np.column_stack([left.real, left.imag])
    ways = ways - ways.mean(axis=0)
    axis = np.linalg.svd(ways, full_matrices=False)[2][0]  # across the road, where it has two directions
    along = ways @ axis
    spread = float(along @ along)
    if spread < LEAST_VEHICLES:  # all drive the same way: what they have in common may be how they drive
        return None
    shift = float(along @ each) / spread
    rest = each - each.mean() - shift * along
    error = float(np.sqrt(rest @ rest / max(len(rest) - 2, 1) / spread))
    if abs(shift) - SURE_ERRORS * error < 0.5 * FARTHEST_MEAN:
        return None
    x, y = shift * axis
    head = f"traffic of {len(names)} vehicles lies {abs(shift):.2f} +- {2.0 * error:.2f} m beside its lanes"
    return f"{head}, to opposite sides in opposite directions (x {x:+.2f}, y {y:+.2f} m): {what}"


def of_drives(offsets: Sequence[FloatArray], widths: Sequence[FloatArray]) -> list[str]:
    """What makes results of drives worse: a line each for offsets to one side, and for noise."""
    number = np.repeat(np.arange(len(offsets)), [len(offset) for offset in offsets])
    shift = of_registration(np.concatenate(offsets), np.concatenate(widths), number)
    noise = float(np.median([white_noise(offset) for offset in offsets]))
    moving = [hash(offset.tobytes()) for offset in offsets if np.ptp(offset) > 0.0]
    again = len(moving) - len(set(moving))
    twice = f"{again} of {len(offsets)} drives repeat another one row by row: they count twice" if again else None
    return [line for line in (shift, noisy(noise), of_sides(np.concatenate(offsets)), twice) if line]


def of_sides(offset: FloatArray) -> str | None:
    """Whether offsets lost their sign: they come near 0 many times and pass it never, where half would each time."""
    near = np.abs(offset) < NEAR_ZERO * float(offset.std())
    visits = int((np.diff(near.astype(np.int8)) > 0).sum())
    if visits < LEAST_VISITS or offset.min() * offset.max() < 0.0:
        return None
    return f"offsets come near 0 {visits} times and never pass it: their sign is lost"


def noisy(error: float) -> str | None:
    """Whether places err too much from row to row for lane changes, by so much. [m]"""
    most = SETTLED_OFFSET / 3.0
    what = f"places err by {error:.2f} m from row to row: above {most:.2f} m lane changes are invented"
    return None if error <= most else what
