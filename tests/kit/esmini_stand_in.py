"""A stand-in for esmini's library, written from its header: our own player's motion, and what is reported to it."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.extras.live.esmini import LATERAL_ACTIONS
from xosc_lateral.extras.live.esmini_library import ObjectState
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.scenario.private_actions import FollowTrajectoryAction

STEP = 0.01


class StandIn:
    """The functions that `EsminiTraffic` calls, as methods.

    What tests turn: `broken` (name -> fields of its state that lie), `gone` (names), `offset` (name -> [m]).
    """

    def __init__(self) -> None:
        self.row = 0
        self.offset: dict[str, float] = {}
        self.broken: dict[str, dict[str, float]] = {}
        self.gone: set[str] = set()
        self.shown: dict[str, float] = {}
        self.closed = False
        self.callback: Callable[..., None] = lambda *_: None

    def SE_Init(self, scenario: bytes, *_: int) -> int:
        if not scenario.endswith(b".xosc"):
            return -1
        played = play_scenario(Path(scenario.decode()), step=STEP, time_limit=40.0)
        self.network, self.motion = played.network, played.motion
        self.names = [one.name for one in self.motion.entities]
        return 0

    def _lateral(self, name: str, row: int) -> Any:
        time = row * STEP
        for action in self.motion.actions:
            end = np.inf if action.end is None else action.end
            written = (
                action.actor == name
                and isinstance(action.action.content, LATERAL_ACTIONS)
                and "Init" not in action.path
            )
            if written and action.start - 1e-9 <= time < end:
                return action
        return None

    def SE_StepDT(self, dt: float) -> int:
        self.shown.clear()
        steps = round(dt / STEP)
        for _ in range(steps):
            for name in self.names:
                before, after = self._lateral(name, self.row), self._lateral(name, self.row + 1)
                if after is not before:
                    action = after or before
                    path = "::".join(action.path).encode()
                    self.callback(action.path[-1].encode(), 7, 2 if after else 3, path)
                if after is not None and isinstance(after.action.content, FollowTrajectoryAction):
                    self.offset[name] = 0.0  # a trajectory puts it where that begins
                elif after is not None:  # the maneuver takes the car from where it is
                    self.offset[name] = self.offset.get(name, 0.0) * (
                        1.0 - STEP / max(after.end - self.row * STEP, STEP)
                    )
            self.row += 1
        return 0

    def SE_Close(self) -> None:
        self.closed = True

    def SE_GetQuitFlag(self) -> int:
        return int(self.row >= len(self.motion.entities[0].time) - 1)

    def SE_GetSimulationTime(self) -> float:
        return self.row * STEP

    def SE_GetNumberOfObjects(self) -> int:
        return len(self.names)

    def SE_GetId(self, index: int) -> int:
        return 10 + index

    def SE_GetObjectName(self, number: int) -> bytes:
        return self.names[number - 10].encode()

    def SE_GetODRFilename(self) -> bytes:
        return str(self.network.path).encode()

    def SE_GetObjectState(self, number: int, address: int) -> int:
        one = self.motion.entities[number - 10]
        name, row = one.name, self.row
        if name in self.gone or not one.activity[row] & Activity.ACTIVE:
            return -1
        road, lane, s = int(one.road[row]), int(one.lane[row]), float(one.s[row])
        offset = float(one.offset[row]) + self.shown.get(name, self.offset.get(name, 0.0))
        pose = self.network.pose_at(road, lane, s, offset)
        t = float(self.network.offset_to_t(road, lane, s, offset))
        direction = self.network.travel_direction(road, lane)
        box, kind = one.entity.bounding_box, one.entity.vehicle_category.value
        state = ObjectState(
            id=number, ctrl_type=0, x=pose.x, y=pose.y, h=pose.heading, road=int(self.network.road_ids[road]), t=t,
            lane=lane, offset_t=direction * offset, s=s, speed=one.speed[row], center_x=box.center_x, width=box.width,
            length=box.length, height=box.height, type=1, category=2 if kind == "truck" else 0, visibility=7,
        )  # fmt: skip
        for field, value in self.broken.get(name, {}).items():
            setattr(state, field, value)
        ctypes.memmove(address, ctypes.addressof(state), ctypes.sizeof(state))
        return 0

    def SE_ReportObjectLateralPosition(self, number: int, t: float) -> int:
        one, row = self.motion.entities[number - 10], self.row
        road, lane, s = int(one.road[row]), int(one.lane[row]), float(one.s[row])
        # while an action runs, it says anew in every step where the vehicle is
        to = self.offset if self._lateral(one.name, row) is None else self.shown
        offset_t = t - self.network.lane_state_at(road, lane, s).centre_t
        to[one.name] = self.network.offset_from_offset_t(road, lane, offset_t) - float(one.offset[row])
        return 0

    def SE_ReportObjectSpeed(self, number: int, speed: float) -> int:
        del number, speed  # the one that it has
        return 0

    def SE_RegisterStoryBoardElementStateChangeCallback(self, callback: Callable[..., None]) -> None:
        self.callback = callback
