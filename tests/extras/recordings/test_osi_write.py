"""OSI traces, written and read back by ASAM's own readers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.kit.motion import STEP, drive, entity, together, two_roads
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.osi_write import write_osi
from xosc_lateral.world.motion.nominal import Activity, NominalMotion, PlayedAction
from xosc_lateral.world.motion.trajectory import displace
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.private_actions import LightStateAction

osi_utilities = pytest.importorskip("osi_utilities")
pytest.importorskip("osi3")

ROOT = Path(__file__).resolve().parents[3]


def messages(path: Path) -> list[Any]:
    with osi_utilities.open_channel(osi_utilities.ChannelSpecification(path=path)) as channel:
        return list(channel)


@pytest.fixture
def network(tmp_path: Path) -> RoadNetwork:
    return two_roads(tmp_path)


@pytest.fixture
def motion(network: RoadNetwork) -> NominalMotion:
    """Two cars from the straight into the arc of 400 m, one of them against s; the second appears after 1 s."""
    late = np.full(1001, int(Activity.ACTIVE), dtype=np.uint8)
    late[:50] = 0
    late[50] |= Activity.TELEPORTED
    return together(
        drive(network, entity("Ego"), duration=20.0, speed=30.0, start=300.0, lane=-1, offset=1.7),
        drive(network, entity("late"), duration=20.0, speed=25.0, start=20.0, lane=2, activity=late),
    )


@pytest.mark.parametrize("name", ["trace.mcap", "trace_gt.osi"])
def test_what_is_written_is_what_was_played(tmp_path: Path, network, motion, name: str) -> None:
    read = messages(write_osi(tmp_path / name, motion, network, host="Ego"))
    assert len(read) == 1001
    assert [m.timestamp.seconds + 1e-9 * m.timestamp.nanos for m in read] == pytest.approx(motion.entities[0].time)
    assert {m.host_vehicle_id.value for m in read} == {1}
    assert [len(m.moving_object) for m in read] == [1] * 50 + [2] * 951
    for number, one in enumerate(motion.entities, 1):
        box = one.entity.bounding_box
        there = (one.activity & Activity.ACTIVE) != 0
        found = [thing for m in read for thing in m.moving_object if thing.id.value == number]
        x = one.x + box.center_x * np.cos(one.heading) - box.center_y * np.sin(one.heading)
        y = one.y + box.center_x * np.sin(one.heading) + box.center_y * np.cos(one.heading)
        assert [thing.base.position.x for thing in found] == pytest.approx(x[there], abs=1e-9)
        assert [thing.base.position.y for thing in found] == pytest.approx(y[there], abs=1e-9)
        assert found[0].base.dimension.length == box.length
        assert list(found[0].source_reference[0].identifier) == ["Vehicle", one.name]


def test_velocity_acceleration_and_yaw_rate_are_those_of_the_middle_of_the_box(tmp_path, network, motion) -> None:
    read = messages(write_osi(tmp_path / "trace.mcap", motion, network))
    base = [m.moving_object[0].base for m in read]
    velocity = np.array([(b.velocity.x, b.velocity.y) for b in base])
    place = np.array([(b.position.x, b.position.y) for b in base])
    # central differences of positions agree with what is written to (a''' = v^3/R^2 = 0.2 m/s^3) * step^2 / 6;
    # `drive` counts its speed along s, 0.05 m aside: 30 m/s * 0.05 / 400
    assert velocity[1:-1][600:] == pytest.approx(((place[2:] - place[:-2]) / (2 * STEP))[600:], abs=4e-3 + 1e-4)
    curved = base[-100]
    radius = 400.0  # `drive` moves along s
    assert curved.orientation_rate.yaw == pytest.approx(30.0 / radius, rel=1e-6)
    assert np.hypot(curved.acceleration.x, curved.acceleration.y) == pytest.approx(30.0**2 / radius, rel=1e-3)


def test_lanes_stand_in_the_first_message_with_their_lines_and_links(tmp_path, network, motion) -> None:
    first, second, *_ = messages(write_osi(tmp_path / "trace.mcap", motion, network))
    assert not second.lane
    assert not second.lane_boundary
    lanes = {tuple(lane.source_reference[0].identifier): lane for lane in first.lane}
    by_id = {lane.id.value: name for name, lane in lanes.items()}
    assert len({*by_id, *(b.id.value for b in first.lane_boundary), 1, 2}) == 12 + len(first.lane_boundary) + 2
    edges = {boundary.id.value: boundary for boundary in first.lane_boundary}
    for (road, _, name), lane in lanes.items():
        about = lane.classification
        line = np.array([(p.x, p.y) for p in about.centerline])
        t = np.sign(int(name)) * (abs(int(name)) - 0.5) * 3.5
        if road == "b":  # an arc to the left about (500, 400)
            assert np.hypot(line[:, 0] - 500.0, line[:, 1] - 400.0) == pytest.approx(400.0 - t, abs=1e-6)
        else:
            assert line[:, 1] == pytest.approx(t, abs=1e-9)
            assert (line[-1, 0] > line[0, 0]) == (int(name) < 0)
        pairs = [pair for pair in about.lane_pairing if pair.HasField("successor_lane_id")]
        onward = {by_id[pair.successor_lane_id.value] for pair in pairs}
        goes_on = (road == "a") == (int(name) < 0)
        assert onward == ({("b" if road == "a" else "a", "0", name)} if goes_on else set())
        step = 1 if int(name) < 0 else -1
        left = [by_id[one.value] for one in about.left_adjacent_lane_id]
        beside = int(name) + step or 2 * step + int(name)
        assert left == [(road, "0", str(beside))]
        for ids, outwards in ((about.left_lane_boundary_id, 1.75), (about.right_lane_boundary_id, -1.75)):
            point = edges[ids[0].value].boundary_line[0].position
            across = np.array([point.x, point.y]) - _nearest(line, point)
            way = line[1] - line[0]
            if road == "a":
                assert (way[0] * across[1]) / abs(way[0]) == pytest.approx(outwards, abs=1e-6)


def _nearest(line: np.ndarray, point: Any) -> np.ndarray:
    return line[np.argmin(np.hypot(line[:, 0] - point.x, line[:, 1] - point.y))]


def test_every_object_names_the_lane_that_it_is_in(tmp_path, network, motion) -> None:
    """On its nominal path, and where a deviation has taken it into the lane beside."""
    deviation = np.where(motion.entities[0].time > 5.0, -3.5, 0.0)
    paths = [displace(one, network, deviation if k == 0 else 0.0 * deviation) for k, one in enumerate(motion.entities)]
    read = messages(write_osi(tmp_path / "trace.mcap", motion, network, paths))
    lanes = {lane.id.value: tuple(lane.source_reference[0].identifier) for lane in read[0].lane}
    found = [lanes[m.moving_object[0].assigned_lane_id[0].value] for m in read]
    expected = [
        ("a" if road == 0 else "b", "0", "-2" if aside else "-1")
        for road, aside in zip(motion.entities[0].road, deviation, strict=True)
    ]
    assert found == expected


def test_same_motion_same_bytes_and_other_files_stay(tmp_path, network, motion) -> None:
    one, two = (write_osi(tmp_path / f"{k}.mcap", motion, network).read_bytes() for k in (1, 2))
    assert one == two


def test_play_and_convert_write_traces(tmp_path: Path, capsys) -> None:
    scenario = str(ROOT / "templates" / "cut-in.xosc")
    trace = tmp_path / "cut-in.mcap"
    assert main(["states", scenario, "--osi", str(trace), "--time-limit", "5"]) == 0
    assert len(messages(trace)) == 251
    assert main(["states", scenario, "--osi", str(trace), "--time-limit", "5"]) == 0  # its own file
    trace.write_bytes(b"somebody else's")
    assert main(["states", scenario, "--osi", str(trace), "--time-limit", "5"]) == 1
    assert main(["states", scenario, "--osi", str(tmp_path / "trace.txt")]) == 1
    assert "expected a name ending in .mcap or .osi" in capsys.readouterr().err
    out = tmp_path / "out.xosc"
    made = [
        "convert",
        scenario,
        "-o",
        str(out),
        "--report",
        str(tmp_path / "both.mcap"),
        "--quiet",
        "--time-limit",
        "20",
    ]
    assert main([*made, "--ego", "none"]) == 0
    enriched, nominal = messages(tmp_path / "both.mcap"), messages(tmp_path / "both_nominal.mcap")
    assert len(enriched) == len(nominal)
    y = [[m.moving_object[0].base.position.y for m in trace] for trace in (enriched, nominal)]
    assert 0.05 < np.abs(np.subtract(*y)).max() < 2.0


def test_a_missing_extra_is_named(tmp_path, network, motion, monkeypatch, capsys) -> None:
    monkeypatch.setitem(__import__("sys").modules, "osi_utilities", None)
    scenario = str(ROOT / "templates" / "cut-in.xosc")
    assert main(["states", scenario, "--osi", str(tmp_path / "trace.mcap")]) == 1
    assert "pip install 'xosc-lateral[osi]'" in capsys.readouterr().err
    assert not (tmp_path / "trace.mcap").exists()


def test_lights_are_on_from_when_the_scenario_switches_them_until_it_does_again(tmp_path, network, motion) -> None:
    def switch(light: str, mode: str, start: float, actor: str = "Ego") -> PlayedAction:
        action = LightStateAction(light, mode, place=Place("a.xosc", 1, "LightStateAction"))
        return PlayedAction(action, actor, ("story",), start, start)

    switched = (
        switch("indicatorLeft", "flashing", 2.0),
        switch("brakeLights", "on", 1.0, "late"),
        switch("fogLights", "on", 3.0),
        switch("indicatorLeft", "off", 5.0),
        switch("daytimeRunningLights", "on", 6.0),
    )
    read = messages(write_osi(tmp_path / "trace.mcap", replace(motion, actions=switched), network))
    state = [message.moving_object[0].vehicle_classification for message in read]
    of = type(state[0].light_state)
    assert not state[99].HasField("light_state")
    indicator = np.array([one.light_state.indicator_state for one in state])
    assert set(indicator[100:250]) == {of.INDICATOR_STATE_LEFT} and set(indicator[250:]) == {of.INDICATOR_STATE_OFF}
    assert state[-1].light_state.front_fog_light == state[-1].light_state.rear_fog_light == of.GENERIC_LIGHT_STATE_ON
    assert state[-1].light_state.brake_light_state == of.BRAKE_LIGHT_STATE_UNKNOWN
    other = [message.moving_object[1].vehicle_classification.light_state for message in read[50:]]
    assert {one.brake_light_state for one in other} == {of.BRAKE_LIGHT_STATE_NORMAL}
