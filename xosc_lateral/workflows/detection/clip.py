"""A few seconds of a scene as the page's player takes them."""

from __future__ import annotations

import numpy as np

from xosc_lateral.workflows.detection.scoring import Case
from xosc_lateral.workflows.detection.tracks import STEP, Track
from xosc_lateral.workflows.playing.scene import scene_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.scenario import BoundingBox, Entity
from xosc_lateral.world.scenario.enums import EntityCategory
from xosc_lateral.world.scenario.place import Place

NEAR_DISTANCE = 120.0
"""Vehicles farther from the case's are left out. [m]"""
VEHICLE_HEIGHT = 1.5
"""Nobody sees it from above. [m]"""


def clip_scene(case: Case, around: float) -> str | None:
    """JSON for the player, the case's vehicle first; None: nobody knows where on a road it is."""
    network = case.scene.network
    if network is None:
        return None
    middle = round(case.time / STEP)
    half = round(around / STEP)
    instants = np.arange(middle - half, middle + half + 1)
    own = case.view.track
    rows = (instants - own.first).clip(0, len(own) - 1)
    here = own.rows.x[rows], own.rows.y[rows]
    tracks = [own, *(one for one in case.scene.tracks if one is not own and _is_near(one, instants, here))]
    entities = tuple(_motion(track, instants) for track in tracks)
    motion = NominalMotion(STEP, entities, (), float(len(instants) * STEP), "clip", ())
    return scene_of(motion, network)


def _is_near(track: Track, instants: np.ndarray, here: tuple[np.ndarray, np.ndarray]) -> bool:
    rows = instants - track.first
    there = (rows >= 0) & (rows < len(track))
    away = np.hypot(track.rows.x[rows[there]] - here[0][there], track.rows.y[rows[there]] - here[1][there])
    return bool((away < NEAR_DISTANCE).any())


def _motion(track: Track, instants: np.ndarray) -> EntityMotion:
    rows = instants - track.first
    there = (rows >= 0) & (rows < len(track))
    rows, one = rows.clip(0, len(track) - 1), track.rows
    size = track.size
    box = BoundingBox(size.ahead, 0.0, 0.5 * VEHICLE_HEIGHT, size.length, size.width, VEHICLE_HEIGHT)
    entity = Entity(name=track.name, category=EntityCategory.VEHICLE, bounding_box=box, place=Place("", 0, ""))
    none = np.zeros(len(rows))
    numbers = one.road[rows].astype(np.int32), one.lane[rows].astype(np.int32)
    activity = np.where(there, np.uint8(Activity.ACTIVE), np.uint8(0)).astype(np.uint8)
    return EntityMotion(
        entity, STEP * (instants - instants[0]), one.x[rows], one.y[rows], none, one.heading[rows], none, none,
        one.speed[rows], *numbers, one.s[rows], one.offset[rows], none, activity,
    )  # fmt: skip
