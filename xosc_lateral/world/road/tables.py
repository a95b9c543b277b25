"""Arrays of places: everything that `RoadNetwork` answers in a batch.

A line at the distance t to the left of a reference line of curvature k has the curvature k / (1 - k t): the angle that
a stretch turns by is the same, its length is (1 - k t) of the reference line's.

References
----------
.. [1] ASAM OpenDRIVE 1.8, 2023: road reference line, lane sections, elevation and superelevation (section 10.5),
       height of lanes (section 11.6).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.road.lane_tables import LaneProfile, LaneTables
from xosc_lateral.world.road.lanes import Lane
from xosc_lateral.world.road.piecewise import GRADE_STEP, IndexLike, Lookup, PiecewiseCubic
from xosc_lateral.world.road.positions import Poses
from xosc_lateral.world.road.reference_line import Frame, ReferenceLines
from xosc_lateral.world.road.road import Road


class Cubics:
    """Piecewise cubics of several owners."""

    def __init__(self, functions: Sequence[PiecewiseCubic]) -> None:
        self._lookup = Lookup([function.starts for function in functions])
        self._table = np.array([cubic for function in functions for cubic in function.cubics]).T.copy()
        self.is_zero = not self._table.any()

    def at(self, owner: IndexLike, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and derivatives. Shape as `s`. [m]"""
        piece = self._lookup.find(owner, s)
        ds = s - self._lookup.starts[piece]
        a, b, c, d = (values.take(piece) for values in self._table)
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + (3.0 * ds) * d)


class HeightTable:
    """Heights of lanes over the road surface (kerbs), linear from one record to the next."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        records = [lane.heights or ((0.0, 0.0, 0.0),) for lane in lanes]
        self.any = any(lane.heights for lane in lanes)
        self._lookup = Lookup([[s for s, _, _ in own] for own in records])
        self._table = np.array([piece for own in records for piece in _linear_pieces(own)]).T.copy()

    def at(
        self, row: IndexLike, s: FloatArray, from_centre: FloatArray, width: FloatArray, lane: IndexLike
    ) -> FloatArray:
        """Height `from_centre` (along t) of lanes of this width and id, linear across the lane. Shape as `s`. [m]"""
        piece = self._lookup.find(row, s)
        ds = np.maximum(s - self._lookup.starts[piece], 0.0)
        inner, inner_slope, outer, outer_slope = (values.take(piece) for values in self._table)
        low, high = inner + ds * inner_slope, outer + ds * outer_slope
        # a lane of no width has no inside: its inner edge counts
        narrow = width <= 0.0
        outwards = np.sign(lane) * from_centre / np.where(narrow, 1.0, width)
        across = np.where(narrow, 0.0, np.clip(0.5 + outwards, 0.0, 1.0))
        return np.asarray(low + across * (high - low))


def _linear_pieces(records: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float, float]]:
    """Inner height and its slope, outer height and its slope, from each record to the next."""
    pieces = []
    for (s, inner, outer), (end, inner_end, outer_end) in zip(records, [*records[1:], records[-1]], strict=True):
        length = end - s if end > s else np.inf
        pieces.append((inner, (inner_end - inner) / length, outer, (outer_end - outer) / length))
    return pieces


_Lie = tuple[FloatArray, FloatArray, FloatArray, FloatArray | None, FloatArray | None, FloatArray | None]
"""Height, pitch, roll of a surface, and shrinking, drift and lead, which are None where nothing leans."""


class NetworkTables(LaneTables):
    """Roads, lane sections, lanes and surfaces of a network as flat arrays."""

    def __init__(self, roads: Sequence[Road], path: str) -> None:
        super().__init__(roads, path)
        self._lines = ReferenceLines(roads)
        self._elevation = Cubics([road.surface.elevation for road in roads])
        self._superelevation = Cubics([road.surface.superelevation for road in roads])
        self._is_shaped = np.array([bool(r.surface.crossfall or r.surface.shape) for r in roads])
        self._heights = HeightTable(self._lanes)

    # ---- poses -------------------------------------------------------------------------------------------------------
    def lane_to_world(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> Poses:
        """World poses; heading, pitch and roll are those of driving along the lane (slope of the lane centre included).

        `s` outside the road is clamped to its ends. Raises `PlaybackError` for a lane that is not there, naming it.
        """

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike, offset: FloatArray) -> tuple[FloatArray, ...]:
            s = self._clamped(road, s)
            profile = self._profile_of(self._row_of(road, lane, s), s)
            t = profile.centre + profile.direction * offset
            return self._pose(road, s, t, profile)

        return Poses(*self._batch(evaluate, 6, road, s, offset, lane=lane))

    def lane_points(
        self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, *offsets: ArrayLike
    ) -> list[tuple[FloatArray, ...]]:
        """x, y, z as of `lane_to_world`, for each of several offsets at the same `s`. Shape as the arguments. [m]"""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike, *offsets: FloatArray) -> tuple[FloatArray, ...]:
            s = self._clamped(road, s)
            profile = self._profile_of(self._row_of(road, lane, s), s)
            frame, rising = self._lines.at(road, s), self._elevation.at(road, s)
            parts: tuple[FloatArray, ...] = ()
            for offset in offsets:
                t = profile.centre + profile.direction * offset
                parts += self._point(frame, self._surface(road, s, t, rising, angles=False), s, t, profile)
            return parts

        parts = self._batch(evaluate, 3 * len(offsets), road, s, *offsets, lane=lane)
        return [parts[k : k + 3] for k in range(0, len(parts), 3)]

    def road_to_world(self, road: ArrayLike, s: ArrayLike, t: ArrayLike = 0.0) -> Poses:
        """World poses; heading along the reference line (+s)."""

        def evaluate(road: IndexLike, s: FloatArray, offset: FloatArray) -> tuple[FloatArray, ...]:
            return self._pose(road, self._clamped(road, s), offset, None)

        return Poses(*self._batch(evaluate, 6, road, s, t))

    def _clamped(self, road: IndexLike, s: FloatArray) -> FloatArray:
        return np.asarray(np.minimum(np.maximum(s, 0.0), self._lengths[road]))

    def _pose(
        self, road: IndexLike, s: FloatArray, t: FloatArray, profile: LaneProfile | None
    ) -> tuple[FloatArray, ...]:
        frame = self._lines.at(road, s)
        surface = self._surface(road, s, t, self._elevation.at(road, s))
        _, pitch, roll, _, drift, _ = surface
        heading = frame.heading if drift is None else frame.heading + np.arctan(drift)
        if profile is not None:  # as the lane's traffic goes: turned by its slope, and round where it runs against s
            if profile.slope.any():
                turn = np.arctan(profile.slope)
                if pitch.any() or roll.any():
                    turn, pitch, roll = turned_in_surface(turn, pitch, roll)
                heading = heading + turn
            backwards = profile.direction < 0
            if np.any(backwards):
                heading = heading + np.pi * backwards
                pitch, roll = pitch * profile.direction, roll * profile.direction
        # into [-pi, pi]
        heading = heading - (2.0 * np.pi) * np.rint(heading / (2.0 * np.pi))
        return *self._point(frame, surface, s, t, profile), heading, pitch, roll

    def _point(
        self, frame: Frame, surface: _Lie, s: FloatArray, t: FloatArray, profile: LaneProfile | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x, y, z of `_pose`."""
        z, _, _, shrink, _, lead = surface
        sideways = t if shrink is None else t * shrink
        x, y = frame.x - sideways * frame.sin, frame.y + sideways * frame.cos
        if lead is not None:
            x, y = x + lead * frame.cos, y + lead * frame.sin
        if profile is not None and self._heights.any:
            z = z + self._heights.at(profile.row, s, t - profile.centre, profile.width, self._lane_ids[profile.row])
        return x, y, z

    def _surface(
        self,
        road: IndexLike,
        s: FloatArray,
        t: FloatArray,
        rising: tuple[FloatArray, FloatArray],
        *,
        angles: bool = True,
    ) -> _Lie:
        """What `Surface.at` answers, by elevation and slope; without `angles` height, shrinking and lead alone."""
        nothing = np.zeros(len(s))
        is_level = self._superelevation.is_zero and not self._is_shaped.any()
        if is_level and self._elevation.is_zero:
            return nothing, nothing, nothing, None, None, None
        height, grade = rising
        if is_level:
            return height, -np.arctan(grade) if angles else nothing, nothing, None, None, None
        angle, twist = self._superelevation.at(road, s)
        shrink, rise = np.cos(angle), np.sin(angle)
        level = 1.0 / np.sqrt(1.0 + grade * grade)
        steep = grade * level
        lead = -t * rise * steep
        height = height + t * rise * level
        lift, lift_along, lean = self._shaped(road, s, t)
        if not angles:
            return height + lift, nothing, nothing, shrink, None, lead
        ahead, behind = (self._elevation.at(road, s + ds)[1] for ds in (GRADE_STEP, -GRADE_STEP))
        bend = (ahead - behind) / (2.0 * GRADE_STEP) * level * level
        onward = 1.0 - t * (shrink * twist * steep + rise * level * bend)
        climb = grade + t * (shrink * twist * level - rise * steep * bend)
        drift = -t * rise * twist / onward
        height, climb, angle = height + lift, (climb + lift_along) / onward, angle + np.arctan(lean)
        pitch = -np.arctan(climb / np.sqrt(1.0 + drift * drift))
        leaning = np.clip(np.sin(angle) * np.cos(np.arctan(grade)) / np.cos(pitch), -1.0, 1.0)
        roll = np.where(climb == grade, angle, np.arcsin(leaning))
        return height, pitch, roll, shrink, drift, lead

    def _lead(self, road: IndexLike, s: FloatArray, across: FloatArray) -> FloatArray | None:
        """How far along s places lie from the feet of their s, `across` the line; None: none leans on a grade. [m]"""
        if self._superelevation.is_zero or self._elevation.is_zero:
            return None
        angle, grade = self._superelevation.at(road, s)[0], self._elevation.at(road, s)[1]
        return np.asarray(-across * np.tan(angle) * grade / np.sqrt(1.0 + grade * grade))

    def _shrink(self, road: IndexLike, s: FloatArray) -> FloatArray:
        """How t shrinks seen from above: cos(superelevation). Shape as `s`. [-]"""
        return np.ones(len(s)) if self._superelevation.is_zero else np.cos(self._superelevation.at(road, s)[0])

    def _height(self, road: IndexLike, s: FloatArray, t: FloatArray) -> FloatArray:
        """Height of the road surface, without kerbs. [m] Shape as `s`."""
        return self._surface(road, s, t, self._elevation.at(road, s), angles=False)[0]

    def _shaped(self, road: IndexLike, s: FloatArray, t: FloatArray) -> FloatArray:
        """Crossfall and shape are rare: place by place."""
        result = np.zeros((3, len(s)))
        if not np.any(self._is_shaped[road]):
            return result
        roads = np.broadcast_to(road, s.shape)
        for i in np.flatnonzero(self._is_shaped[roads]):
            result[:, i] = self.roads[int(roads[i])].surface.profile_at(float(s[i]), float(t[i]))
        return result

    # ---- curvature, lean --------------------------------------------------------------------------------------------
    def curvature(self, road: ArrayLike, s: ArrayLike) -> FloatArray:
        """Curvature of the reference line along +s, positive in left turns. Shape as the arguments. [1/m]"""

        def evaluate(road: IndexLike, s: FloatArray) -> tuple[FloatArray, ...]:
            return (self._lines.at(road, s, derivatives=True).curvature,)

        return self._batch(evaluate, 1, road, s)[0]

    def lane_curvature(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> FloatArray:
        """Curvature of the path at a constant offset from the lane centre, positive turning left in TRAVEL. [1/m]

        The centre's slope t' and bend t'' count, not the change of the line's own curvature along it (under 1e-6 1/m).
        """

        return self._batch(self._curvature_beside, 1, road, s, offset, lane=lane)[0]

    def _curvature_beside(
        self, road: IndexLike, s: FloatArray, lane: IndexLike, offset: FloatArray
    ) -> tuple[FloatArray, ...]:
        s = self._clamped(road, s)
        row = self._row_of(road, lane, s)
        profile = self._profile_of(row, s)
        piece = self._lane_lookup.find(row, s)
        ds = s - self._lane_lookup.starts[piece]
        bend = 2.0 * self._lane_table[2][piece] + 6.0 * ds * self._lane_table[3][piece]
        kappa = self._lines.at(road, s, derivatives=True).curvature
        forward = 1.0 - kappa * (profile.centre + profile.direction * offset)
        turn = forward * (bend + kappa * forward) + 2.0 * kappa * profile.slope**2
        return (profile.direction * turn / (forward**2 + profile.slope**2) ** 1.5,)

    def lean(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Crossfall and grade in travel direction: falling to the RIGHT, and uphill. Shape as the arguments. [%]"""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            s = self._clamped(road, s)
            profile = self._profile_of(self._row_of(road, lane, s), s)
            _, grade = self._elevation.at(road, s)
            angle, twist = self._superelevation.at(road, s)
            _, lift_along, lean = self._shaped(road, s, profile.centre)
            climb = grade + profile.centre * np.cos(angle) * twist + lift_along
            percent = 100.0 * profile.direction
            return np.asarray(percent * np.tan(angle + np.arctan(lean))), percent * climb

        crossfall, grade = self._batch(evaluate, 2, road, s, lane=lane)
        return crossfall, grade


def turned_in_surface(
    turn: FloatArray, pitch: FloatArray, roll: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`places.turned_in_surface` for arrays. Shape (n,) each. [rad]"""
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
