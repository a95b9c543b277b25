"""The MCAP recording: read back by the library, boxes where the motion is."""

from __future__ import annotations

import json
from io import BytesIO

import numpy as np
import pytest

from tests.motion.made_motion import drive, entity, together, two_roads
from xosc_lateral.motion.nominal import Activity
from xosc_lateral.report.recording import SCHEMA, _quaternion, _rotation, scene_recording

reader = pytest.importorskip("mcap.reader", reason="mcap is not installed (extra mcap)")


@pytest.fixture(scope="module")
def motion_and_network(tmp_path_factory):
    network = two_roads(tmp_path_factory.mktemp("road"))
    activity = np.full(501, int(Activity.ACTIVE), dtype=np.uint8)
    activity[:100] = activity[400:] = 0
    cars = drive(network, entity("Ego"), lane=-2), drive(network, entity("Late"), lane=-3, activity=activity)
    return together(*cars), network


def messages(data: bytes) -> list:
    return list(reader.make_reader(BytesIO(data)).iter_messages())


def test_boxes_are_where_the_vehicles_are(motion_and_network):
    motion, network = motion_and_network
    read = messages(scene_recording(motion, network))
    assert len(read) == 101
    schema, channel, message = read[37]
    assert (schema.name, schema.encoding, channel.topic) == ("foxglove.SceneUpdate", "jsonschema", "/scene")
    assert message.log_time == 3_700_000_000
    ego = json.loads(message.data)["entities"][0]
    row = round(3.7 / 0.02)
    place = ego["cubes"][0]["pose"]["position"]
    assert ego["id"] == "Ego"
    assert place["x"] == pytest.approx(motion.entities[0].x[row] + 1.4, abs=1e-3)  # the box's centre is 1.4 m ahead
    assert place["y"] == pytest.approx(motion.entities[0].y[row], abs=1e-3)
    assert ego["cubes"][0]["size"] == {"x": 5.0, "y": 2.0, "z": 1.5}


def test_a_vehicle_comes_when_it_is_there_and_is_deleted_when_it_leaves(motion_and_network):
    data = [json.loads(message.data) for _, _, message in messages(scene_recording(*motion_and_network))]
    present = [any(one["id"] == "Late" for one in update["entities"]) for update in data]
    assert (present.index(True), sum(present)) == (20, 60)
    deleted = [k for k, update in enumerate(data) if update["deletions"]]
    assert deleted == [80]
    assert data[80]["deletions"][0]["id"] == "Late"


def test_the_road_is_sent_once_and_messages_keep_to_the_schema(motion_and_network):
    from jsonschema import validate

    data = [json.loads(message.data) for _, _, message in messages(scene_recording(*motion_and_network))]
    assert [any(one["id"] == "road" for one in update["entities"]) for update in data] == [True] + [False] * 100
    validate(data[0], SCHEMA)


def test_the_same_motion_gives_the_same_bytes(motion_and_network):
    assert scene_recording(*motion_and_network) == scene_recording(*motion_and_network)


@pytest.mark.parametrize("angles", [(0.3, -0.2, 0.1), (2.8, 0.4, -0.7), (-1.0, 0.0, 3.0)])
def test_the_quaternion_turns_like_the_matrix(angles):
    q = _quaternion(*angles)
    w, v = q["w"], np.array([q["x"], q["y"], q["z"]])
    point = np.array([1.0, 2.0, -0.5])
    turned = point + 2.0 * w * np.cross(v, point) + 2.0 * np.cross(v, np.cross(v, point))
    np.testing.assert_allclose(turned, _rotation(*angles) @ point, atol=1e-5)
