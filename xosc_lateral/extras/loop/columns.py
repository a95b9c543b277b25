"""What a context column is: its role, the kind of its values, and whether the car's own movement brings it about.

Whether a column can be a cause is a matter of what it is, not of how it correlates: a car that answers a bend before it
comes moves as if it predicted the bend. Roles are declared, or proposed from the name; a name that says nothing leaves
the role unknown, unless the values are a clock's. Declared road, weather and traffic are never a consequence, and the
car's own movement never a cause. All other columns are tested for three marks of feedback.

*Coherence.* A driver responds to a cause as through a low-pass of seconds: above 0.2 Hz an offset shares next to
nothing with its causes. A steering angle or a yaw rate is the movement's own derivative, and shares nearly all.

*Direction of time.* Given its own past, a cause owes nothing to what the car did just before; a column that a system
computes from the offset (a torque that keeps the lane, a filtered copy) is predicted by it [1]_. Both are asked of the
offset, its size, its excess over the usual size, its speed and the size of that.

*Function of the offset.* The column's mean given the present offset is the function that fits it best [2]_.

References
----------
.. [1] C. W. J. Granger, "Investigating causal relations by econometric models and cross-spectral methods",
   Econometrica 37, 1969.
.. [2] L. Breiman, J. Friedman, "Estimating optimal transformations for multiple regression and correlation", J.
   American Statistical Association 80, 1985: the conditional mean is the function that is most correlated.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray, rate
from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.drives.roles import Role as Role
from xosc_lateral.extras.loop.autocorrelation import positions_in_run
from xosc_lateral.extras.loop.timeline import PAD, Timeline

# A clock goes on in at least half of so many half minutes, over all drives, and hardly ever back: share of its way that
# is the way from end to end. Counters of 150 sets of short drives have it in 99 %, speed, grade and weather in none.
CLOCK_STEP_S, CLOCK_STEPS, CLOCK_SHARE = 30.0, 14, 0.95
MAX_LEVELS = 8  # More different whole numbers than this are a number, not levels. [-]
# A level or presence on for less than this share of the road-following time (12 s of 50 min) tells nothing. [-]
MIN_SHARE = 0.004


@dataclass(frozen=True, slots=True)
class Assigned:
    """Role of a column; `source`: "declared", "name" or "data", empty for an unknown role."""

    column: str
    role: Role
    source: str

    @property
    def declared(self) -> bool:
        """Whether somebody said so."""
        return self.source == "declared"


# Words of a name that say what a column is; the first that fits counts: a lane departure is no lane.
_ROLE_WORDS: tuple[tuple[Role, frozenset[str]], ...] = tuple(
    (role, frozenset(words.split()))
    for role, words in (
        (Role.OWN, "steering steer handwheel yaw yawrate roll sideslip departure ldw lka lks keeping crossing heading"),
        (Role.WEATHER, "wind crosswind gust gusts rain precipitation snow fog humidity weather visibility illuminance "
                       "lux light daylight sun sunlight ambient air outside wet wetness"),
        (Role.ROAD, "road curvature curve bend radius crossfall superelevation bank grade gradient slope lane lanes "
                    "surface roughness friction bridge tunnel guardrail barrier junction exit shoulder limit"),
        (Role.TRAFFIC, "lead leader truck trucks car cars vehicles bus neighbour neighbor oncoming traffic gap headway "
                       "thw ttc density left right behind ahead follower collision pedestrian cyclist"),
        (Role.OWN, "lateral"),
        (Role.DRIVER, "driver gaze eye eyes attention phone heart hands drowsy drowsiness fatigue alertness speed "
                      "acceleration pedal throttle brake accelerator"),
        (Role.TIME, "time timestamp clock frame counter sequence odometer mileage soc battery fuel elapsed utc"),
    )
)  # fmt: skip
# A name with one of these says nothing: a temperature of the car itself is no weather, a time of day may act, and a
# curvature that is driven, or asked for, is not the road's.
_NEUTRAL_WORDS = frozenset(
    ["cabin", "tyre", "tire", "engine", "oil", "day", "actual", "driven", "desired", "commanded"],
)


def proposed_role(column: str) -> Role:
    """What a column's name says it is."""
    words = set(re.split(r"[^a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column).lower()))
    if words & _NEUTRAL_WORDS:
        return Role.UNKNOWN
    return next((role for role, known in _ROLE_WORDS if words & known), Role.UNKNOWN)


def roles_of(timeline: Timeline, names: Iterable[str], declared: Mapping[str, str]) -> dict[str, Assigned]:
    """Role of each column; a `declared` one that there is not, or of no column, is a `FormatError`."""
    names = list(names)
    for column, word in declared.items():
        if word not in set(Role):
            raise FormatError(f"role of {column}: {word!r} is none of {', '.join(Role)}")
        if column not in names:
            raise FormatError(f"role of {column}: the table has no such column")
    roles = {}
    for column in names:
        role = Role(declared[column]) if column in declared else proposed_role(column)
        source = "declared" if column in declared else "name" if role is not Role.UNKNOWN else ""
        if not source.startswith("d") and not role.is_exogenous and is_clock(timeline, column):
            role, source = Role.TIME, source if role is Role.TIME else "data"
        roles[column] = Assigned(column, role, source)
    return roles


def is_clock(timeline: Timeline, column: str) -> bool:
    """Whether a column goes one way through every drive, the same way: a counter, an odometer, a state of charge."""
    values, rows = timeline.context.get(column, timeline.lane_width), round(CLOCK_STEP_S / timeline.step)
    inside = [values[span.start + PAD : span.stop - PAD] for span in timeline.spans]
    ways = [_way(one, rows) for one in inside if len(one) >= 2 * rows]  # of a shorter drive there is no step
    return sum(abs(one) for one in ways) >= CLOCK_STEPS and len(set(np.sign(ways))) == 1


def _way(values: FloatArray, rows: int) -> int:
    """Number of steps of a drive that goes one way, negative where it falls; 0: it does not, or is too short."""
    parts = len(values) // rows
    with np.errstate(invalid="ignore"):
        change = np.diff(values[: parts * rows].reshape(parts, rows).mean(axis=1))
    if not np.isfinite(change).all():
        return 0
    way, end = float(np.abs(change).sum()), float(change.sum())
    moving = float(np.mean(np.abs(change) > 1e-9 * max(way, 1e-300)))
    return len(change) * int(np.sign(end)) if moving >= 0.5 and abs(end) >= CLOCK_SHARE * way else 0


class Values(Enum):
    """What values a column has: they say how it can act."""

    NUMBER = "number"
    SWITCH = "switch"
    LEVELS = "levels"
    ANGLE = "angle"


@dataclass(frozen=True, slots=True)
class Column:
    """One context column that varies."""

    name: str
    values: Values  # How it can act.
    gaps: bool  # NaN ("there is none") occurs often enough to tell.
    levels: tuple[float, ...] = ()  # Values, for a switch or levels; those that are rare left out.
    period: float = 0.0  # Full circle of an angle, else 0.
    role: Role = Role.UNKNOWN


def known_columns(timeline: Timeline) -> tuple[list[Column], dict[str, str]]:
    """Columns worth looking at, `lane_width` among them, in alphabetical order, and why the others aren't."""
    columns, unused = [], {}
    context = {"lane_width": timeline.lane_width, **timeline.context}
    for name in sorted(context):
        column = read_column(name, context[name][timeline.valid], timeline.periods.get(name, 0.0))
        if isinstance(column, str):
            unused[name] = column
        else:
            columns.append(column)
    return columns, unused


def read_column(name: str, seen: FloatArray, period: float) -> Column | str:
    """What a column holds, from its road-following values and its full circle; or why it tells nothing."""
    there = np.isfinite(seen)
    share = float(there.mean())
    if share < MIN_SHARE:
        return "it is empty"
    values = seen[there]
    gaps = MIN_SHARE <= share <= 1.0 - MIN_SHARE
    if period > 0.0:
        return Column(name, Values.ANGLE, gaps, period=period)
    low, high = np.quantile(values, [MIN_SHARE, 1.0 - MIN_SHARE])
    levels, counts = np.unique(values, return_counts=True)
    often = counts >= MIN_SHARE * len(values)
    few = counts[often].sum() >= (1.0 - MIN_SHARE) * len(values) and often.sum() <= MAX_LEVELS
    levels = levels[often].tolist() if few else []
    if len(levels) == 1 or (not levels and high - low <= 1e-9 * max(1e-9, abs(low), abs(high))):
        return Column(name, Values.NUMBER, True) if gaps and not levels else "it hardly varies"
    if not levels:
        return Column(name, Values.NUMBER, gaps)
    return Column(name, Values.SWITCH if len(levels) == 2 else Values.LEVELS, gaps, tuple(levels))


# ---- feedback ----
ComplexArray = NDArray[np.complex128]

# Samples per segment of the spectral estimate: 25.6 s, and 12.8 s where runs are too short for enough of those.
SEGMENT_ROWS = (128, 64)
# Edges of the parts of the band where a driver no longer responds, and sensors still see the car move. [Hz]
FEEDBACK_BAND_HZ = (0.2, 0.3, 0.4, 0.6, 0.8)
# Squared coherence from which a column is feedback if the movement predicts it too, and from which it is doubtful if
# not. Causes that change over ten seconds and more stay below 0.06, also where they move the car by 0.9 m; a switch
# that moves a car of little movement of its own by 0.2 m has 0.29, gusts of 3 s that push a car by 0.8 m up to 0.49;
# consequences are above 0.5, and 0.35 where most of the column is something else. [-]
FEEDBACK_COHERENCE, DOUBTFUL_COHERENCE = 0.2, 0.5
# Share of a column's innovations that the movement predicts: from the first on it is feedback, from the second on
# doubtful; below the last, coherence alone is doubtful too. Causes that share more than 0.2 (gusts that push a car by
# 0.8 m) stay below 0.0006; a steering angle or a yaw rate that mostly follows the road's curves has 0.0065. [-]
FEEDBACK_SHARE, DOUBTFUL_SHARE, NEGLIGIBLE_SHARE = 0.05, 0.02, 0.003
# Squared coherence with its own mean given the present offset or lateral speed, from which a column is a function of
# it. Warnings with hysteresis have 0.8, a lateral speed 0.4 to 0.7, causes below 0.06. [-]
FUNCTION_COHERENCE = 0.4
# Part of the band from which on even a driver who sees a bend ahead and answers it within half a second shares less
# than 0.15 with it, before which up to 0.85; what the movement brings about shares 0.5 and more in all parts. What its
# name says to be road, weather or traffic is looked at there alone. [-]
RESPONSE_FREE = 2
# Quantiles of the movement between which that mean is taken: finer at the ends, where warnings fire. [-]
MOVEMENT_QUANTILES = np.r_[0.005, 0.01, 0.02, np.linspace(0.04, 0.96, 24), 0.98, 0.99, 0.995]
# Stretches of so long are dealt to two halves; the mean of either half is taken from the other. [s]
HALVES_BLOCK_S = 150.0
# Past samples of the column, and of the movement, in the test of time's direction: 2 s and 1 s.
OWN_PAST, MOVED_PAST = 10, 5
# Over the number of segments: what unrelated columns' coherence stays below, the largest of 4 parts and 6 movements
# (with 40 half-overlapping segments they reach 0.14). [-]
CHANCE_COHERENCE = 6.0
# Rows per quantity that a regression needs to tell anything (F. Harrell, Regression Modeling Strategies, 2015). [-]
ROWS_PER_QUANTITY = 15
MIN_SEGMENTS = 12  # Fewer segments of one length than this say little: the next length is taken.


@dataclass(frozen=True, slots=True)
class Feedback:
    """A column that the movement itself brings about."""

    column: str
    coherence: float  # Squared, above 0.2 Hz, with what it follows most. [-]
    predicted_share: float  # Share of its innovations that the movement predicts. [-]
    function: float  # Squared coherence, in the same band, with its own mean given the present movement. [-]
    of: str  # What it follows: "offset", "size of the offset", ...
    doubtful: bool  # No mark is clear.
    source: str = ""  # "declared" or "name": it is said to be the car's own movement; empty: its values show it.


def find_feedback(
    timeline: Timeline, columns: Iterable[Column], roles: Mapping[str, Assigned] = MappingProxyType({})
) -> list[Feedback]:
    """Columns that follow from the movement, doubtful ones included."""
    segments, moved = _Segments(timeline.valid), _movement(timeline)
    spectra = {name: segments.spectra(values) for name, values in moved.items()}
    rows = np.flatnonzero(positions_in_run(timeline.valid) >= max(OWN_PAST, MOVED_PAST))
    chance = CHANCE_COHERENCE / max(1, segments.number)
    feedback = []
    for column in columns:
        assigned = roles.get(column.name, Assigned(column.name, Role.UNKNOWN, ""))
        if assigned.declared and assigned.role.is_exogenous:
            continue
        values = timeline.context.get(column.name, timeline.lane_width)
        known = np.isfinite(values)
        values = np.where(known, values, np.median(values[timeline.valid & known]))
        seen, size = (segments.spectra(one) for one in (values, np.abs(values - np.median(values[timeline.valid]))))
        named = assigned.role.is_exogenous  # by its name
        part = RESPONSE_FREE if named else 0
        shared = {name: segments.coherence(seen, is_movement, part) for name, is_movement in spectra.items()}
        for name in ("size of the offset", "excess of the offset"):
            shared[name] = max(shared[name], segments.coherence(size, spectra[name], part))
        by_function = {
            name: segments.coherence(seen, segments.spectra(_mean_given(values, moved[name], timeline)), part)
            for name in ("offset", "lateral speed")
        }
        # a switch has hardly any changes that could be predicted
        changes = column.values in (Values.NUMBER, Values.ANGLE)
        predicted = _predicted_share(values, moved, rows) if changes else 0.0
        of, coherence = max(shared.items(), key=lambda pair: pair[1])
        of_function, function = max(by_function.items(), key=lambda pair: pair[1])
        is_function = function >= max(FUNCTION_COHERENCE, chance)
        follows = coherence >= max(FEEDBACK_COHERENCE, chance) and predicted >= NEGLIGIBLE_SHARE
        clear = follows or predicted >= FEEDBACK_SHARE
        doubtful = coherence >= max(DOUBTFUL_COHERENCE, chance) or predicted >= DOUBTFUL_SHARE
        if is_function and not clear:
            of = of_function
        if named:  # overruled where both marks are strong
            clear, doubtful = predicted >= FEEDBACK_SHARE and coherence >= max(DOUBTFUL_COHERENCE, chance), False
        is_movement = assigned.role is Role.OWN
        if is_movement or clear or is_function or doubtful:
            sure, source = is_movement or clear or is_function, assigned.source if is_movement else ""
            feedback.append(Feedback(column.name, coherence, predicted, function, of, not sure, source))
    return feedback


def _mean_given(values: FloatArray, movement: FloatArray, timeline: Timeline) -> FloatArray:
    """Mean of a column given the movement just then, by the other half of the drives; shape (n,), in its unit."""
    part = np.searchsorted(np.unique(np.quantile(movement[timeline.valid], MOVEMENT_QUANTILES)), movement)
    half = (np.arange(len(values)) // round(HALVES_BLOCK_S / timeline.step)) % 2
    usual, size = float(values[timeline.valid].mean()), int(part.max()) + 1
    result = np.full(len(values), usual)
    for part_of_two in (0, 1):
        other = timeline.valid & (half != part_of_two)
        count = np.bincount(part[other], minlength=size)
        sums = np.bincount(part[other], values[other], minlength=size)
        result[half == part_of_two] = ((sums + usual) / (count + 1.0))[part[half == part_of_two]]
    return result


def _movement(timeline: Timeline) -> Mapping[str, FloatArray]:
    inside = timeline.valid
    offset = np.where(inside, timeline.offset - np.median(timeline.offset[inside]), 0.0)
    size = np.abs(offset)
    usual = float(np.quantile(size[inside], 0.75))
    speed = rate(offset, timeline.step)
    return {
        "offset": offset,
        "size of the offset": size,
        "excess of the offset": np.sign(offset) * np.maximum(size - usual, 0.0),
        "lateral speed": speed,
        "size of the lateral speed": np.abs(speed),
    }


def _predicted_share(values: FloatArray, moved: Mapping[str, FloatArray], rows: IndexArray) -> float:
    """Partial R squared of the recent movement, the present included, given the column's own past."""
    if len(rows) < ROWS_PER_QUANTITY * (1 + OWN_PAST + len(moved) * len(range(0, MOVED_PAST + 1, 2))):
        return 0.0
    now = values[rows]
    past = [np.ones(len(rows)), *(values[rows - lag] for lag in range(1, OWN_PAST + 1))]
    other = [series[rows - lag] for series in moved.values() for lag in range(0, MOVED_PAST + 1, 2)]
    alone, together = (_left(now, np.stack(design, axis=1)) for design in (past, past + other))
    freedom = len(rows) / max(1, len(rows) - len(past) - len(other))
    return max(0.0, 1.0 - freedom * together / max(alone, 1e-300)) if alone > 1e-12 * float(np.var(now)) else 0.0


def _left(values: FloatArray, design: FloatArray) -> float:
    scaled = design / np.maximum(np.sqrt(np.mean(design**2, axis=0)), 1e-300)
    gram = scaled.T @ scaled
    gram[np.diag_indices(len(gram))] *= 1.0 + 1e-10
    return float(np.mean((values - scaled @ np.linalg.lstsq(gram, scaled.T @ values, rcond=None)[0]) ** 2))


class _Segments:
    """Segments of uninterrupted movement, half overlapping, for spectra: the longest of which there are enough."""

    def __init__(self, valid: BoolArray) -> None:
        sums = np.concatenate([[0], np.cumsum(valid)])
        for length in SEGMENT_ROWS:
            starts, at = [], 0
            while at + length <= len(valid):
                inside = sums[at + length] - sums[at] == length
                starts.extend([at] if inside else [])
                at += length // 2 if inside else length // 16
            if len(starts) >= MIN_SEGMENTS:
                break
        self.number = len(starts)
        self._rows = np.asarray(starts, dtype=np.intp)[:, None] + np.arange(length)
        frequency = np.fft.rfftfreq(length, STEP)
        self._in_band = (frequency >= FEEDBACK_BAND_HZ[0]) & (frequency <= FEEDBACK_BAND_HZ[-1])
        self._part = np.searchsorted(FEEDBACK_BAND_HZ[1:-1], frequency[self._in_band], side="right")

    def spectra(self, values: FloatArray) -> ComplexArray:
        """Transforms of the first difference in the band, shape (segments, frequencies)."""
        pieces = np.diff(values, prepend=values[:1])[self._rows] * np.hanning(self._rows.shape[1])
        return np.asarray(np.fft.rfft(pieces, axis=1)[:, self._in_band])

    def coherence(self, first: ComplexArray, second: ComplexArray, first_part: int = 0) -> float:
        """Squared, in the part of the band, from one on, where most is shared: a shaky sensor hides the faster ones."""
        cross = np.abs(np.sum(first * np.conj(second), axis=0)) ** 2
        power = np.sum(np.abs(first) ** 2, axis=0) * np.sum(np.abs(second) ** 2, axis=0)
        coherence = cross / np.maximum(power, 1e-300)
        parts = np.unique(self._part[self._part >= first_part])
        return float(max((coherence[self._part == index].mean() for index in parts), default=0.0))
