"""Smallest inputs of what `laboratory.find` has found: distances along roads, on rings, over joints, in junctions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.kit.generated import write
from xosc_lateral.workflows.conversion.load import play_scenario

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
    notes = [note for note in motion.notes if "in esmini" in note.what]
    assert [(told in note.what, note.entity) for note in notes] == [(True, waits[1])] * bool(told)
