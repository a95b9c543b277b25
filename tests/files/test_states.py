"""The state table."""

from __future__ import annotations

import csv
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tests.kit.stage import Stage, after, event, lane_change, maneuvers, on_lane, speed, teleport, to_lane
from xosc_lateral.files.output_tables import COLUMNS, states_csv, states_frame
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.piecewise import HeaderOffset


def table(motion: NominalMotion, network: RoadNetwork) -> list[dict[str, str]]:
    return list(csv.DictReader(states_csv(motion, network).splitlines()))


def test_one_row_per_entity_and_step_in_order_of_time(tmp_path: Path) -> None:
    start = {
        "Ego": teleport(on_lane(-1, 10.0)) + speed(20.0),
        "Other": teleport(on_lane(1, 500.0, offset=0.5)) + speed(10.0),
    }
    played = Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0))), start=start, last=2.0)
    rows = table(played.motion, played.network)
    assert ",".join(rows[0]) == ",".join(COLUMNS) == "time,name,x,y,z,h,speed,road,lane,offset_t,s"
    assert [row["name"] for row in rows[:4]] == ["Ego", "Other", "Ego", "Other"]
    assert len(rows) == 2 * 101
    ego, other = played.motion.entities
    for column, values in (("x", ego.x), ("y", ego.y), ("s", ego.s), ("speed", ego.speed), ("time", ego.time)):
        np.testing.assert_allclose([float(row[column]) for row in rows[::2]], values, atol=5.1e-4)
    assert {row["road"] for row in rows} == {"1"}
    assert float(rows[1]["offset_t"]) == pytest.approx(0.5)
    assert other.offset[0] == pytest.approx(-0.5)


def test_entities_that_are_not_there_have_no_row(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(last=0.1)
    ego = played.motion.entities[0]
    activity = ego.activity.copy()
    activity[:3] &= ~np.uint8(Activity.ACTIVE)
    motion = replace(played.motion, entities=(ego.having(activity=activity),))
    assert [row["time"] for row in table(motion, played.network)] == ["0.060", "0.080", "0.100"]


def test_names_with_commas_and_quotes_come_back(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(last=0.1)
    ego = played.motion.entities[0]
    odd = EntityMotion.of(structs.replace(ego.entity, name='a "b", c'), ego.time, **ego.columns)
    assert table(replace(played.motion, entities=(odd,)), played.network)[0]["name"] == 'a "b", c'


def test_without_a_road_the_field_is_empty(tmp_path: Path) -> None:
    played = Stage(tmp_path, None).play(start={"Ego": teleport('<WorldPosition x="1" y="2"/>')}, last=0.1)
    row = table(played.motion, played.network)[0]
    assert (row["road"], row["x"], row["y"]) == ("", "1.0000", "2.0000")


def test_the_frame_holds_the_rows_of_the_csv(tmp_path: Path) -> None:
    start = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0), "Other": teleport(on_lane(1, 500.0)) + speed(10.0)}
    played = Stage(tmp_path).play(start=start, last=1.0)
    rows = table(played.motion, played.network)
    frame = states_frame(played.motion, played.network)
    assert list(frame.columns) == list(COLUMNS)
    assert frame["name"].tolist() == [row["name"] for row in rows]
    assert frame["road"].tolist() == [row["road"] for row in rows]
    for column in ("time", "x", "h", "lane", "offset_t", "s"):
        np.testing.assert_allclose(frame[column], [float(row[column]) for row in rows], atol=6e-4)


def test_the_frame_is_inertial_as_the_csv_is(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(start={"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0)}, last=0.2)
    moved = copy(played.network)
    moved.header_offset = HeaderOffset(1000.0, -500.0, 20.0, 0.3)
    rows, frame = table(played.motion, moved), states_frame(played.motion, moved)
    for column in ("x", "y", "z", "h"):
        np.testing.assert_allclose(frame[column], [float(row[column]) for row in rows], atol=6e-4)
