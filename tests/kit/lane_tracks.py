"""Tracks with known lane changes and known movement, on three straight lanes."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.extras.detect.tracks import LaneTrack, Scene, tracks_of
from xosc_lateral.world.motion.nominal import EntityMotion, made_vehicle

LANE, WIDTH, SPEED = 3.5, 1.9, 30.0


def lane_change(time: FloatArray, begin: float, duration: float, side: int = 1) -> FloatArray:
    """Lateral position of a lane change, half a sine. [m]"""
    share = np.clip((time - begin) / duration, 0.0, 1.0)
    return side * LANE * (0.5 - 0.5 * np.cos(np.pi * share))


def track(
    lateral: FloatArray, *, name: str = "A", lane: int = 1, x: float = 0.0, speed: float = SPEED, step: float = 0.1
) -> LaneTrack:
    """A vehicle on lane `lane` of three (0: right) that is `lateral` to the left of that lane's centre. [m]"""
    time = step * np.arange(len(lateral))
    across = np.round(lateral / LANE)
    n = len(time)
    along, left = x + speed * time, LANE * lane + lateral
    motion = EntityMotion.of(
        made_vehicle(name, 4.6, WIDTH, 1.4), time, x=along, y=left, heading=np.zeros(n), speed=np.full(n, speed),
        road=np.zeros(n, dtype=np.int32), lane=np.round(-1.0 - lane - across).astype(np.int32), s=along,
        offset=lateral - LANE * across, lane_width=np.full(n, LANE), lane_index=lane + across,
        lane_count=np.full(n, 3.0), following=np.ones(n, dtype=np.bool_), line=np.zeros(n, dtype=np.int64),
        rank=np.round(lane + across).astype(np.int64), station=along + 1.4,
    )  # fmt: skip
    (made,) = tracks_of(motion, cluster=name)
    return made


def scene(*tracks: LaneTrack, ego: str | None = None) -> Scene:
    return Scene("made", tracks, ego)


def weave(seconds: float, amplitude: float, period: float, step: float = 0.1) -> FloatArray:
    """A sine about the lane's centre. [m]"""
    return amplitude * np.sin(2.0 * np.pi / period * step * np.arange(round(seconds / step)))
