"""Smallest inputs of what `laboratory.find` has found: distances along roads, on rings, over joints, in junctions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from tests.kit.generated import write
from xosc_lateral.workflows.conversion.load import Played, play_scenario

EGO = {"name": "Ego", "class": "car", "way": 0, "k": 0}
RING, CROSSING = {"kind": "roundabout", "radius": 35.0}, {"kind": "crossing", "width": 3.0, "gap": 20.0}
TURNED = {"kind": "opposite", "lanes": 2, "width": 3.5, "length": 300.0}
PLAIN = {"kind": "plain", "lanes": 3, "width": 3.0}
SHORT = {"kind": "crossing", "width": 3.0, "gap": 10.0}


def vehicle(**given: Any) -> dict[str, Any]:
    return {**EGO, "name": "A", "off": 0, **given}


def near(distance: float, kind: str = "longitudinal") -> list[Any]:
    return ["near", "A", "Ego", distance, "lessThan", "true", kind]


@pytest.mark.parametrize(
    ("road", "ego", "other", "waits", "expected", "told"),
    [
        pytest.param(
            RING, {"d": 77.0, "v": 7.7}, {"d": 162.0, "v": 0}, near(31.0), 6.97, "nowhere beside", id="round a ring"
        ),
        pytest.param(TURNED, {"d": 110.7, "v": 30.6}, {"d": 217.8, "v": 30.6}, near(79.0), None, "", id="s turns"),
        pytest.param(CROSSING, {"d": 47.5, "v": 3.8}, {"d": 110.0, "v": 3.8}, near(30.0), None, "", id="junction"),
        pytest.param(
            PLAIN, {"k": 2, "d": 61.5, "v": 34.4}, {"class": "truck", "d": 63.5, "v": 32.9}, ["ttc", "A", "Ego", 10.9],
            None, "beside all of", id="a truck beside all of a car",
        ),
        pytest.param(
            SHORT, {"d": 108.1, "v": 2.3}, {"way": 3, "d": 176.2, "v": 4.8}, ["ttc", "Ego", "A", 3.9],
            None, "no way leads", id="no way",
        ),
    ],
)  # fmt: skip
def test_free_space_along_the_road_is_that_between_two_vehicles(
    tmp_path: Path,
    road: dict[str, Any],
    ego: dict[str, Any],
    other: dict[str, Any],
    waits: list[Any],
    expected: float | None,
    told: str,
) -> None:
    """`expected`: when an event comes that waits for it [s]; `told`: what esmini has otherwise."""
    event = {"name": "e", "of": "A", "do": [["speed", 1.0, "linear", "rate", 2.0]], "when": [[waits]], "edge": "none"}
    spec = {
        "minor": 2, "catalog": False, "parameters": False, "road": road, "end": 10, "egos": [],
        "vehicles": [{**EGO, **ego}, vehicle(**other)], "events": [event],
    }  # fmt: skip
    motion = play_scenario(write.files(spec, tmp_path), step=0.02, time_limit=9.0).motion
    starts = [action.start for action in motion.actions if action.path[-2:-1] == ("e",)]
    assert starts == ([] if expected is None else [pytest.approx(expected, abs=0.1)])
    notes = [note for note in motion.notes if "in esmini" in note.what and "along its road" not in note.what]
    assert [(told in note.what, note.entity) for note in notes] == [(True, waits[1])] * bool(told)


def esmini_along(played: Played, name: str) -> np.ndarray:
    """How far along its way an entity is in esmini, in each row: its curvature of a `paramPoly3` (EvaluateCurvatureDS)
    is that at the parameter ds / length, read from the file anew; the way of a step by 1 / (1 - curvature t). [m]
    """
    motion = next(one for one in played.motion.entities if one.name == name)
    roads = {road.get("id"): road for road in etree.parse(str(played.scenario.road_file)).iterfind(".//road")}
    t = played.network.offset_to_t(motion.road, motion.lane, motion.s, motion.offset)
    ways = [0.0]
    for k in range(len(motion.time) - 1):
        (geometry, *more) = roads[played.network.road_ids[motion.road[k]]].iterfind(".//geometry")
        cubic, exact = geometry.find("paramPoly3"), played.network.curvature_at(int(motion.road[k]), float(motion.s[k]))
        theirs = exact
        if cubic is not None:
            assert not more and cubic.get("pRange") == "normalized"
            p = motion.s[k] / float(geometry.get("length"))
            (_, bu, cu, du), (_, bv, cv, dv) = ([float(cubic.get(f"{name}{axis}")) for name in "abcd"] for axis in "UV")
            first = np.array([bu + 2 * cu * p + 3 * du * p**2, bv + 2 * cv * p + 3 * dv * p**2])
            second = np.array([2 * cu + 6 * du * p, 2 * cv + 6 * dv * p])
            theirs = (first[0] * second[1] - first[1] * second[0]) / np.hypot(*first) ** 3
        step = motion.speed[k + 1] * (motion.time[k + 1] - motion.time[k])
        ways.append(step / (1.0 - theirs * t[k]) - step / (1.0 - exact * t[k]))
    return np.cumsum(ways)


@pytest.mark.parametrize(("radius", "speed", "is_told"), [(35.0, 7.0, True), (12.0, 5.0, True), (None, 20.0, False)])
def test_where_esmini_is_elsewhere_along_parametric_cubics_is_told(
    tmp_path: Path, radius: float | None, speed: float, is_told: bool
) -> None:
    road = PLAIN if radius is None else {"kind": "roundabout", "radius": radius}
    spec = {
        "minor": 2, "catalog": False, "parameters": False, "road": road, "end": 30, "egos": [],
        "vehicles": [{**EGO, "d": 100.0, "v": speed}], "events": [],
    }  # fmt: skip
    played = play_scenario(write.files(spec, tmp_path), step=0.02, time_limit=30.0)
    told = [note for note in played.motion.notes if "elsewhere along its road in esmini" in note.what]
    along = np.abs(esmini_along(played, "Ego"))
    assert bool(told) == (along.max() > 0.05) == is_told
    for note in told:
        far, begin = (float(found) for found in re.findall(r"up to (\S+) m .* from (\S+) s on", note.what)[0])
        first = played.motion.entities[0].time[np.argmax(along > 0.05)]
        assert (note.entity, note.is_warning) == ("Ego", False)
        assert (far, begin) == (pytest.approx(along.max(), abs=0.02), pytest.approx(first, abs=0.3))
