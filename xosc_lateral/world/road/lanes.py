"""Lanes and lane sections, and how widths, borders and the lane offset make their edges.

References
----------
.. [1] ASAM OpenDRIVE 1.8, chapter 11: lane offset, and section 11.6, widths, borders and heights of lanes.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from msgspec import Struct

from xosc_lateral.world.road.piecewise import ZERO, Cubic, PiecewiseCubic
from xosc_lateral.world.road.positions import LaneState, RoadMark

DRIVING: frozenset[str] = frozenset(
    (
        *("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bidirectional"),
        *("HOV", "bus", "taxi", "mwyEntry", "mwyExit"),
    )
)
"""Lane types that vehicles follow, and that world positions snap to."""

WALKED: frozenset[str] = DRIVING | {"sidewalk", "walking"}
"""Lane types that pedestrians follow, as in the reference player; OpenDRIVE 1.8 calls a sidewalk "walking"."""

MINIMUM_LANE_WIDTH = 0.1
"""A lane narrower than this at some s does not count as one there (it opens or closes). [m]"""


def beside(lane: int, lanes: int) -> int:
    """Id of the lane so many further along +t; there is no lane 0 to drive on."""
    target = lane + lanes
    if lane != 0 and (target == 0 or (target > 0) != (lane > 0)):
        target += 1 if lanes > 0 else -1
    return target


def lanes_between(lane: int, other: int) -> int:
    """How many lanes further along +t another one is, lane 0 not counted: undoes `beside`."""
    lanes = other - lane
    return lanes - (1 if lanes > 0 else -1) if lane * other < 0 else lanes


class LaneFacts(Struct, frozen=True):
    """What a file says about a lane and what needs no evaluation; s is that of the road, not of the section."""

    id: int  # positive to the left of the reference line, negative to the right
    type: str
    level: bool = False
    # heights: s, and height over the road at the inner and outer edge [m]
    heights: tuple[tuple[float, float, float], ...] = ()
    speeds: tuple[tuple[float, float], ...] = ()  # s [m], and limit from there on [m/s]; inf: none
    marks: tuple[RoadMark, ...] = ()
    predecessors: tuple[int, ...] = ()
    successors: tuple[int, ...] = ()


class LaneRecord(LaneFacts, frozen=True):
    """A lane as written in the file. [m]"""

    widths: tuple[tuple[float, Cubic], ...] = ()
    borders: tuple[tuple[float, Cubic], ...] = ()


class Lane(LaneFacts, frozen=True, kw_only=True):
    """A lane of one section, evaluated."""

    direction: int  # of travel: along (+1) or against (-1) s
    starts: tuple[float, ...]  # s where new cubics begin [m]
    centre: tuple[Cubic, ...]  # t of the lane centre, about each start [m]
    width: tuple[Cubic, ...]  # [m]

    def state_at(self, s: float) -> LaneState:
        """Centre t, its slope and the width at s. [m], [-], [m]"""
        i = bisect_right(self.starts, s) - 1
        if i < 0:
            i = 0
        s -= self.starts[i]
        a, b, c, d = self.centre[i]
        e, f, g, h = self.width[i]
        return LaneState(a + s * (b + s * (c + s * d)), b + s * (2.0 * c + 3.0 * s * d), e + s * (f + s * (g + s * h)))

    def height_at(self, s: float, across: float) -> float:
        """Height over the road, `across` from inner (0) to outer edge (1); linear in s, as files draw ramps. [m]"""
        i = max(bisect_right(self.heights, s, key=lambda record: record[0]) - 1, 0)
        start, inner, outer = self.heights[i]
        if i + 1 < len(self.heights) and s > start:
            end, next_inner, next_outer = self.heights[i + 1]
            weight = (s - start) / (end - start)
            inner, outer = inner + weight * (next_inner - inner), outer + weight * (next_outer - outer)
        return inner + across * (outer - inner)


@dataclass(frozen=True, slots=True)
class LaneSection:
    """The cross-section of a road over [start, end)."""

    start: float
    end: float
    lanes: tuple[Lane, ...]  # from left to right looking along s, without the centre lane 0
    centre: Lane  # lane 0: no width, its t is the lane offset
    by_id: Mapping[int, Lane] = field(init=False)  # lane 0 included

    def __post_init__(self) -> None:
        object.__setattr__(self, "by_id", {lane.id: lane for lane in (*self.lanes, self.centre)})


def build_section(
    records: Sequence[LaneRecord],
    start: float,
    end: float,
    *,
    lane_offset: PiecewiseCubic,
    directions: Mapping[int, int],
    centre_marks: tuple[RoadMark, ...] = (),
) -> LaneSection:
    """Evaluate the lanes of one section, outwards from the centre lane on either side. `start`, `end` in [m]."""
    centre = lane_offset.restricted(start, end)
    lanes: list[Lane] = []
    for side in (1, -1):
        inner = centre
        for record in sorted((r for r in records if r.id * side > 0), key=lambda r: abs(r.id)):
            outer = _outer_edge(record, inner, centre, start, end, side)
            width = outer.plus(inner, -1.0)
            if side < 0:
                width = PiecewiseCubic(width.starts, tuple((-a, -b, -c, -d) for a, b, c, d in width.cubics))
            middle = inner.plus(width, 0.5 * side)
            lanes.append(_lane(record, directions[record.id], middle, width))
            inner = outer
    nothing = PiecewiseCubic(centre.starts, (ZERO,) * len(centre.starts))
    lane_zero = LaneRecord(0, "none", True, marks=centre_marks)
    return LaneSection(
        start, end, tuple(sorted(lanes, key=lambda lane: -lane.id)), _lane(lane_zero, 1, centre, nothing)
    )


def _outer_edge(
    record: LaneRecord, inner: PiecewiseCubic, centre: PiecewiseCubic, start: float, end: float, side: int
) -> PiecewiseCubic:
    """The edge away from the centre lane; widths count outwards, borders (in t) from the centre lane. Widths win."""
    records, origin, factor = (record.widths, inner, float(side)) if record.widths else (record.borders, centre, 1.0)
    if not records:
        return inner
    # Before its first record a width is taken as the record's first value: no lane begins with a jump.
    first = min(records, key=lambda item: item[0])[1]
    profile = PiecewiseCubic.from_records(records, begin=start, before=(first[0], 0.0, 0.0, 0.0))
    return origin.plus(profile.restricted(start, end), factor)


def _lane(record: LaneRecord, direction: int, centre: PiecewiseCubic, width: PiecewiseCubic) -> Lane:
    return Lane(
        **{name: getattr(record, name) for name in LaneFacts.__struct_fields__},
        direction=direction,
        starts=centre.starts,
        centre=centre.cubics,
        width=width.cubics if width.starts == centre.starts else tuple(width.cubic_at(s) for s in centre.starts),
    )
