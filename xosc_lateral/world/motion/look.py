"""One look at what was made: where vehicles with offsets move otherwise than those that they were made from.

Two runs in the same frames are held against each other, whoever played them: the check of a conversion, a replay's
paths, a player that is driven live. What is wrong with a vehicle need not change any event: it slides while it stands,
is turned, takes another road, goes round a corner that nobody drives, or does not move sideways at all.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from math import inf

import numpy as np
from msgspec import Struct, structs

from xosc_lateral.base.arrays import BoolArray, FloatArray, blocks
from xosc_lateral.base.note import Note
from xosc_lateral.base.track import Track
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork

STORY_PREFIX = "xosc-lateral"
"""Begins the names of stories that we add."""
WINDOW = 1.0
"""In which somebody who drives is seen to move, or to slide. [s]"""
MOVED = 0.001
"""So far sideways at least. [m]"""
DRIVING_SPEED, LEAST_MOVING = 3.0, 0.9
"""Above which somebody drives [m/s], and share of that time that somebody with offsets moves in. [-]"""
LARGEST_SLIDE = 0.05
"""By which a way may be longer in a window than what the speed says, more than in the source. [m]"""
LOOK_STEP, LOOK_AROUND = 0.1, 3.0
"""Accelerations and yaw rates are seen from vertex to vertex of a path (closer, straight pieces are all corners: twice
the acceleration at 20 Hz), and held against the largest of the source so far around. [s]"""
FRAME_TURN, FRAME = 0.010, 0.01
"""By which a heading may turn more in a frame of a player [rad], and how long one is; in longer ones, by `YAW_RATE`
besides. [s]"""
LATERAL_ACCELERATION, YAW_RATE = 2.0, 0.15
"""Beyond the source's: somebody has steered into a corner of a path. [m/s2], [rad/s]"""
HEADING, LARGEST_TURN = np.radians(3.0), 0.1
"""Against the source's; and as nobody drives. [rad]"""
CREEP, TURN_AT_REST = 0.002, 5e-3
"""In all while both stand, and in a frame of it. [m], [rad]"""
STANDING_SPEED = 1e-3
"""[m/s]"""
AS_WRITTEN, ALONG, AFTER_A_SHIFT = 0.05, 0.75, 2.0
"""How far somebody who is left as written may be elsewhere; somebody with offsets, along the road; and anybody, once an
event has come a little earlier or later. [m]"""
GAP = 0.12
"""Around a place that somebody is put at, frames are not compared: one sooner or later makes any difference. [s]"""
CAUSE_TIME = 8.0
"""So long after an action begins, what is seen is said to be after it. [s]"""


class Finding(Struct, frozen=True):
    """One thing that a vehicle does otherwise, at its worst."""

    kind: str
    entity: str
    time: float  # [s]
    size: float  # in the unit of its kind
    what: str  # in words, behind the entity's name and the time
    is_meaning: bool = False  # it drives elsewhere, or as nobody can: smaller offsets may mend it
    cause: str = ""  # what it was at

    def note(self, run: str | None, more: int = 0) -> Note:
        """It as a warning; `more`: runs in which it is found as well."""
        others = f", and in {more} more run{'s' if more > 1 else ''}" if more else ""
        what = f"'{self.entity}' {self.what} at {self.time:.1f} s{self.cause}{others}"
        return Note(what, is_warning=True, entity=self.entity, run=run)


def look_at(
    network: RoadNetwork,
    before: NominalMotion,
    after: NominalMotion,
    moved: Collection[str],
    *,
    shifted: float = inf,
) -> Iterator[Finding]:
    """What vehicles do otherwise in a run than in another one with the same frames.

    - `moved`: those that have offsets; all others have to be where they are without
    - `shifted`: when an event first comes earlier or later: a place that differs then may follow from that [s]
    """
    sources = {entity.name: entity for entity in before.entities}
    for entity in after.entities:
        source = sources[entity.name]
        if entity.name in moved:
            findings = [*_drives_otherwise(network, source, entity)]
            findings += compare_tracks(source, entity, shifted)
        else:
            findings = [*_elsewhere(_Both(source, entity), shifted, AS_WRITTEN)]
        yield from (structs.replace(finding, cause=_cause(before, finding)) for finding in findings)


def compare_parts(source: Track, other: Track) -> Iterator[Finding]:
    """The same for long runs, a block of rows after the other."""
    for rows in blocks(len(source.time)):
        before, after = (
            Track(one.name, one.time[rows], {name: values[rows] for name, values in one.columns.items()},
                  one.breaks[(one.breaks > rows.start) & (one.breaks < rows.stop)] - rows.start)
            for one in (source, other)
        )  # fmt: skip
        yield from compare_tracks(before, after)


def worst_of(findings: Iterable[Finding]) -> list[Finding]:
    """Of each kind and entity."""
    worst: dict[tuple[str, str], Finding] = {}
    for finding in sorted(findings, key=lambda finding: finding.size, reverse=True):
        worst.setdefault((finding.entity, finding.kind), finding)
    return list(worst.values())


def compare_tracks(source: Track, other: Track, shifted: float = inf) -> Iterator[Finding]:
    """How a vehicle with offsets moves, held against itself without: poses alone, in the same frames."""
    both = _Both(source, other)
    if len(both.time) < 4:
        return
    yield from _elsewhere(both, shifted, ALONG)
    corner = list(_corner(both))
    if corner:  # one cause has many effects: the first of them is what it is called, and all are told
        time, words = corner[0][0], " and ".join(what for _, _, what in corner)
        yield Finding("corner", source.name, time, corner[0][1], f"is driven round a corner: {words}")
    yield from _heading(both, shifted)
    yield from _at_rest(both)


def rests_beside(entity: EntityMotion) -> Iterator[Finding]:
    """A vehicle with offsets that does not move sideways in much of the time in which it drives freely."""
    time, moves = moving(entity)
    if len(moves) and moves.mean() < LEAST_MOVING:
        share = 1.0 - float(moves.mean())
        what = f"does not move sideways in {share:.0%} of the time that it drives, first"
        yield Finding("rests", entity.name, float(time[np.argmin(moves)]), share, what)


def moving(entity: EntityMotion) -> tuple[FloatArray, BoolArray]:
    """Times at which a vehicle drives, none of its lateral actions running [s], and whether it moves sideways then."""
    is_free = (entity.activity & (Activity.ACTIVE | Activity.LATERAL)) == Activity.ACTIVE  # no lateral action moves it
    drives = is_free & (np.abs(entity.speed) > DRIVING_SPEED)
    step = np.diff(entity.offset, prepend=entity.offset[:1])
    step[np.flatnonzero(np.diff(entity.lane) | np.diff(entity.road)) + 1] = 0.0
    step[entity.breaks] = 0.0
    return entity.time[drives], _over_window(entity, np.abs(step))[drives] > MOVED


# ---- poses alone -----------------------------------------------------------------------------------------------------
class _Both:
    """Rows that two tracks have in common, and where they can be compared."""

    def __init__(self, source: Track, other: Track) -> None:
        n = min(len(source.time), len(other.time))
        self.name, self.time, self.source, self.other = source.name, source.time[:n], source, other
        self.step = float(self.time[1] - self.time[0]) if n > 1 else LOOK_STEP
        self.a, self.b = (np.stack([one.x[:n], one.y[:n]]) for one in (source, other))
        self.heading = source.heading[:n], other.heading[:n]
        self.speed = np.abs(source.speed[:n]), np.abs(other.speed[:n])
        c, s = np.cos(self.heading[0]), np.sin(self.heading[0])
        dx, dy = self.b - self.a
        self.ahead, self.aside, self.apart = dx * c + dy * s, dy * c - dx * s, np.hypot(dx, dy)
        gaps = np.zeros(n, dtype=np.bool_)
        for track, place, speed in zip((source, other), (self.a, self.b), self.speed, strict=True):
            gaps[track.breaks[track.breaks < n]] = True
            way = np.hypot(*np.diff(place, axis=1))
            gaps[1:] |= way > 2.0 * self.step * np.maximum(speed[1:], speed[:-1]) + 0.3
            if "activity" in track.columns:
                gaps |= (track.activity[:n] & Activity.ACTIVE) == 0
        self.gap = self.around(gaps.astype(np.float64), GAP) > 0.0
        self.bend = _wrapped(np.diff(self.heading[0], prepend=self.heading[0][:1]))

    def around(self, values: FloatArray, time: float, step: float | None = None) -> FloatArray:
        """The largest within a time on either side. [s]"""
        reach = int(np.ceil(time / (step or self.step) - 1e-9))
        size, n = 2 * reach + 1, len(values)
        padded = np.pad(values, (reach, reach + (-n - 2 * reach) % size), mode="edge").reshape(-1, size)
        ahead = np.maximum.accumulate(padded, axis=1).ravel()  # from the begin of each block of such a size
        behind = np.maximum.accumulate(padded[:, ::-1], axis=1)[:, ::-1].ravel()  # to its end
        return np.asarray(np.maximum(behind[:n], ahead[size - 1 : size - 1 + n]))

    def worst(self, values: FloatArray, limit: float) -> tuple[float, float] | None:
        """Time and value where a column is most above a limit, where rows can be compared."""
        if not len(values):
            return None
        row = int(np.argmax(values))
        return (float(self.time[row]), float(values[row])) if values[row] > limit else None


def _wrapped(angle: FloatArray) -> FloatArray:
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _elsewhere(both: _Both, shifted: float, limit: float) -> Iterator[Finding]:
    """Along the road where it has offsets, else anywhere."""
    far = both.apart
    if limit == ALONG:  # beside its way, a bend is longer or shorter for who drives at his speed; a replay is on time
        longer = np.cumsum(np.where(both.gap, 0.0, both.aside * both.bend))
        far = np.minimum(np.abs(both.ahead), np.abs(both.ahead - longer))
    far = np.where(both.gap, 0.0, far)
    for rows, most in ((both.time < shifted, limit), (both.time >= shifted, AFTER_A_SHIFT)):
        if worst := both.worst(np.where(rows, far, 0.0), most):
            begins = float(both.time[np.argmax(rows & (far > most))])
            where = "along the road" if limit == ALONG else "from where it is as written"
            what = f"is up to {worst[1]:.2f} m elsewhere {where}, from {begins:.1f} s on,"
            # above the second limit though nothing came at another time: another meaning
            yield Finding("elsewhere", both.name, *worst, what, is_meaning=most == ALONG and worst[1] > AFTER_A_SHIFT)
            return


def _corner(both: _Both) -> Iterator[tuple[float, float, str]]:
    """Turn in a frame, lateral acceleration, yaw rate beyond the source's: time, size, words."""
    turns = [np.abs(_wrapped(np.diff(heading, prepend=heading[:1]))) for heading in both.heading]
    more = np.where(both.gap, 0.0, turns[1] - both.around(turns[0], LOOK_AROUND))
    if worst := both.worst(more, FRAME_TURN + YAW_RATE * max(both.step - FRAME, 0.0)):
        yield *worst, f"{1e3 * worst[1]:.0f} mrad in a frame of {both.step:g} s"
    every = max(1, round(LOOK_STEP / both.step))
    step, gap = every * both.step, both.around(both.gap.astype(np.float64), LOOK_STEP)[::every] > 0.0
    accelerations, rates = list[FloatArray](), list[FloatArray]()
    for place, heading in zip((both.a, both.b), both.heading, strict=True):
        ax, ay = np.pad(np.diff(place[:, ::every], 2, axis=1), ((0, 0), (1, 1))) / step**2
        course = heading[::every]
        accelerations.append(np.abs(ay * np.cos(course) - ax * np.sin(course)))
        rates.append(np.abs(_wrapped(np.diff(course, prepend=course[:1]))) / step)
    for (then, now), limit, unit in (
        (accelerations, LATERAL_ACCELERATION, "m/s2 sideways"),
        (rates, YAW_RATE, "rad/s of yaw"),
    ):
        beyond = np.where(gap, 0.0, now - both.around(then, LOOK_AROUND, step))
        row = int(np.argmax(beyond))
        if beyond[row] > limit:
            yield float(both.time[row * every]), float(beyond[row]), f"{beyond[row]:.1f} {unit} more"


def _heading(both: _Both, shifted: float) -> Iterator[Finding]:
    """Against the source's, where both are at the same: a place a little ahead in a bend is turned already."""
    curved = both.around(np.abs(both.bend) / np.maximum(both.speed[0] * both.step, FRAME), WINDOW)
    turned = np.abs(_wrapped(both.heading[1] - both.heading[0])) - both.apart * curved
    if worst := both.worst(np.where(both.gap | (both.time >= shifted), 0.0, turned), HEADING):
        what = f"is turned by {np.degrees(worst[1]):.1f} degrees"
        yield Finding("heading", both.name, *worst, what, is_meaning=worst[1] > LARGEST_TURN)


def _at_rest(both: _Both) -> Iterator[Finding]:
    """Whoever stands stays where and as he is."""
    stands = (both.speed[0] < STANDING_SPEED) & (both.speed[1] < STANDING_SPEED) & ~both.gap
    stands[1:] &= stands[:-1].copy()
    stands[:1] = False
    ways = [np.hypot(*np.diff(place, axis=1, prepend=place[:, :1])) for place in (both.a, both.b)]
    creeps = float(np.maximum(ways[1] - ways[0], 0.0)[stands].sum())
    if creeps > CREEP:
        time = float(both.time[np.argmax(stands)])
        yield Finding("creeps", both.name, time, creeps, f"moves by {1e3 * creeps:.0f} mm while it stands,")
    turns = [np.abs(_wrapped(np.diff(heading, prepend=heading[:1]))) for heading in both.heading]
    if worst := both.worst(np.where(stands, turns[1] - turns[0], 0.0), TURN_AT_REST):
        yield Finding("turns at rest", both.name, *worst, f"turns by {1e3 * worst[1]:.0f} mrad while it stands,")


def _cause(run: NominalMotion, finding: Finding) -> str:
    """The action that it began last, in words."""
    actions = [
        action
        for action in run.actions
        if action.actor == finding.entity
        and len(action.path) > 1
        and 0.0 <= finding.time + run.step - action.start < CAUSE_TIME
    ]
    return f", after event '{max(actions, key=lambda action: action.start).path[-2]}' began" if actions else ""


# ---- on the road -----------------------------------------------------------------------------------------------------
def _drives_otherwise(network: RoadNetwork, source: EntityMotion, entity: EntityMotion) -> Iterator[Finding]:
    """Where it slides, and takes another road."""
    slides = [_over_window(one, np.maximum(_longer_way(one), 0.0)) for one in (source, entity)]
    row = int(np.argmax(slides[1]))

    def finding_of(kind: str, size: float, what: str, row: int) -> Finding:
        return Finding(kind, entity.name, float(entity.time[row]), size, what, is_meaning=True)

    if slides[1][row] > slides[0].max() + LARGEST_SLIDE:
        size = float(slides[1][row])
        yield finding_of("slides", size, f"is put {size:.2f} m from where it drives", row)
    roads = [_roads(network, one) for one in (source, entity)]
    for k, ((road, row), (other, _)) in enumerate(zip(roads[1], roads[0], strict=False)):
        if road != other:
            yield finding_of("road", inf, f"drives onto road '{network.road_ids[road]}' as number {k + 1}", row)
            break


def _longer_way(entity: EntityMotion) -> FloatArray:
    """By how much the way of each frame is longer than its speed says. [m]"""
    way = np.hypot(np.diff(entity.x, prepend=entity.x[:1]), np.diff(entity.y, prepend=entity.y[:1]))
    longer = way - np.maximum(np.abs(entity.speed), np.abs(np.roll(entity.speed, 1))) * (
        entity.time[1] - entity.time[0]
    )
    longer[entity.breaks] = 0.0
    return np.where((entity.activity & Activity.ACTIVE) != 0, longer, 0.0)


def _over_window(entity: EntityMotion, values: FloatArray) -> FloatArray:
    """Sum over the window around each row."""
    half = max(1, round(0.5 * WINDOW / (entity.time[1] - entity.time[0])))
    total = np.concatenate(([0.0], np.cumsum(values)))
    rows = np.arange(len(values))
    return np.asarray(total[np.minimum(rows + half, len(values))] - total[np.maximum(rows - half, 0)])


def _roads(network: RoadNetwork, entity: EntityMotion) -> list[tuple[int, int]]:
    """Roads that are none of a junction, in order, each with the row in which it is entered."""
    rows = np.flatnonzero(np.diff(entity.road, prepend=-2) != 0)
    entries: list[tuple[int, int]] = []
    for row in rows.tolist():
        road = int(entity.road[row])
        if road >= 0 and network.roads[road].junction is None and (not entries or entries[-1][0] != road):
            entries.append((road, row))
    return entries
