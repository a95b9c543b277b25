"""Who is who in a recording: where a clock, a place or an identifier leaps, something else begins.

Two recordings in one file have the same identifiers at the same times; loggers restart; trackers give an identifier to
the next vehicle, or say the same place while they see nothing. All doors ask here, so that all cut at the same rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, true_slices
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd

CLOCK_BACK = 1.0  # a clock that goes back by more began again; messages overtake one another by less [s]
UNORDERED = 0.05  # clocks that go back in more of the rows say that these are in no order [-]
LONGEST_GAP = 1.0  # rows farther apart than this are not of one passage [s]
LONGEST_BRIDGE = 4.0  # an identifier that comes back where its speed leads is the same vehicle's, so long at least [s]
LEAP_DISTANCE = 1.5  # farther than it can have driven (half a narrow lane): the identifier is another vehicle's now [m]
LEAP_SPEED = 10.0  # no vehicle is slower or faster by so much from one row to the next [m/s]
FROZEN_TIME = 0.5  # a moving vehicle that is at one place for longer was not seen; shorter, it is bridged [s]
FROZEN_SPEED = 3.0  # who moves as fast before or after can't have stood there within a row [m/s]
HARDEST_BRAKING = 10.0  # dry asphalt allows no more: what speeds may differ by between rows that are far apart [m/s2]
GLITCH_ROWS = 2  # so few rows between two leaps are an error of places, no vehicle
NAMED = 20  # so many vehicles are named that leap
COARSE = 0.8  # so many rows repeat a time only where five and more have one stamp: two recordings are half [-]
REPEATED_DISTANCE, MOST_REPEATED = 2.0, 0.01  # one vehicle at two places at once [m], in so many of its rows [-]


def clock_runs(time: FloatArray, whose: IntArray) -> IntArray:
    """How often the clock had begun again till each row in file order, shape (n,); `whose`: by whom rows are ordered.

    In a file in order of time, or of one file after the other, all clocks begin again at once; where one vehicle
    follows another, each has its own.
    """
    order = np.argsort(whose, kind="stable")
    is_back = (np.diff(whose[order]) == 0) & (np.diff(time[order]) < -CLOCK_BACK)
    before, after = order[:-1][is_back], order[1:][is_back]
    runs = np.zeros(len(time), dtype=np.int64)
    if not len(after) or len(after) > UNORDERED * len(time):
        return runs
    falls = np.flatnonzero(np.diff(time) < -CLOCK_BACK) + 1
    bound = 0
    for last, row in sorted(zip(before.tolist(), after.tolist(), strict=True), key=lambda pair: pair[1]):
        if last + 1 == row and len(order) > 1 and (whose != whose[row]).any():
            mine = np.flatnonzero(whose == whose[row])
            runs[mine[mine >= row]] += 1
        elif last >= bound:
            at = falls[np.searchsorted(falls, row, side="right") - 1]
            bound = int(at) if at > last else row
            runs[bound:] += 1
    return runs


def leaps(time: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Steps of one track, shape (n - 1,), between which it can't have driven; a bad row or two change no speed."""
    from scipy.ndimage import median_filter

    step = np.maximum(np.diff(time), 1e-9)
    if not len(step):
        return np.zeros(0, dtype=np.bool_)
    moved = np.diff(x), np.diff(y)
    vx, vy = (median_filter(each / step, 5, mode="nearest") for each in moved)
    about = np.maximum(np.hypot(vx, vy), 1.0)
    across, along = (moved[1] * vx - moved[0] * vy) / about, (moved[0] * vx + moved[1] * vy) / about
    # twice as far as about that time, or turned by more than 30 degrees
    broken = np.hypot(*moved) > 2.0 * about * step + LEAP_DISTANCE
    broken |= np.abs(across) > 0.5 * about * step + LEAP_DISTANCE
    # unseen for a while, it comes back where its speed leads, give or take half of the way
    unseen = step > LONGEST_GAP
    broken |= unseen & (np.abs(along - about * step) > 0.5 * about * step + LEAP_DISTANCE)
    steps = np.hypot(*moved) / step
    usual, rows = median_filter(steps, 5, mode="nearest"), np.arange(len(steps))
    before, after = (usual[np.clip(rows + shift, 0, len(rows) - 1)] for shift in (-3, 2))  # of five before, five after
    possible = np.maximum(LEAP_SPEED, 5.0 * HARDEST_BRAKING * step)  # they are five rows apart
    return np.asarray(broken | (~unseen & (np.abs(after - before) > possible)))


def frozen(time: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Rows of one track, but the first, that repeat a place to the last digit amid a drive, shape (n,)."""
    rows, step = np.zeros(len(time), dtype=np.bool_), np.maximum(np.diff(time), 1e-9)
    speed = np.hypot(np.diff(x), np.diff(y)) / step
    for part in true_slices(speed == 0.0):
        around = speed[max(part.start - 3, 0) : part.start], speed[part.stop + 1 : part.stop + 4]  # a leap is no speed
        if (
            max((float(np.median(side)) for side in around if len(side)), default=0.0)
            > max(FROZEN_SPEED, 2.0 * HARDEST_BRAKING * step[part.start])  # the median's row is two before
            and time[part.stop] - time[part.start] > FROZEN_TIME
        ):
            rows[part.start + 1 : part.stop + 1] = True
    return rows


@dataclass(frozen=True, eq=False, slots=True)
class Identified:
    """Rows of a recording by vehicle and time."""

    rows: IntArray  # of the source, shape (m,)
    vehicle: IntArray  # whose each is, from 0 on, shape (m,)
    names: tuple[str, ...]  # of the vehicles
    recording: IntArray  # of which recording each row is, shape (m,)
    recordings: tuple[str, ...]
    dropped: Mapping[str, int] = field(default_factory=dict)  # reason -> rows of the source that are not in it
    notes: tuple[str, ...] = ()


def identify(
    names: Sequence[str], vehicle: IntArray, time: FloatArray, x: FloatArray, y: FloatArray,
    recording: Sequence[str] | pd.Series | None = None, *, path: Path = Path("rows"),
) -> Identified:  # fmt: skip
    """Vehicles of rows in file order; `vehicle`: index into `names`, shape (n,) as all. [s], [m]

    `recording`: what the file says that each row is of. Vehicles of several recordings are called after them.
    Raises `FormatError`: a vehicle is at two places at once; `path`: what it calls the source.
    """
    labels = np.zeros(len(time), dtype=np.int64)
    stated: list[str] = []
    if recording is not None:
        labels, known = pd.Series(recording).factorize()
        stated = [str(label) for label in known]
    runs = clock_runs(time, labels * (int(vehicle.max(initial=0)) + 1) + vehicle)
    most = int(runs.max(initial=0)) + 1
    pairs, code = np.unique(labels * most + runs, return_inverse=True)
    rows = np.lexsort((time, vehicle, code))
    same = (np.diff(code[rows]) == 0) & (np.diff(vehicle[rows]) == 0)
    repeated = np.r_[False, same & (np.diff(time[rows]) <= 0.0)]
    dropped = Counter({"repeated time": int(repeated.sum())})
    later = np.flatnonzero(repeated)
    places = np.hypot(x[rows[later]] - x[rows[later - 1]], y[rows[later]] - y[rows[later - 1]])
    if (apart := int((places > REPEATED_DISTANCE).sum())) > max(5, MOST_REPEATED * len(time)):
        name = names[int(vehicle[rows[later[int(places.argmax())]]])]
        what = f"vehicle {name} is at two places at once, {places.max():.4g} m apart, as {apart} of {len(time)} rows"
        advice = "several recordings in one need a column that names them, recording=COLUMN"
        if apart > COARSE * len(time):
            advice = "its clock is too coarse, as seconds since 1970 are in seven digits or 32 bits"
        raise FormatError(f"{what} show: {advice}", path=path)
    rows = rows[~repeated]
    new = np.r_[True, (np.diff(code[rows]) != 0) | (np.diff(vehicle[rows]) != 0)] if len(rows) else np.zeros(0, bool)
    bounds = np.r_[np.flatnonzero(new), len(rows)]
    kept, whose, called, count = list[IntArray](), list[IntArray](), list[str](), Counter[str]()
    several, leapt = len(stated) > 1, list[str]()
    for begin, end in pairwise(bounds.tolist()):
        mine = rows[begin:end]
        still = frozen(time[mine], x[mine], y[mine])
        parts, glitches = _one_by_one(time, x, y, mine[~still])
        dropped.update({"frozen": int(still.sum()), "leap": glitches})
        prefix = f"{stated[labels[mine[0]]]}:" if several else ""
        for part in parts:
            name = prefix + names[int(vehicle[mine[0]])]
            count[name] += 1
            kept.append(part)
            whose.append(np.full(len(part), len(called)))
            called.append(name if count[name] == 1 else f"{name}#{count[name]}")
        leapt += [called[-1].rpartition("#")[0]] if len(parts) > 1 else []
    notes = [f"{name}: leaps of a vehicle: another one from there on ({name}#2 ...)" for name in leapt[:NAMED]]
    notes += [f"{len(leapt) - NAMED} more vehicles leap"] if len(leapt) > NAMED else []
    if runs.any():
        notes.append(f"the clock begins again {int(runs.max())} times: another recording from there on (NAME#2 ...)")
    which = [
        (stated[label] if stated else "") + (f"#{run + 1}" if run or not stated else "")
        for label, run in (divmod(pair, most) for pair in pairs.tolist())
    ]
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *kept])
    vehicles = np.concatenate([np.zeros(0, dtype=np.int64), *whose])
    lost = {reason: lines for reason, lines in dropped.items() if lines}
    return Identified(rows, vehicles, tuple(called), code[rows], tuple(which), lost, tuple(notes))


def _one_by_one(time: FloatArray, x: FloatArray, y: FloatArray, rows: IntArray) -> tuple[list[IntArray], int]:
    """Rows of one identifier by vehicle, and how many are none's: a few between leaps, after which it goes on."""
    broken = np.flatnonzero(leaps(time[rows], x[rows], y[rows])) + 1
    parts, glitches = np.split(rows, broken), 0
    if len(parts) == 1:
        return parts, 0
    made = list[IntArray]()
    for k, part in enumerate(parts):
        if len(part) <= GLITCH_ROWS and (made or k + 1 < len(parts)):
            glitches += len(part)
        elif made and k and len(parts[k - 1]) <= GLITCH_ROWS and _goes_on(time, x, y, made[-1], part):
            made[-1] = np.r_[made[-1], part]
        else:
            made.append(part)
    return made, glitches


def _goes_on(time: FloatArray, x: FloatArray, y: FloatArray, before: IntArray, after: IntArray) -> bool:
    """Whether one stretch is where the other's speed leads."""
    both = np.r_[before[-6:], after[:6]]
    return not leaps(time[both], x[both], y[both])[len(before[-6:]) - 1]
