"""Arrays of places: everything that `RoadNetwork` answers in a batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from xosc_lateral.errors import PlaybackError
from xosc_lateral.road.lanes import DRIVING, NARROW, Lane
from xosc_lateral.road.lookup import IndexLike, Lookup
from xosc_lateral.road.places import limit_at
from xosc_lateral.road.positions import FloatArray, IntArray, Poses, RoadMark
from xosc_lateral.road.profiles import Cubics, HeightTable
from xosc_lateral.road.reference_line import Frame, ReferenceLines
from xosc_lateral.road.road import Road
from xosc_lateral.road.surface import BEND_STEP

CHUNK = 8192
"""Places evaluated together: the two dozen temporary arrays of a chunk then stay in the processor's cache."""


class LaneProfile(NamedTuple):
    """Lanes at some places: row of the lane table, t of the centre, d(centre)/ds, width, travel direction."""

    row: IndexLike
    centre: FloatArray
    slope: FloatArray
    width: FloatArray
    direction: IntArray


class NetworkTables:
    """Roads, lane sections, lanes and surfaces of a network as flat arrays.

    Lane rows: all lanes of all sections, lane 0 included, in one list; `row_of` turns (section, lane id) into a row.
    The lanes of a section but lane 0 are the `section_count` rows from `section_first` on, from left to right.
    """

    def __init__(self, roads: Sequence[Road], path: str) -> None:
        """Gather everything."""
        self.roads = roads
        self._path = path
        self.lengths = np.array([road.length for road in roads])
        self.lines = ReferenceLines(roads)
        self._sections = Lookup([road.section_starts for road in roads])
        sections = [section for road in roads for section in road.sections]
        self.lanes: list[Lane] = [lane for section in sections for lane in (*section.lanes, section.centre)]
        ids = [lane.id for lane in self.lanes]
        self._lowest = min(ids, default=0)  # a file may hold no road at all
        self._slots = max(ids, default=0) - self._lowest + 1
        self._row_of = np.full(len(sections) * self._slots, -1, dtype=np.int32)
        row = 0
        self.section_first = np.empty(len(sections), dtype=np.int32)
        self.section_count = np.array([len(section.lanes) for section in sections], dtype=np.int32)
        for i, section in enumerate(sections):
            self.section_first[i] = row
            for lane in (*section.lanes, section.centre):
                self._row_of[i * self._slots + lane.id - self._lowest] = row
                row += 1
        self.ids = np.array(ids, dtype=np.int32)
        self.directions = np.array([lane.direction for lane in self.lanes], dtype=np.int32)
        self._lane_lookup = Lookup([lane.starts for lane in self.lanes])
        self._lane_table = np.array(
            [(*c, *w) for lane in self.lanes for c, w in zip(lane.centre, lane.width, strict=True)]
        ).T.copy()
        self._elevation = Cubics([road.surface.elevation for road in roads])
        self._superelevation = Cubics([road.surface.superelevation for road in roads])
        self._is_shaped = np.array([bool(r.surface.crossfall or r.surface.shape) for r in roads])
        self._heights = HeightTable(self.lanes)
        self._level = bool(self._superelevation.is_zero and not self._is_shaped.any())
        self._flat = bool(self._elevation.is_zero and self._level)

    # ---- lanes -------------------------------------------------------------------------------------------------------
    def section_of(self, road: IndexLike, s: FloatArray) -> IndexLike:
        """Index of the lane section, counted over all roads."""
        return self._sections.find(road, s)

    def row_of(self, road: IndexLike, lane: IndexLike, s: FloatArray) -> IndexLike:
        """Row in the lane table; raises `PlaybackError` for the first lane that is not there."""
        section = self.section_of(road, s)
        slot = lane - self._lowest
        outside = (slot < 0) | (slot >= self._slots)
        if np.any(outside):
            self._complain(road, lane, s, outside)
        row = self._row_of[section * self._slots + slot]
        if np.any(row < 0):
            self._complain(road, lane, s, row < 0)
        return int(row) if np.ndim(row) == 0 else row

    def _complain(self, road: IndexLike, lane: IndexLike, s: FloatArray, wrong: object) -> None:
        bad = np.broadcast_to(np.asarray(wrong), s.shape)
        i = int(np.flatnonzero(bad)[0])
        at = float(s[i])
        here = self.roads[int(np.broadcast_to(road, s.shape)[i])]
        there = ", ".join(str(info.id) for info in here.section_at(at).lanes) or "none"
        number = int(np.broadcast_to(lane, s.shape)[i])
        raise PlaybackError(
            f"road '{here.id}' has no lane {number} at s={at:.3f} m (lanes there: {there})", path=self._path or None
        )

    def profile_of(self, row: IndexLike, s: FloatArray) -> LaneProfile:
        """Centre, slope and width of rows of the lane table."""
        piece = self._lane_lookup.find(row, s)
        ds = s - self._lane_lookup.starts[piece]
        a, b, c, d, e, f, g, h = (values[piece] for values in self._lane_table)
        return LaneProfile(
            row,
            a + ds * (b + ds * (c + ds * d)),
            b + ds * (2.0 * c + (3.0 * ds) * d),
            e + ds * (f + ds * (g + ds * h)),
            self.directions[row],
        )

    def lane_profile(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> LaneProfile:
        """Lanes at places, as arrays of the broadcast shape."""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            profile = self.profile_of(self.row_of(road, lane, s), s)
            return tuple(np.broadcast_to(part, s.shape) for part in profile)

        row, centre, slope, width, direction = self._batch(evaluate, 5, road, s, lane=lane)
        return LaneProfile(row.astype(np.int32), centre, slope, width, direction.astype(np.int32))

    def travel_directions(self, road: ArrayLike, lane: ArrayLike) -> IntArray:
        """+1 along s, -1 against s."""
        road_, lane_ = np.broadcast_arrays(np.asarray(road, dtype=np.int32), np.asarray(lane, dtype=np.int32))
        pairs, inverse = np.unique(np.stack([road_.ravel(), lane_.ravel()]), axis=1, return_inverse=True)
        found = [self.roads[r].directions.get(n, 1) for r, n in pairs.T.tolist()]
        return np.array(found, dtype=np.int32)[inverse.ravel()].reshape(road_.shape)

    def offset_to_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike) -> FloatArray:
        """Left of travel -> left of the reference line."""
        profile = self.lane_profile(road, lane, s)
        return np.asarray(profile.centre + profile.direction * np.asarray(offset, dtype=np.float64))

    def t_to_offset(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, t: ArrayLike) -> FloatArray:
        """Left of the reference line -> left of travel."""
        profile = self.lane_profile(road, lane, s)
        return np.asarray(profile.direction * (np.asarray(t, dtype=np.float64) - profile.centre))

    def lane_edges(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """T of the edges to the left and right of travel."""
        _, centre, _, width, direction = self.lane_profile(road, lane, s)
        return centre + 0.5 * direction * width, centre - 0.5 * direction * width

    def lane_index(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[IntArray, IntArray]:
        """Index from the right in travel direction among driving lanes of one direction, and their count."""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            own = np.broadcast_to(self.row_of(road, lane, s), s.shape)
            section = np.broadcast_to(self.section_of(road, s), s.shape)
            index, count = np.full(len(s), -1.0), np.zeros(len(s))
            for which in np.unique(section):
                here = np.flatnonzero(section == which)
                index[here], count[here] = self._section_index(int(which), own[here], s[here])
            return index, count

        index, count = self._batch(evaluate, 2, road, s, lane=lane)
        return index.astype(np.int32), count.astype(np.int32)

    def _section_index(self, section: int, own: IntArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        first, n = int(self.section_first[section]), int(self.section_count[section])
        direction = self.directions[own]
        index, count, is_driving = np.zeros(len(s)), np.zeros(len(s)), np.zeros(len(s), dtype=bool)
        for row in range(first, first + n):
            if self.lanes[row].type not in DRIVING:
                continue
            itself = own == row
            is_driving |= itself
            there = ((self.profile_of(row, s).width > NARROW) | itself) & (self.directions[row] == direction)
            count += there
            # rows run from left to right looking along s
            index += there & (np.where(direction > 0, row > own, row < own))
        return np.where(is_driving, index, -1.0), count

    # ---- poses -------------------------------------------------------------------------------------------------------
    def lane_to_world(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike) -> Poses:
        """Poses of driving along lanes."""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike, offset: FloatArray) -> tuple[FloatArray, ...]:
            s = self._clamped(road, s)
            profile = self.profile_of(self.row_of(road, lane, s), s)
            t = profile.centre + profile.direction * offset
            return self._pose(road, s, t, profile)

        return Poses(*self._batch(evaluate, 6, road, s, lane=lane, offset=offset))

    def road_to_world(self, road: ArrayLike, s: ArrayLike, t: ArrayLike) -> Poses:
        """Poses along reference lines."""

        def evaluate(road: IndexLike, s: FloatArray, offset: FloatArray) -> tuple[FloatArray, ...]:
            return self._pose(road, self._clamped(road, s), offset, None)

        return Poses(*self._batch(evaluate, 6, road, s, offset=t))

    def _clamped(self, road: IndexLike, s: FloatArray) -> FloatArray:
        return np.asarray(np.minimum(np.maximum(s, 0.0), self.lengths[road]))

    def _pose(
        self, road: IndexLike, s: FloatArray, t: FloatArray, profile: LaneProfile | None
    ) -> tuple[FloatArray, ...]:
        frame = self.lines.at(road, s)
        z, pitch, roll, shrink, drift, lead = self._surface(road, s, t)
        heading = frame.heading if drift is None else frame.heading + np.arctan(drift)
        sideways = t if shrink is None else t * shrink
        x, y = frame.x - sideways * frame.sin, frame.y + sideways * frame.cos
        if lead is not None:
            x, y = x + lead * frame.cos, y + lead * frame.sin
        if profile is not None:
            if profile.slope.any():
                turn = np.arctan(profile.slope)
                if pitch.any() or roll.any():
                    turn, pitch, roll = turned_in_surface(turn, pitch, roll)
                heading = heading + turn
            backwards = profile.direction < 0
            if np.any(backwards):
                heading = heading + np.pi * backwards
                pitch, roll = pitch * profile.direction, roll * profile.direction
            if self._heights.any:
                z = z + self._heights.at(profile.row, s, t - profile.centre, profile.width, self.ids[profile.row])
        # into [-pi, pi]
        heading = heading - (2.0 * np.pi) * np.rint(heading / (2.0 * np.pi))
        return x, y, z, heading, pitch, roll

    def _surface(
        self, road: IndexLike, s: FloatArray, t: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None, FloatArray | None, FloatArray | None]:
        """What `Surface.at` answers; no shrinking, drift and lead where nothing leans."""
        nothing = np.zeros(len(s))
        if self._flat:
            return nothing, nothing, nothing, None, None, None
        height, grade = self._elevation.at(road, s)
        if self._level:
            return height, -np.arctan(grade), nothing, None, None, None
        angle, twist = self._superelevation.at(road, s)
        shrink, rise = np.cos(angle), np.sin(angle)
        level = 1.0 / np.sqrt(1.0 + grade * grade)
        steep = grade * level
        ahead, behind = (self._elevation.at(road, s + ds)[1] for ds in (BEND_STEP, -BEND_STEP))
        bend = (ahead - behind) / (2.0 * BEND_STEP) * level * level
        lead = -t * rise * steep
        onward = 1.0 - t * (shrink * twist * steep + rise * level * bend)
        height = height + t * rise * level
        climb = grade + t * (shrink * twist * level - rise * steep * bend)
        drift = -t * rise * twist / onward
        lift, lift_along, lean = self._shaped(road, s, t)
        height, climb, angle = height + lift, (climb + lift_along) / onward, angle + np.arctan(lean)
        pitch = -np.arctan(climb / np.sqrt(1.0 + drift * drift))
        leaning = np.clip(np.sin(angle) * np.cos(np.arctan(grade)) / np.cos(pitch), -1.0, 1.0)
        roll = np.where(climb == grade, angle, np.arcsin(leaning))
        return height, pitch, roll, shrink, drift, lead

    def lead(self, road: IndexLike, s: FloatArray, across: FloatArray) -> FloatArray | None:
        """How far along s places lie from the feet of their s, `across` the line; None: nothing leans on a grade."""
        if self._superelevation.is_zero or self._elevation.is_zero:
            return None
        angle, grade = self._superelevation.at(road, s)[0], self._elevation.at(road, s)[1]
        return np.asarray(-across * np.tan(angle) * grade / np.sqrt(1.0 + grade * grade))

    def shrink(self, road: IndexLike, s: FloatArray) -> FloatArray:
        """How t shrinks seen from above: cos(superelevation)."""
        return np.ones(len(s)) if self._superelevation.is_zero else np.cos(self._superelevation.at(road, s)[0])

    def height(self, road: IndexLike, s: FloatArray, t: FloatArray) -> FloatArray:
        """Height of the road surface, without kerbs. [m]"""
        return self._surface(road, s, t)[0]

    def _shaped(self, road: IndexLike, s: FloatArray, t: FloatArray) -> FloatArray:
        """Crossfall and shape are rare: place by place."""
        result = np.zeros((3, len(s)))
        if not np.any(self._is_shaped[road]):
            return result
        roads = np.broadcast_to(road, s.shape)
        for i in np.flatnonzero(self._is_shaped[roads]):
            result[:, i] = self.roads[int(roads[i])].surface.profile_at(float(s[i]), float(t[i]))
        return result

    # ---- curvature, lean, limits -------------------------------------------------------------------------------------
    def curvature(self, road: ArrayLike, s: ArrayLike) -> FloatArray:
        """Of reference lines, along +s."""

        def evaluate(road: IndexLike, s: FloatArray) -> tuple[FloatArray, ...]:
            return (self.frame(road, s).curvature,)

        return self._batch(evaluate, 1, road, s)[0]

    def frame(self, road: IndexLike, s: FloatArray) -> Frame:
        """Reference line with derivatives."""
        return self.lines.at(road, s, derivatives=True)

    def lane_curvature(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike) -> FloatArray:
        """Curvature of the path at a constant offset from the lane centre, in travel direction.

        The centre's slope t' and bend t'' count, the change of the reference line's own curvature along a sloping path
        (t t' dk/ds, under 1e-6 1/m on roads) does not.
        """

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike, offset: FloatArray) -> tuple[FloatArray, ...]:
            s = self._clamped(road, s)
            row = self.row_of(road, lane, s)
            profile = self.profile_of(row, s)
            piece = self._lane_lookup.find(row, s)
            ds = s - self._lane_lookup.starts[piece]
            bend = 2.0 * self._lane_table[2][piece] + 6.0 * ds * self._lane_table[3][piece]
            kappa = self.frame(road, s).curvature
            forward = 1.0 - kappa * (profile.centre + profile.direction * offset)
            turn = forward * (bend + kappa * forward) + 2.0 * kappa * profile.slope**2
            return (profile.direction * turn / (forward**2 + profile.slope**2) ** 1.5,)

        return self._batch(evaluate, 1, road, s, lane=lane, offset=offset)[0]

    def lean(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Crossfall (positive falling to the right of travel) and grade (positive uphill), both in percent."""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            s = self._clamped(road, s)
            profile = self.profile_of(self.row_of(road, lane, s), s)
            angle, climb = self._slopes(road, s, profile.centre)
            percent = 100.0 * profile.direction
            return np.asarray(percent * np.tan(angle)), percent * climb

        crossfall, grade = self._batch(evaluate, 2, road, s, lane=lane)
        return crossfall, grade

    def _slopes(self, road: IndexLike, s: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angle about s and climb along s at (s, t)."""
        _, grade = self._elevation.at(road, s)
        angle, twist = self._superelevation.at(road, s)
        _, lift_along, lean = self._shaped(road, s, t)
        return angle + np.arctan(lean), grade + t * np.cos(angle) * twist + lift_along

    def speed_limit(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Of the lane, else of the road; inf: none."""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            rows = np.broadcast_to(self.row_of(road, lane, s), s.shape)
            roads = np.broadcast_to(road, s.shape)
            limits = np.full(len(s), np.inf)
            for index, row in np.unique(np.stack([roads, rows]), axis=1).T.tolist():
                speeds = self.lanes[row].speeds or self.roads[index].speeds
                if speeds:
                    here = np.flatnonzero((roads == index) & (rows == row))
                    limits[here] = [limit_at(speeds, at) for at in s[here].tolist()]
            return (limits,)

        return self._batch(evaluate, 1, road, s, lane=lane)[0]

    def mark_line(self, road: int, mark: RoadMark, step: float) -> tuple[FloatArray, FloatArray]:
        """Polyline of a marking: the lane's outer edge, or the lane offset for lane 0."""
        n = max(2, int(np.ceil((mark.s_end - mark.s_start) / step)) + 1)
        s = np.linspace(mark.s_start, mark.s_end, n)
        # the end of a section belongs to the next one, which may not have the lane
        inside = np.minimum(s, np.nextafter(mark.s_end, -np.inf))
        profile = self.lane_profile(road, mark.lane, inside)
        poses = self.road_to_world(road, s, profile.centre + 0.5 * np.sign(mark.lane) * profile.width)
        return poses.x, poses.y

    # ---- broadcasting ------------------------------------------------------------------------------------------------
    def _batch(
        self,
        evaluate: Callable[..., tuple[FloatArray, ...]],
        outputs: int,
        road: ArrayLike,
        s: ArrayLike,
        *,
        lane: ArrayLike | None = None,
        offset: ArrayLike | None = None,
    ) -> tuple[FloatArray, ...]:
        """Broadcast, cut into chunks, evaluate, put together; a road or lane that is one for all stays a plain int."""
        extra = [] if lane is None else [np.asarray(lane)]
        numbers = [np.asarray(s, dtype=np.float64)] + ([] if offset is None else [np.asarray(offset, dtype=np.float64)])
        shape = np.broadcast_shapes(np.shape(road), *(a.shape for a in (*extra, *numbers)))
        flat = [np.broadcast_to(a, shape).ravel() for a in numbers]
        road_ = _one_or_many(road, shape)
        self._refuse_nonsense(road_, flat)
        indices = [_one_or_many(a, shape) for a in extra]
        size = len(flat[0])
        whole = [np.empty(size) for _ in range(outputs)]
        for begin in range(0, size, CHUNK):
            part = slice(begin, begin + CHUNK)
            cut = [a if isinstance(a, int) else a[part] for a in indices]
            results = evaluate(
                road_ if isinstance(road_, int) else road_[part], flat[0][part], *cut, *(a[part] for a in flat[1:])
            )
            for target, result in zip(whole, results, strict=True):
                target[part] = result
        return tuple(a.reshape(shape) for a in whole)

    def _refuse_nonsense(self, road: IndexLike, numbers: Sequence[FloatArray]) -> None:
        """Road -1 (off the road) would quietly be the last one, and NaN would travel on."""
        wrong = np.flatnonzero((np.asarray(road) < 0) | (np.asarray(road) >= len(self.roads)))
        if len(wrong):
            raise ValueError(
                f"road index {np.ravel(road)[wrong[0]]}: there are {len(self.roads)} roads, counted from 0"
            )
        for values in numbers:
            if not np.isfinite(values).all():
                raise ValueError(f"s, t and offset must be finite, found {values[~np.isfinite(values)][0]}")


def _one_or_many(index: ArrayLike, shape: tuple[int, ...]) -> IndexLike:
    """A plain int where all are the same: look-ups are then far cheaper."""
    array = np.asarray(index)
    if array.ndim == 0 or (array.size and (array == array.flat[0]).all()):
        return int(array.flat[0])
    return np.asarray(np.broadcast_to(array, shape).ravel(), dtype=np.int32)


def turned_in_surface(
    turn: FloatArray, pitch: FloatArray, roll: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`places.turned_in_surface` for arrays."""
    cos_turn, sin_turn, cos_pitch, sin_pitch = np.cos(turn), np.sin(turn), np.cos(pitch), np.sin(pitch)
    cos_roll, sin_roll = np.cos(roll), np.sin(roll)
    forward_x = cos_pitch * cos_turn + sin_pitch * sin_roll * sin_turn
    forward_z = cos_pitch * sin_roll * sin_turn - sin_pitch * cos_turn
    lateral_z = cos_pitch * sin_roll * cos_turn + sin_pitch * sin_turn
    return (
        np.arctan2(cos_roll * sin_turn, forward_x),
        -np.arcsin(np.clip(forward_z, -1.0, 1.0)),
        np.arctan2(lateral_z, cos_pitch * cos_roll),
    )
