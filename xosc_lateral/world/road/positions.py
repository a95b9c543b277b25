"""What the road network answers with: poses, lane positions, lane links. Plain named tuples, of floats or of arrays."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from xosc_lateral.base.arrays import FloatArray, Int32Array


class Pose(NamedTuple):
    """One pose: heading in [-pi, pi], counter-clockwise from x, pitch positive nose down, roll right side down.

    [m], [rad]; the rotation is Rz(heading) Ry(pitch) Rx(roll).
    """

    x: float
    y: float
    z: float
    heading: float
    pitch: float
    roll: float


class Poses(NamedTuple):
    """Poses as arrays of one shape; fields as in `Pose`."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    heading: FloatArray
    pitch: FloatArray
    roll: FloatArray


class LaneCoordinates(NamedTuple):
    """A place on the road."""

    road: int  # index into `RoadNetwork.road_ids`
    lane: int
    s: float  # [m]
    offset: float  # from the lane centre, positive to the LEFT of travel [m]
    t: float  # from the reference line, positive to its left [m]
    distance: float  # from the lane's nearest edge, 0 inside the lane [m]


class LanePositions(NamedTuple):
    """Places on the road as arrays of one shape; fields as in `LaneCoordinates`; lane 0 where there is none."""

    road: Int32Array
    lane: Int32Array
    s: FloatArray
    offset: FloatArray
    t: FloatArray
    distance: FloatArray


class LaneState(NamedTuple):
    """A lane at one `s`: t of its centre [m], d(centre t)/ds [-], width [m]."""

    centre_t: float
    slope: float
    width: float


class LaneInfo(NamedTuple):
    """One lane of a cross-section: OpenDRIVE id, type, centre t [m], width [m], +1 driven along s or -1 against it."""

    id: int
    type: str
    centre_t: float
    width: float
    direction: int


class LaneLink(NamedTuple):
    """Where a lane leads: entered at `s` (0 or the road's length) and then followed along (+1) or against (-1) s."""

    road: int
    lane: int
    s: float
    direction: int


class Advance(NamedTuple):
    """Where a move along the lanes ended."""

    road: int
    lane: int
    s: float  # [m]
    direction: int  # of the movement along s on the new road
    remaining: float  # what could not be moved because the lane ends there, else 0 [m]


class RoadPath(NamedTuple):
    """A way along the reference lines of linked roads, in whatever direction they are driven."""

    ds: float  # signed length [m]
    way: int  # direction along s in which the first road is left (+1, -1)
    entered: tuple[tuple[int, int], ...]  # roads after it, each with the direction along s (+1: entered at its start)

    @property
    def is_turned(self) -> bool:
        """Whether s runs the other way on the last road: +t is on the other side there."""
        return bool(self.entered) and self.entered[-1][1] != self.way


class RouteStep(NamedTuple):
    """One road of a route, driven from `s_start` to `s_end` (s_end < s_start: against s)."""

    road: int
    direction: int
    s_start: float
    s_end: float
    links: tuple[LaneLink, ...] = ()  # by which its lanes are entered, section by section; none where lanes are changed
    missed: int = 0  # lane of a stop on it that the way does not lead to without a lane change; 0: none


class RoadMark(NamedTuple):
    """Marking at a lane's outer edge over [s_start, s_end) [m]; type and colour in the words of OpenDRIVE."""

    lane: int
    s_start: float
    s_end: float
    type: str
    color: str
    width: float


# ---- angles as scalars, in [rad], counter-clockwise ----
TWO_PI = 2.0 * pi
HALF_PI = 0.5 * pi


def wrap(angle: float) -> float:
    """The same angle in [0, 2 pi)."""
    wrapped = angle % TWO_PI
    return wrapped if wrapped < TWO_PI else 0.0


def difference(angle: float, reference: float) -> float:
    """`angle` - `reference` in [-pi, pi]; of half a turn, the sign that it has between angles in [0, 2 pi)."""
    turn = (angle - reference + pi) % TWO_PI - pi
    return pi if turn == -pi and angle > reference else turn


def is_forward(relative: float) -> bool:
    """Whether a heading relative to the road's s-direction points along s (within 90 degrees either way)."""
    return not HALF_PI < relative % TWO_PI < 3.0 * HALF_PI
