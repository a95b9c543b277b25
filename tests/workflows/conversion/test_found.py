"""Smallest inputs of what `laboratory.find` has found in outputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.generated import write
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.gaps import box_distance, corners

EGO = {"name": "Ego", "class": "car", "way": 0, "k": 0}
ROUND = {"kind": "roundabout", "radius": 12.0}
NARROW = {"kind": "plain", "lanes": 2, "width": 3.0, "radius": 120, "left": True}


def scenario(folder: Path, road: dict[str, Any], end: float, vehicles: list[Any], events: list[Any]) -> Path:
    spec = {"minor": 2, "catalog": False, "parameters": False, "road": road, "end": end, "egos": []}
    return write.files({**spec, "vehicles": vehicles, "events": events}, folder)


def test_who_would_end_his_synchronisation_on_a_path_stays_as_written(tmp_path: Path) -> None:
    """Along a path that ends before its place the vehicle is there at once: it was 46 m elsewhere, which was told."""
    path = scenario(
        tmp_path, ROUND, 16,
        [
            {**EGO, "d": 97.7, "v": 3.9},
            {**EGO, "name": "A", "class": "truck", "d": 46.5, "v": 3.7},
            {**EGO, "name": "B", "d": 181.2, "v": 0},
        ],
        [
            {"name": "e0", "of": "A", "do": [["offset", -0.4, 0.2, "false", "sinusoidal"]], "edge": "none",
             "when": [[["near", "A", "Ego", 118.0, "lessThan", "true", "euclidianDistance"]]]},
            {"name": "e3", "of": "B", "do": [["synchronise", "Ego", [0, 0, 254.8], [0, 0, 269.3], 3.8]],
             "when": [[["time", 0.0]]], "edge": "none"},
        ],
    )  # fmt: skip
    made = xl.convert(path, tmp_path / "out.xosc", ego=["Ego"], mode="auto", seed=52)
    source, other = (
        {one.name: one for one in play_scenario(each, step=0.02).motion.entities}
        for each in (path, tmp_path / "out.xosc")
    )
    for name in "xy":
        np.testing.assert_allclose(other["B"].columns[name], source["B"].columns[name], atol=1e-6)
    told = [note.what for note in made.messages if note.entity == "B" and "stays as it is" in note.what]
    assert told and "elsewhere along the road" in told[0]


def test_a_contact_of_vehicles_on_trajectories_that_comes_earlier_is_told(tmp_path: Path) -> None:
    """Two buses 2.5 m wide in lanes 3 m wide: beside the middle they touch as they pass, not when one comes across."""
    path = scenario(
        tmp_path, NARROW, 10,
        [
            {**EGO, "d": 53.6, "v": 18.5},
            {**EGO, "name": "A", "class": "bus", "d": 179.3, "v": 0, "off": 0},
            {**EGO, "name": "B", "class": "bus", "k": 1, "d": 165.9, "v": 8.7, "off": 0},
        ],
        [{"name": "e1", "of": "A", "do": [["trajectory", [[0, 0, 1, 239.3], [4.0, 0, 0, 251.3], [8.6, 0, 1, 265.1]]]],
          "when": [[["reach", "Ego", 0, 0, 145.0, 5.0]]], "edge": "none"}],
    )  # fmt: skip
    made = xl.convert(path, tmp_path / "out.xosc", ego=["Ego"], mode="trajectory", seed=0)
    first = []
    for each in (path, tmp_path / "out.xosc"):
        a, b = (one for one in play_scenario(each, step=0.02).motion.entities if one.name != "Ego")
        rows = np.arange(len(a.time))
        first.append(float(a.time[np.argmax(box_distance(corners([(a, rows)]), corners([(b, rows)])) <= 0.0)]))
    assert first[1] < first[0] - 5.0
    (told,) = (note.what for note in made.messages if "touch at" in note.what)
    now, then = (float(word) for word in told.split() if word.replace(".", "").isdigit())
    assert (now, then) == (pytest.approx(first[1], abs=0.11), pytest.approx(first[0], abs=0.11))
