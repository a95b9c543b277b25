"""What a context column is: its role, which says whether it can be a cause, and the kind of its values.

Whether a column can be a cause is a matter of what it is, not of how it correlates: a car that answers a bend before it
comes moves as if it predicted the bend. Roles are declared, or proposed from the name; a name that says nothing leaves
the role unknown, unless the values are a clock's.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.loop.timeline import Timeline

# A clock goes on in at least half of so many minutes, and hardly ever back: share of its way that is the way from end
# to end. A random walk's is below a half. [-]
CLOCK_MINUTES, CLOCK_SHARE = 10, 0.95
MAX_LEVELS = 8  # More different whole numbers than this are a number, not levels. [-]
# A level or presence on for less than this share of the road-following time (12 s of 50 min) tells nothing. [-]
MIN_SHARE = 0.004


class Role(StrEnum):
    """What a column is."""

    ROAD = "road"
    WEATHER = "weather"
    TRAFFIC = "traffic"
    TIME = "time"
    OWN = "own"
    DRIVER = "driver"
    UNKNOWN = "unknown"

    @property
    def is_exogenous(self) -> bool:
        """Whether the car cannot bring it about: never a consequence of its movement."""
        return self in (Role.ROAD, Role.WEATHER, Role.TRAFFIC)


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
_WORDS: tuple[tuple[Role, frozenset[str]], ...] = tuple(
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
# A name with one of these says nothing: a temperature of the car itself is no weather, a time of day may act.
_SILENT = frozenset(["cabin", "tyre", "tire", "engine", "oil", "day"])


def proposed_role(column: str) -> Role:
    """What a column's name says it is."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column)
    words = set(re.split(r"[^a-z]+", spaced.lower()))
    if words & _SILENT:
        return Role.UNKNOWN
    return next((role for role, known in _WORDS if words & known), Role.UNKNOWN)


def roles_of(timeline: Timeline, names: Iterable[str], declared: Mapping[str, str]) -> dict[str, Assigned]:
    """Role of each column; refuses a `declared` role that there is not, or of a column that the table lacks
    (`FormatError`)."""
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
    """Whether a column goes one way through drives of ten minutes: a counter, an odometer, a state of charge."""
    values = timeline.context.get(column, timeline.lane_width)
    rows = round(60.0 / timeline.step)
    long = [span for span in timeline.spans if span.stop - span.start >= (CLOCK_MINUTES + 1) * rows]
    return bool(long) and all(_goes_one_way(values[span], rows) for span in long)


def _goes_one_way(values: FloatArray, rows: int) -> bool:
    minutes = len(values) // rows
    with np.errstate(invalid="ignore"):
        means = values[: minutes * rows].reshape(minutes, rows).mean(axis=1)
    if not np.isfinite(means).all():
        return False
    change = np.diff(means)
    way = float(np.abs(change).sum())
    moving = np.mean(np.abs(change) > 1e-9 * max(way, 1e-300))
    return way > 0.0 and float(moving) >= 0.5 and abs(float(means[-1] - means[0])) >= CLOCK_SHARE * way


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
