"""The library of esmini, as its user has it (``libesminiLib.so``, ``esminiLib.dll``), by ctypes."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.errors import SimulationError


class ObjectState(c.Structure):
    """``SE_ScenarioObjectState``, as esmini 3 has it."""

    _fields_: ClassVar[list[Any]] = (
        [("id", c.c_int), ("model_id", c.c_int), ("ctrl_type", c.c_int)]
        + [(name, c.c_double) for name in ("timestamp", "x", "y", "z", "h", "p", "r")]
        + [("road", c.c_uint32), ("junction", c.c_uint32), ("t", c.c_double), ("lane", c.c_int)]
        + [(name, c.c_double) for name in ("offset_t", "s", "speed", "center_x", "center_y", "center_z")]
        + [(name, c.c_double) for name in ("width", "length", "height")]
        + [("type", c.c_int), ("category", c.c_int), ("wheel_angle", c.c_double), ("wheel_rot", c.c_double)]
        + [("visibility", c.c_int)]
    )


OBJECT_STATE = np.dtype(ObjectState)
"""The same as a row of an array."""

StoryboardCallback = c.CFUNCTYPE(None, c.c_char_p, c.c_int, c.c_int, c.c_char_p)

FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "SE_Init": (c.c_int, c.c_char_p, c.c_int, c.c_int, c.c_int, c.c_int),
    "SE_StepDT": (c.c_int, c.c_double),
    "SE_Close": (None,),
    "SE_GetQuitFlag": (c.c_int,),
    "SE_GetSimulationTime": (c.c_double,),
    "SE_GetNumberOfObjects": (c.c_int,),
    "SE_GetId": (c.c_int, c.c_int),
    "SE_GetObjectName": (c.c_char_p, c.c_int),
    "SE_GetObjectState": (c.c_int, c.c_int, c.c_void_p),
    "SE_GetODRFilename": (c.c_char_p,),
    "SE_ReportObjectLateralPosition": (c.c_int, c.c_int, c.c_double),
    "SE_ReportObjectSpeed": (c.c_int, c.c_int, c.c_double),
    "SE_RegisterStoryBoardElementStateChangeCallback": (None, StoryboardCallback),
}
"""What is called: type of the answer, types of the arguments."""

OPTIONAL: dict[str, tuple[Any, ...]] = {
    "SE_SetLogFilePath": (None, c.c_char_p),
    "SE_LogToConsole": (None, c.c_bool),
    "SE_ReportObjectPosXYH": (c.c_int, c.c_int, c.c_double, c.c_double, c.c_double),
}
"""What is called where it is there."""


class EsminiLibrary:
    """An esmini library, its functions by name; the types that a user has declared on them stay as they are."""

    def __init__(self, library: Any) -> None:
        self.where = str(library) if isinstance(library, str | Path) else "the given library"
        if isinstance(library, str | Path):
            try:
                library = c.CDLL(str(library))
            except OSError as error:
                raise SimulationError(f"{self.where}: no library that can be loaded ({error})") from error
        for name, (result, *arguments) in (FUNCTIONS | OPTIONAL).items():
            if not hasattr(library, name):
                if name in OPTIONAL:
                    continue
                raise SimulationError(f"{self.where}: has no function {name}; the library of esmini 3 is needed")
            typed = c.CFUNCTYPE(result, *arguments)((name, library)) if isinstance(library, c.CDLL) else None
            setattr(self, name, typed or getattr(library, name))
        self._is_known = False
        self._asked: tuple[list[int], list[int]] = ([], [])
        self._names: tuple[str, ...] = ()
        self._states = np.zeros(0, dtype=OBJECT_STATE)
        self.heard: list[tuple[bytes, int, int, bytes]] = []
        """Changes of storyboard elements while `open_player` opened a scenario."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Callable[..., Any]: ...

    def listen(self) -> None:
        """Note in `heard` what changes from now on: actions that begin at 0 s do so while a scenario is opened."""
        self._hears = StoryboardCallback(lambda *element: self.heard.append(element))
        self.SE_RegisterStoryBoardElementStateChangeCallback(self._hears)

    def state(self, number: int) -> ObjectState | None:
        """Of an object; None if there is none. Raises `SimulationError`: the library has another structure."""
        state = ObjectState()
        self._compare(number)
        return state if self.SE_GetObjectState(number, c.addressof(state)) == 0 else None

    def objects(self) -> tuple[tuple[str, ...], NDArray[Any]]:
        """Names and states (`OBJECT_STATE`) of all objects that have one, shape (n,). Raises as `state`."""
        if len(self._names) == self.SE_GetNumberOfObjects() and not any(map(self.SE_GetObjectState, *self._asked)):
            return self._names, self._states.copy()  # the same as before: who has gone has no state
        ids = [self.SE_GetId(index) for index in range(self.SE_GetNumberOfObjects())]
        for number in ids:
            self._compare(number)
        states = np.zeros(len(ids), dtype=OBJECT_STATE)
        places = [states.ctypes.data + row * OBJECT_STATE.itemsize for row in range(len(ids))]
        there = [row for row, both in enumerate(zip(ids, places, strict=True)) if self.SE_GetObjectState(*both) == 0]
        self._names = tuple([(self.SE_GetObjectName(ids[row]) or b"").decode() for row in there])
        self._states, self._asked = states, (ids, places)
        return self._names, states[there]

    def _compare(self, number: int) -> None:
        """Refuse, at the first object, another structure than ours: longer, shorter, or with something else first."""
        size, spare = c.sizeof(ObjectState), 256
        buffer = (c.c_ubyte * (size + spare)).from_buffer(bytearray([_UNTOUCHED_BYTE] * (size + spare)))
        if self._is_known or self.SE_GetObjectState(number, c.addressof(buffer)) != 0:
            return
        end = ObjectState.visibility
        last, beyond = bytes(buffer[end.offset : end.offset + end.size]), bytes(buffer[size:])
        if (
            last.count(_UNTOUCHED_BYTE) == len(last)
            or beyond.count(_UNTOUCHED_BYTE) < spare
            or buffer[0] != number & 0xFF
        ):
            raise SimulationError(
                f"{self.where}: another SE_ScenarioObjectState than the {size} bytes of esmini 3; a library of that "
                "version is needed"
            )
        self._is_known = True


_UNTOUCHED_BYTE = 0xA5
"""A byte that nobody writes by chance at every place."""


def open_player(library: Any, scenario: str | Path, *, window: bool = False) -> EsminiLibrary:
    """A library that has opened a scenario; quiet, without a log file. Raises `SimulationError`: it can't."""
    player = EsminiLibrary(library)
    if hasattr(player, "SE_SetLogFilePath"):
        player.SE_SetLogFilePath(b"")
    if hasattr(player, "SE_LogToConsole"):
        player.SE_LogToConsole(False)
    player.listen()
    if player.SE_Init(str(scenario).encode(), 0, int(window), 0, 0) != 0:
        raise SimulationError(f"{scenario}: {player.where} can't open it")
    return player
