"""What no entity does is refused with its numbers: places, speeds and ways of a frame, from both sides of a limit."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.recorder import Rows
from xosc_lateral.world.scenario.place import Place

ACTIVE, PLACED = int(Activity.ACTIVE), int(Activity.ACTIVE | Activity.TELEPORTED)


def state(*, free: tuple[float, float] | None = None, **about: Any) -> Any:
    """On a road unless it is `free`, at x and y."""
    usual = {
        "name": "A", "active": True, "activity": ACTIVE, "speed": 30.0, "s": 10.0, "offset_t": 0.0, "road": 0,
        "lane": -1, "relative_heading": 0.0, "at_road_end": False, "_located": True,
        "entity": SimpleNamespace(place=Place(Path("x.xosc"), 7, "A")),
    }  # fmt: skip
    pose = None if free is None else SimpleNamespace(x=free[0], y=free[1])
    return SimpleNamespace(**usual | about, free_pose=pose)


@pytest.mark.parametrize(("made", "words"), [
    ({"s": 1.1e8}, "s = 1.1e+08 m, offset = 0 m, speed = 30 m/s"), ({"s": -1.1e8}, "s = -1.1e+08 m"),
    ({"offset_t": 1.1e8}, "s = 10 m, offset = 1.1e+08 m"), ({"speed": 1100.0}, "speed = 1100 m/s"),
    ({"speed": -1100.0}, "speed = -1100 m/s"), ({"speed": np.nan}, "speed = nan m/s"),
    ({"free": (1.1e8, 2.0)}, "x = 1.1e+08 m, y = 2 m"), ({"free": (3.0, -1.1e8)}, "x = 3 m, y = -1.1e+08 m"),
])  # fmt: skip
def test_who_is_farther_away_or_faster_than_anything_is_refused(made: dict[str, Any], words: str) -> None:
    what = rf"x\.xosc:7: A.*'A' leaves every plausible bound at 2\.50 s \(.*{re.escape(words)}.*1e\+08 m and 1000 m/s"
    with pytest.raises(PlaybackError, match=what):
        Rows(state(**made)).write(2.5)


@pytest.mark.parametrize("made", [
    {"s": 1e8}, {"offset_t": -1e8}, {"speed": 1000.0}, {"speed": -1000.0},
    {"speed": 1e9, "activity": PLACED},  # that of a leap is none
    {"speed": 1e9, "active": False, "activity": 0},
])  # fmt: skip
def test_who_is_at_a_limit_or_leaps_or_is_gone_is_written_down(made: dict[str, Any]) -> None:
    Rows(state(**made)).write(2.5)


@pytest.mark.parametrize(("moved", "activity", "refused"), [
    (1000.0, ACTIVE, False), (1100.0, ACTIVE, True), (-1100.0, ACTIVE, True), (1100.0, PLACED, False),
    (1100.0, 0, False),
])  # fmt: skip
def test_nobody_gets_a_kilometre_further_in_a_frame_unless_placed(moved: float, activity: int, refused: bool) -> None:
    time, x = 0.02 * np.arange(4.0), np.array([0.0, 1.0, 1.0 + moved, 1.0 + moved])
    acts = np.array([ACTIVE, ACTIVE, activity, ACTIVE], dtype=np.uint8)
    rows = Rows(state())
    for across in (False, True):
        places = (np.zeros(4), x) if across else (x, np.zeros(4))
        if refused:
            with pytest.raises(PlaybackError, match=rf"at 0\.04 s \({abs(moved):g} m in one frame"):
                rows._check_jumps(time, *places, acts)
        else:
            rows._check_jumps(time, *places, acts)
