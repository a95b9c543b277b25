"""One run: in the reference player's library, in a process of its own, or played here; both as the same data."""

from __future__ import annotations

import ctypes
import math
import os
import pickle
import tempfile
import traceback
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.gaps import gaps_of

STEP = 0.01
"""Of either player. [s]"""
RUNNING, DONE, EVENT = 2, 3, 6
"""States of an element, and its kind, as the reference player numbers them."""


class State(ctypes.Structure):
    """`SE_ScenarioObjectState`."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("id", "model", "control")),
        *((name, ctypes.c_double) for name in ("stamp", "x", "y", "z", "h", "p", "r")),
        ("road", ctypes.c_uint32),
        ("junction", ctypes.c_uint32),
        ("t", ctypes.c_double),
        ("lane", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("offset", "s", "speed")),
        ("rest", ctypes.c_double * 24),
    )


def apart(function, *args, limit=60.0):
    """Call in a forked process; what it returns, or {"error": ...}."""
    with tempfile.NamedTemporaryFile() as file:

        def child():
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 1)
            os.dup2(null, 2)
            os.chdir(tempfile.gettempdir())
            try:
                found = function(*args)
            except BaseException as error:
                found = {"error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc()[-600:]}
            Path(file.name).write_bytes(pickle.dumps(found))

        process = get_context("fork").Process(target=child)
        process.start()
        process.join(limit)
        if process.is_alive():
            process.kill()
            process.join()
            return {"error": "time limit"}
        data = Path(file.name).read_bytes()
        return pickle.loads(data) if data else {"error": f"died with {process.exitcode}"}


def ego_driver(kind, first, seed):
    """Speed and place beside its way, step by step."""
    when = np.random.default_rng(seed).uniform(3, 9)
    at = {"halted": None}

    def step(t, v):
        if kind == "never":
            return 0.0, 0.0
        if kind == "changes":
            return v, 3.5 * (0.5 - 0.5 * math.cos(math.pi * min(max((t - when) / 4, 0), 1)))
        if kind in ("stops", "stays"):
            if t < when:
                return v, 0.0
            if at["halted"] is None:
                v = max(0.0, v - 4 * STEP)
                at["halted"] = t if v == 0 else None
                return v, 0.0
            return (min(first, v + 2.5 * STEP) if kind == "stops" and t > at["halted"] + 3 else v), 0.0
        return v + max(-3 * STEP, min(3 * STEP, float(kind) * first - v)) if t > 1 else v, 0.0

    return step


def run(library, scenario, seconds, ego=None, path=None, seed=0):
    """Rows by entity, changes of state of events, contacts. Without an ego: controllers are off, the nominal run."""
    se = ctypes.CDLL(library)
    se.SE_StepDT.argtypes = [ctypes.c_double]
    se.SE_ReportObjectPosXYH.argtypes = [ctypes.c_int] + [ctypes.c_double] * 3
    se.SE_ReportObjectSpeed.argtypes = [ctypes.c_int, ctypes.c_double]
    se.SE_GetObjectName.restype, se.SE_GetSimulationTime.restype = ctypes.c_char_p, ctypes.c_double
    se.SE_SetLogFilePath.argtypes = [ctypes.c_char_p]
    se.SE_SetLogFilePath(os.devnull.encode())
    se.SE_SetSeed(1)
    se.SE_CollisionDetection(ctypes.c_bool(True))
    states = []
    call = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_int, ctypes.c_int, ctypes.c_char_p)(
        lambda name, kind, state, path: states.append((name.decode(), kind, state, round(se.SE_GetSimulationTime(), 3)))
    )
    se.SE_RegisterStoryBoardElementStateChangeCallback(call)
    if se.SE_Init(str(scenario).encode(), 1 if ego is None else 0, 0, 0, 0) != 0:
        return {"error": "refused by the reference player"}
    one, names, rows, contacts = State(), {}, {}, {}

    def note(t):
        for i in (se.SE_GetId(j) for j in range(se.SE_GetNumberOfObjects())):
            if i not in names:
                names[i] = se.SE_GetObjectName(i).decode()
            se.SE_GetObjectState(i, ctypes.byref(one))
            rows.setdefault(names[i], []).append(
                (t, one.x, one.y, one.h, one.speed, one.road, one.lane, one.offset, one.s)
            )
            for j in range(se.SE_GetObjectNumberOfCollisions(i)):
                contacts.setdefault(tuple(sorted((names[i], names.get(se.SE_GetObjectCollision(i, j), "?")))), t)

    note(0.0)
    me = next((i for i, name in names.items() if name == "Ego"), None)
    drives, v, way = (ego_driver(ego, path["v"], seed), path["v"], 0.0) if ego else (None, 0, 0)
    for k in range(1, round(seconds / STEP) + 1):
        if ego and me is not None:
            v, aside = drives(k * STEP, v)
            way = min(way + v * STEP, path["way"][-1])
            v = 0.0 if way >= path["way"][-1] else v
            x, y, h = (np.interp(way, path["way"], path[c]) for c in "xyh")
            se.SE_ReportObjectPosXYH(me, x - aside * math.sin(h), y + aside * math.cos(h), h)
            se.SE_ReportObjectSpeed(me, v)
        se.SE_StepDT(STEP)
        if se.SE_GetQuitFlag() == 1:
            break
        note(round(se.SE_GetSimulationTime(), 4))
    return {
        "rows": {name: np.array(r) for name, r in rows.items()},
        "states": states,
        "contacts": contacts,
        "end": k * STEP,
    }


def here(scenario, seconds):
    """The same of our own player."""
    played = play_scenario(Path(scenario), step=STEP, time_limit=seconds)
    motion, states = played.motion, []
    for one in motion.actions:
        if len(one.path) > 2:
            states += [(one.path[-2], EVENT, RUNNING, one.start)]
            states += [] if one.end is None else [(one.path[-2], EVENT, DONE, one.end)]
    columns = ("time", "x", "y", "heading", "speed", "road", "lane", "offset", "s")
    rows = {one.name: np.stack([getattr(one, name) for name in columns], axis=1) for one in motion.entities}
    touching = {tuple(sorted(gap.names)): gap.time for gap in gaps_of(motion, motion.entities) if gap.touches}
    return {
        "rows": rows,
        "states": sorted(states, key=lambda one: one[3]),
        "contacts": touching,
        "end": motion.end_time,
        "messages": [(one.entity, str(one)) for one in motion.messages],
    }


def ego_path(played, v):
    """Where Ego drives, from a run of it alone."""
    rows = played["rows"]["Ego"]
    step = np.hypot(np.diff(rows[:, 1]), np.diff(rows[:, 2]))
    keep = np.r_[True, step > 1e-4]
    rows = rows[keep]
    way = np.r_[0, np.cumsum(np.hypot(np.diff(rows[:, 1]), np.diff(rows[:, 2])))]
    return {"way": way, "x": rows[:, 1], "y": rows[:, 2], "h": np.unwrap(rows[:, 3]), "v": v}
