"""What is wrong with a run, or an output of a conversion: each a kind with whom it concerns, when, and its size.

How vehicles move is judged by the product's own look (`world.motion.look`): one implementation, two uses. Here it looks
at what the reference player does, where the product looks at what its own player does. What happens (events, contacts,
ends) is taken from the player, too, and so are frames that are doubled and swerves beyond the marking.

A finding is a dict: kind, context (what the vehicle was at), who, t [s], size, event, said (a message tells it).
"""

from __future__ import annotations

import re

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from laboratory.find.player import DONE, EVENT, RUNNING
from tests.kit.generated.write import CLASSES
from xosc_lateral.base.track import Track
from xosc_lateral.world.motion import look

PLACE, TURNED = 0.05, 0.02
"""Of our player from the reference player. [m], [rad]"""
LATE, LATE_END, END, CONTACT = 0.1, 0.5, 0.1, 0.25
"""Starts, ends of events, of the run, contacts. [s]"""
FRAME_WAY = 0.05
"""By which the way of a frame may differ from what the speed says, more than in the source. [m]"""
SWERVE = 0.1
"""Beyond the marking, and farther than in the replay of the same seed. [m]"""
CEILINGS = {
    "AS_WRITTEN": 0.05, "ALONG": 0.75, "FRAME_TURN": 0.010, "LATERAL_ACCELERATION": 2.0, "YAW_RATE": 0.15,
    "HEADING": 0.0524, "CREEP": 0.002, "TURN_AT_REST": 5e-3, "AFTER_A_SHIFT": 2.0,
}  # fmt: skip
"""The look's bounds as they were agreed upon: who widens one in the product blinds this judge, too, and is found."""
LATERALS = {"change", "offset", "trajectory", "teleport", "beside"}
SAME_TIME = 1.0
"""Of a finding and of a message that tells it. [s]"""
TELLING = {
    "event starts": "happens|comes|shifts", "event ends": "is over|lasts", "event lost": "no longer happens",
    "event never ends": "is over|no longer", "event added": "is new|once more", "order changes": "comes before",
    "run ends": "the end", "contact": "contact|touch", "last lane": "last lane|drives onto", "elsewhere": "elsewhere",
    "corner": "corner|turned across", "heading": "is turned|corner", "creeps": "while it stands|is put|slides",
    "turns at rest": "turns",
    "swerves": "leaves its lane", "jumps": "is put|elsewhere|slides",
    "rests": "move sideways|times what was sampled|are none|stays as it is",
}  # fmt: skip
"""Words of the messages that tell a kind, by how it begins."""
DIFFERS = "in esmini|not played"
"""Words of those that say, for all that follows, that the reference player plays the source otherwise."""


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def widest(values, n):
    """Largest within n samples on either side."""
    return sliding_window_view(np.pad(values, n), 2 * n + 1).max(1) if len(values) else values


def together(a, b):
    """Rows of both at the same times."""
    _, i, j = np.intersect1d(np.round(a[:, 0] * 100), np.round(b[:, 0] * 100), return_indices=True)
    return a[i], b[j]


def told(finding, messages):
    """Whether a message names kind, entity and time: of the finding, or `since` its event began.

    The time is asked where the product plays the same run, too, and of what has one.
    """
    words = next((words for kind, words in TELLING.items() if finding["kind"].startswith(kind)), "")
    names = [f"'{name}'" for name in (finding["who"], finding.get("event")) if name]
    for entity, text in messages:
        about = entity == finding["who"] or any(name in text for name in names)
        times = [float(one) for one in re.findall(r"(\d+(?:\.\d+)?) s\b", text)]
        is_other = finding.get("ego", "nominal") != "nominal"
        if about and re.search(DIFFERS, text) and (is_other or min(times, default=0.0) <= finding["t"] + SAME_TIME):
            return True
        if not (about and words and re.search(words, text)):
            continue
        if is_other or re.search("more run|of the time that", text):
            return True
        if any(abs(one - t) <= SAME_TIME for one in times for t in (finding["t"], finding.get("since", finding["t"]))):
            return True
    return False


def occurrences(run, names):
    found = {}
    for name, kind, state, t in run["states"]:
        has_begun = state == RUNNING or (name, RUNNING) in found  # the end of a run ends what never began, too
        if kind == EVENT and state in (RUNNING, DONE) and name in names and has_begun:
            found.setdefault((name, state), []).append(t)
    return found


def context(spec, run, who, t):
    """What a vehicle is at: its act that began last, and on what."""
    kinds = {event["name"]: [do[0] for do in event["do"]] for event in spec["events"] if event["of"] == who}
    begun = [(at, name) for name, kind, state, at in run["states"]
             if kind == EVENT and state == RUNNING and name in kinds and at <= t + 0.02]  # fmt: skip
    acts = "+".join(kinds[max(begun)[1]]) if begun else "none"
    if who not in run["rows"]:
        return f"{spec['road']['kind']}, after {acts}"
    rows = run["rows"][who]
    speed = rows[np.searchsorted(rows[:, 0], t - 1e-6).clip(0, len(rows) - 1), 4]
    before = rows[(rows[:, 0] <= t) & (rows[:, 0] > t - look.CAUSE_TIME), 4].min(initial=99)
    pace = "standing" if speed < 0.1 else "from rest" if before < 0.1 else "slow" if speed < 5 else "driving"
    return f"{spec['road']['kind']}, after {acts}, {pace}"


def plays(spec, ours, theirs):
    """Our player against the reference player: the first difference, since others follow from it."""
    out = []
    for who, b in theirs["rows"].items():
        if who not in ours["rows"]:
            out.append({"kind": "entity is not played", "who": who, "t": 0.0, "size": 1.0})
            continue
        x, y = together(ours["rows"][who], b)
        apart, turned = np.hypot(x[:, 1] - y[:, 1], x[:, 2] - y[:, 2]), np.abs(wrap(x[:, 3] - y[:, 3]))
        for kind, limit, size in (("elsewhere", PLACE, apart), ("turned", TURNED, turned)):
            if (size > limit).any():
                out.append({"kind": kind, "who": who, "t": float(y[(size > limit).argmax(), 0]), "size": size.max()})
                break
        late = abs(ours["rows"][who][-1, 0] - b[-1, 0])
        if late > END:
            out.append({"kind": "ends at another time", "who": who, "t": float(b[-1, 0]), "size": float(late)})
    first = min((one["t"] for one in out), default=0)
    return [{**one, "context": context(spec, theirs, one["who"], one["t"])} for one in out if one["t"] <= first + 0.02]


def happens(names, a, b):
    """What happens otherwise, and when something first comes earlier, later or not at all."""
    then_all, now_all, ends = occurrences(a, names), occurrences(b, names), min(a["end"], b["end"])
    out, first = [], np.inf

    def add(kind, name, t, size=1.0):
        begun = max((u for u in then_all.get((name, RUNNING), ()) if u <= t), default=t)
        out.append(
            {"kind": kind, "who": names[name], "t": float(t), "size": float(size), "event": name, "since": begun}
        )

    for (name, state), then in sorted(then_all.items()):
        now, starts = now_all.get((name, state), []), state == RUNNING
        begun = zip(then_all.get((name, RUNNING), []), now_all.get((name, RUNNING), []), strict=False)
        moved = [0.0] * len(then) if starts else [u - t for t, u in begun] + [0.0] * len(then)
        for t, u, with_start in zip(then, now, moved, strict=False):
            is_cut = not starts and (t > a["end"] - 0.02 or u > b["end"] - 0.02)  # by the end of a run, it has none
            if not is_cut and min(abs(u - t), abs(u - t - with_start)) > (LATE if starts else LATE_END):
                add(f"event {'starts' if starts else 'ends'} {'later' if u > t else 'earlier'}", name, t, abs(t - u))
        for t in then[len(now) :]:
            if t < ends - 0.5:
                add("event lost" if starts else "event never ends", name, t)
        first = min(
            [first, *(min(t, u) for t, u in zip(then, now, strict=False) if abs(t - u) > 0.03), *then[len(now) :]]
        )
    for (name, state), now in sorted(now_all.items()):
        more = now[len(then_all.get((name, state), [])) :]
        first = min([first, *more])
        for t in more if state == RUNNING else ():
            if t < ends - 0.5:
                add("event added", name, t)
    both = [(one, k) for one in then_all if one in now_all for k in range(min(len(then_all[one]), len(now_all[one])))]
    for i, (p, k) in enumerate(both):
        for q, m in both[i + 1 :]:
            apart, now_apart = then_all[p][k] - then_all[q][m], now_all[p][k] - now_all[q][m]
            if apart * now_apart < 0 and abs(apart - now_apart) > LATE:
                add("order changes", p[0], min(then_all[p][k], then_all[q][m]), abs(apart - now_apart))
    return out, first


def touches(a, b):
    """Contacts that are new, gone, or at another time."""
    for pair in a["contacts"].keys() | b["contacts"].keys():
        t, u = a["contacts"].get(pair), b["contacts"].get(pair)
        who = next((one for one in pair if one != "Ego"), "Ego")
        if t is None or u is None:
            kind = "contact is new" if t is None else "contact is lost"
            yield {"kind": kind, "who": who, "t": t or u or 0.0, "size": 1.0}
        elif abs(t - u) > CONTACT:
            yield {"kind": "contact moved", "who": who, "t": t, "size": abs(t - u)}


def busy(spec, run, who, time):
    """Rows in which actions of its own move a vehicle aside."""
    own = {event["name"] for event in spec["events"] if event["of"] == who and {do[0] for do in event["do"]} & LATERALS}
    rows = np.zeros(len(time), dtype=bool)
    for name in own:
        found = occurrences(run, {name})
        ends = found.get((name, DONE), [])
        for begins in found.get((name, RUNNING), []):
            rows |= (time >= begins) & (time <= min((end for end in ends if end >= begins), default=np.inf) + 1.0)
    return rows


def placed(spec, run, who, time):
    """Rows, from 1 on, into which a vehicle is put: `Track.breaks`."""
    own = {
        event["name"] for event in spec["events"] if event["of"] == who and "teleport" in {do[0] for do in event["do"]}
    }
    rows = {int(np.searchsorted(time, t + 1e-6)) for found in occurrences(run, own).values() for t in found}
    return np.array(sorted(row + more for row in rows for more in (-1, 0) if 0 < row + more < len(time)), dtype=int)


def moves(spec, who, source, other, shifted, *, breaks, is_moved, replay=None, own=False):
    """How a vehicle moves otherwise: kind, time, size; `own`: see `busy`; `replay`: its replay`s rows, when asked."""
    tracks = [
        Track(who, rows[:, 0], dict(zip(("x", "y", "heading", "speed"), rows[:, 1:5].T, strict=True)), put)
        for rows, put in zip((source, other), breaks, strict=True)
    ]  # fmt: skip
    if not is_moved:
        far = np.hypot(*(other - source)[:, 1:3].T)
        far[source[:, 0] >= shifted] = 0.0
        if far.max() > look.AS_WRITTEN:
            yield "elsewhere, as written", source[far.argmax(), 0], far.max()
        return
    for one in look.compare_tracks(*tracks, shifted):
        yield one.kind, one.time, one.size
    ways = [np.hypot(*np.diff(rows[:, 1:3], axis=0, prepend=rows[:1, 1:3]).T) for rows in (source, other)]
    steps = [np.diff(rows[:, 0], prepend=rows[0, 0]) * rows[:, 4] for rows in (source, other)]
    strays = [np.abs(way - step) for way, step in zip(ways, steps, strict=True)]
    leaps = widest((strays[0] > 0.5).astype(float), 12) > 0
    more = np.where(leaps, 0.0, strays[1] - widest(strays[0], 100))
    if more.max() > FRAME_WAY:
        yield "jumps along", source[more.argmax(), 0], more.max()
    aside = (other[:, 2] - source[:, 2]) * np.cos(source[:, 3]) - (other[:, 1] - source[:, 1]) * np.sin(source[:, 3])
    is_other = (source[:, 5:7] != other[:, 5:7]).any(1)  # roads of a junction lie over each other: where it is counts
    if shifted == np.inf and is_other[-1] and abs(aside[-1]) > 0.5 * spec["road"].get("width", 3.5):
        yield "last lane is another", source[-1, 0], 1.0
    there = other.copy()
    there[is_other, 7] = np.abs(aside[is_other]) + np.abs(source[is_other, 7])
    beyond = [_beyond(spec, who, rows) for rows in (source, there)]
    calm = (source[:, 0] < shifted) & (widest(np.abs(np.diff(source[:, 7], prepend=source[0, 7])), 100) < 1e-4)
    past = np.where(calm & (beyond[0] <= 0.0), beyond[1], 0.0)
    if replay is not None and past.max() > SWERVE:
        again = replay()
        if again is not None and past.max() > SWERVE + max(0.0, _beyond(spec, who, again).max()):
            yield "swerves", source[past.argmax(), 0], past.max()
    drives = (source[:, 4] > look.DRIVING_SPEED) & ~own
    if drives.sum() > 4.0 / 0.01:
        width = np.ptp(sliding_window_view(aside, 200), axis=1)[sliding_window_view(drives, 200).all(1)]
        if len(width) > 200 and np.mean(width > 2.0 * look.MOVED) < 0.8:
            yield "rests beside its way", source[drives.argmax(), 0], 1.0 - float(np.mean(width > 2.0 * look.MOVED))


def _beyond(spec, who, rows):
    """By how much a body is beyond its lane's marking; below 0: within. [m]"""
    kind = next(one["class"] for one in spec["vehicles"] if one["name"] == who)
    if spec["road"]["kind"] == "taper" or kind not in CLASSES:  # widths that change
        return np.full(len(rows), -np.inf)
    return np.abs(rows[:, 7]) + 0.5 * CLASSES[kind][1] - 0.5 * spec["road"].get("width", 3.5)


def compares(spec, a, b, moved, there, replay=None):
    """An output against its source, both played under the same ego.

    - `there`: names of events that the output still has
    - `replay`: of a vehicle: its rows in the trajectory output of the same seed, or None
    """
    names = {event["name"]: event["of"] for event in spec["events"] if event["name"] in there}
    out, shifted = happens(names, a, b)
    if abs(a["end"] - b["end"]) > END:
        out.append(
            {
                "kind": "run ends at another time",
                "who": "Ego",
                "t": min(a["end"], b["end"]),
                "size": abs(a["end"] - b["end"]),
            }
        )
    out += touches(a, b)
    wider = (name for name, most in CEILINGS.items() if getattr(look, name) > most)
    out += [{"kind": f"bound is wider: {name}", "who": "Ego", "t": 0.0, "size": getattr(look, name)} for name in wider]
    for who, rows in a["rows"].items():
        if who not in b["rows"]:
            out.append({"kind": "entity missing", "who": who, "t": 0.0, "size": 1.0})
            continue
        source, other = together(rows, b["rows"][who])
        if len(source) < 50:
            continue
        again = (lambda name=who: replay(name)) if replay else None
        own, breaks = busy(spec, a, who, source[:, 0]), [placed(spec, run, who, source[:, 0]) for run in (a, b)]
        found = moves(spec, who, source, other, shifted, is_moved=who in moved, replay=again, own=own, breaks=breaks)
        out += [{"kind": kind, "who": who, "t": float(t), "size": float(size)} for kind, t, size in found]
    return [{**one, "context": context(spec, a, one["who"], one["t"])} for one in out]
