"""A scenario in the reference player, and measures of how its cars move there."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from laboratory.agreement import reference_rows

STEP = 0.01
"""Of the player. [s]"""
FAST = 5.0
"""The direction of a slower car can't be told by its steps. [m/s]"""
AROUND = 0.15
"""The nominal motion's own turns may come this much earlier or later: one vertex and half of the next. [s]"""
BESIDE = 1.1
"""A metre beside the middle of a bend of 10 m: so much the turn may differ. [-]"""
JUMP = 0.3
"""Farther than it drives in a step: the car was placed anew. [m]"""
ABREAST = 4
"""Steps of looking for the moment at which a car was to be where it is."""
EARLIER = 1.0
"""Than that moment, or later, is looked for. [s]"""
_MESSAGE = re.compile(r"\[\s*([\d.]+)\] \[info\] (.*?) \w+ -> (startTransition -> runningState|\w+ -> completeState)")

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PlayerRun:
    """Rows by entity, and when which element of the storyboard started and was over."""

    rows: Mapping[str, pd.DataFrame]
    starts: Mapping[str, Sequence[float]]
    ends: Mapping[str, Sequence[float]]

    def spans(self, name: str) -> list[Span]:
        """From each start of an element to its end."""
        ends = self.ends.get(name, ())
        return [
            (start, min((end for end in ends if end >= start), default=np.inf)) for start in self.starts.get(name, ())
        ]


def run(player: Path, scenario: Path, limit: float, folder: Path) -> PlayerRun:
    """Play a scenario with frames of `STEP`, controllers off."""
    log = folder / "messages.txt"
    log.unlink(missing_ok=True)
    rows = reference_rows(player, scenario, STEP, limit, messages=log)
    starts: dict[str, list[float]] = {}
    ends: dict[str, list[float]] = {}
    for line in log.read_text(errors="replace").splitlines() if log.is_file() else ():
        if found := _MESSAGE.search(line):
            which = starts if found[3].startswith("start") else ends
            which.setdefault(found[2], []).append(float(found[1]))
    return PlayerRun({str(name): one.drop_duplicates("time") for name, one in rows.groupby("name")}, starts, ends)


def within(time: FloatArray, spans: Sequence[Span]) -> BoolArray:
    """Rows inside one of the spans."""
    inside = np.zeros(len(time), dtype=bool)
    for start, end in spans:
        inside |= (time >= start) & (time <= end)
    return inside


def placed(rows: pd.DataFrame) -> list[Span]:
    """A few rows around each time at which an entity is placed anew."""
    step, time = np.hypot(np.diff(rows["x"]), np.diff(rows["y"])), rows["time"].to_numpy()
    driven = np.abs(rows["speed"].to_numpy()[1:]) * np.diff(time)
    return [(moment - 0.04, moment + 0.04) for moment in time[1:][(step > driven + JUMP) | (np.diff(time) > 0.05)]]


def distance(meant: pd.DataFrame, played: pd.DataFrame) -> FloatArray:
    """From the meant place, at each row of the player; not a number where it was placed anew. [m]"""
    time = played["time"].to_numpy()
    return np.where(_is_known(meant, time), np.hypot(*_away(meant, played, time)), np.nan)


def beside(meant: pd.DataFrame, played: pd.DataFrame) -> FloatArray:
    """From the meant path, to the left, at each row of the player; not a number where it was placed anew. [m]

    Compared with the moment at which the entity was to be abreast: a maneuver that begins one of the player's frames
    earlier leaves a car farther along its path, which bends.
    """
    time = played["time"].to_numpy()
    at = time
    for _ in range(ABREAST):
        ahead, _ = _away(meant, played, at)
        speed = np.interp(at, meant["time"], meant["speed"])
        late = ahead / np.where(np.abs(speed) < FAST, np.copysign(FAST, speed), speed)
        at = np.clip(at + late, time - EARLIER, time + EARLIER)
    return np.where(_is_known(meant, time) & _is_known(meant, at), _away(meant, played, at)[1], np.nan)


def _away(meant: pd.DataFrame, played: pd.DataFrame, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ahead of the place meant at some times, and to its left. [m]"""
    dx, dy = (played[axis].to_numpy() - np.interp(time, meant["time"], meant[axis]) for axis in "xy")
    heading = np.interp(time, meant["time"], np.unwrap(meant["h"]))
    return dx * np.cos(heading) + dy * np.sin(heading), dy * np.cos(heading) - dx * np.sin(heading)


def _is_known(meant: pd.DataFrame, time: FloatArray) -> BoolArray:
    return ~within(time, placed(meant)) & (time >= meant["time"].min()) & (time <= meant["time"].max())


def sharpest(played: pd.DataFrame, others: Sequence[pd.DataFrame], *, by_path: bool) -> tuple[FloatArray, FloatArray]:
    """Times [s], and by how much the turn of a frame exceeds all those of the others around that time. [rad]

    By the direction of movement, or by the heading. Going straight on is no turn, whatever the others do; a path
    beside theirs has another radius (`BESIDE`). 0 where the car is slow or placed anew.
    """
    time, turn = _turns(played, by_path=by_path)
    high, low = np.zeros(len(time)), np.zeros(len(time))
    for other in others:
        before, nominal = _turns(other, by_path=by_path)
        if len(nominal) == 0:
            continue
        around = pd.Series(nominal).rolling(2 * round(AROUND / (before[1] - before[0])) + 1, center=True, min_periods=1)
        high = np.maximum(high, np.interp(time, before, around.max()))
        low = np.minimum(low, np.interp(time, before, around.min()))
    slow = np.interp(time, played["time"], np.abs(played["speed"])) < FAST
    anew = within(time, [span for rows in (played, *others) for span in placed(rows)])
    excess = np.maximum(np.maximum(turn - BESIDE * high, BESIDE * low - turn), 0.0)
    return time, np.where(slow | anew, 0.0, excess)


def _turns(rows: pd.DataFrame, *, by_path: bool) -> tuple[FloatArray, FloatArray]:
    """Times, and change of direction in `STEP` between rows. [s], [rad]"""
    time, heading = rows["time"].to_numpy(), np.unwrap(rows["h"])
    if by_path:
        x, y = rows["x"].to_numpy(), rows["y"].to_numpy()
        time, heading = time[1:], np.unwrap(np.angle(np.diff(x) + 1j * np.diff(y)))
    return time[1:], np.diff(heading) * (STEP / np.diff(time))


def shifts(
    before: Mapping[str, Sequence[float]], after: Mapping[str, Sequence[float]], end: float
) -> tuple[float, int]:
    """Largest difference of starts by name [s], and how many are gone; from 0.1 s before the end on none counts."""
    late, lost = 0.0, 0
    for name, times in before.items():
        now, due = after.get(name, ()), [moment for moment in times if moment < end - 0.1]
        late = max([late, *(abs(a - b) for a, b in zip(due, now, strict=False))])
        lost += max(len(due) - len(now), 0)
    return late, lost
