"""Roads made from a recording's own lanes: where the lanes are, how they hang together, and what is driven on them."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.extras.recordings.road_file import DrivenLane, roads_of_lanes
from xosc_lateral.files.opendrive.reader import parse_opendrive

WIDTH, RADIUS = 3.2, 60.0
STRAIGHT, BEND = 100.0, 70.0
"""A road's length before its bend to the left, and that of the bend, at the reference line. [m]"""


def at(s: np.ndarray, t: float | np.ndarray) -> np.ndarray:
    """Place `t` to the left of a line that is straight and then bends; shape (n, 2). [m]"""
    turn = np.maximum(s - STRAIGHT, 0.0) / RADIUS
    x = np.where(s < STRAIGHT, s, STRAIGHT + (RADIUS - t) * np.sin(turn))
    return np.stack([x, np.where(s < STRAIGHT, t, RADIUS - (RADIUS - t) * np.cos(turn))], axis=1)


def edge(t: float, start: float = 0.0, end: float = STRAIGHT + BEND) -> np.ndarray:
    return at(np.unique(np.r_[np.linspace(start, end, 200), np.clip(STRAIGHT, start, end)]), t)


def straight_on(lane: DrivenLane, length: float) -> DrivenLane:
    """A lane that goes on from the end of another one."""
    ends = []
    for line in (lane.left, lane.right):
        way = (line[-1] - line[-2]) / np.hypot(*(line[-1] - line[-2]))
        ends.append(np.array([line[-1], line[-1] + length * way]))
    return DrivenLane(*ends, -1, [])


@pytest.mark.parametrize("left_handed", [False, True])
def test_lanes_lie_where_they_lay_and_part_as_they_parted(left_handed):
    """Two lanes round a bend; the right one goes on by itself, the left one likewise."""
    right = DrivenLane(edge(0.0), edge(-WIDTH), 1, [2])
    left = DrivenLane(edge(WIDTH), edge(0.0), -1, [3])
    text = roads_of_lanes(
        [right, left, straight_on(right, 40.0), straight_on(left, 30.0)], "x", left_handed=left_handed
    )
    network = parse_opendrive(text.encode(), "x")
    assert network.notes == ()
    road = network.roads[0]
    ids = (1, 2) if left_handed else (-2, -1)  # of the right and the left lane
    assert (road.rule, tuple(sorted(road.directions))) == ("LHT" if left_handed else "RHT", tuple(sorted(ids)))
    for lane, t in zip(ids, (-0.5 * WIDTH, 0.5 * WIDTH), strict=True):
        assert network.travel_direction(0, lane) == 1
        for share in np.linspace(0.0, 1.0, 18):
            pose = network.pose_at(0, lane, share * road.length)
            turn = max(np.arctan2(pose.x - STRAIGHT, RADIUS - pose.y), 0.0)
            lies = RADIUS - np.hypot(pose.x - STRAIGHT, pose.y - RADIUS) if pose.x > STRAIGHT else pose.y
            assert lies == pytest.approx(t, abs=0.01)
            assert pose.heading == pytest.approx(turn if pose.x > STRAIGHT else 0.0, abs=0.02)
            assert network.lane_state_at(0, lane, share * road.length).width == pytest.approx(WIDTH, abs=0.01)
        (link,) = network.next_lanes(0, lane, 1)
        assert network.roads[link.road].length == pytest.approx(40.0 if t < 0.0 else 30.0, abs=1e-3)
        here, there = network.pose_at(0, lane, road.length), network.pose_at(link.road, link.lane, 0.0)
        assert (there.x, there.y) == pytest.approx((here.x, here.y), abs=0.02)


def test_a_lane_that_ends_before_its_neighbour_has_no_width_from_there_on():
    lanes = [
        DrivenLane(edge(0.0), edge(-WIDTH), 1, []),
        DrivenLane(edge(WIDTH, 0.0, 60.0), edge(0.0, 0.0, 60.0), -1, []),
    ]
    network = parse_opendrive(roads_of_lanes(lanes, "x").encode(), "x")
    assert network.lane_state_at(0, -1, 50.0)[::2] == pytest.approx((0.5 * WIDTH, WIDTH), abs=1e-3)
    for s in (70.0, 99.0):
        assert network.lane_state_at(0, -1, s).width == pytest.approx(0.0, abs=1e-3)
        assert network.lane_state_at(0, -2, s)[::2] == pytest.approx((-0.5 * WIDTH, WIDTH), abs=2e-3)


def test_a_road_lies_along_the_straightest_of_its_lanes():
    """Lanes in junctions are drawn with bends of a few metres, on which lengths beside the line say nothing."""
    bent = np.array([[0.0, 0.0], [1.0, 0.3], [2.0, -0.3], [4.0, 0.0]])
    lanes = [
        DrivenLane(bent, bent - [0.0, WIDTH], 1, []),
        DrivenLane(np.array([[0.0, WIDTH], [4.0, WIDTH]]), np.array([[0.0, 0.0], [4.0, 0.0]]), -1, []),
    ]
    network = parse_opendrive(roads_of_lanes(lanes, "x").encode(), "x")
    assert network.roads[0].length == pytest.approx(4.0)
    assert max(abs(network.curvature_at(0, s)) for s in (0.0, 1.0, 2.0, 3.0)) == 0.0


def test_roads_that_meet_lead_on_into_one():
    one, other = (
        DrivenLane(np.array([[0.0, y], [50.0, 1.6]]), np.array([[0.0, y - 3.2], [50.0, -1.6]]), -1, [2])
        for y in (30.0, -20.0)
    )
    onward = DrivenLane(np.array([[50.0, 1.6], [90.0, 1.6]]), np.array([[50.0, -1.6], [90.0, -1.6]]), -1, [])
    network = parse_opendrive(roads_of_lanes([one, other, onward], "x").encode(), "x")
    for road in (0, 1):
        assert [(link.road, link.lane, link.direction) for link in network.next_lanes(road, -1, 1)] == [(2, -1, 1)]


def test_a_lane_change_waits_for_the_lane_that_it_leads_to(tmp_path):
    """A lane is added on the left at 100 m; the car is there at 5 s, but began to move over half a second before."""
    time = np.arange(0.0, 15.0, 0.1)
    u = np.clip((time - 4.5) / 4.0, 0.0, 1.0)
    y = -0.5 * WIDTH + WIDTH * 0.5 * (1.0 - np.cos(np.pi * u))
    pd.DataFrame({"id": "a", "time": time, "x": 20.0 * time + 1.35, "y": y}).to_csv(tmp_path / "a.csv", index=False)

    def straight(t: float, start: float, end: float) -> np.ndarray:
        return np.array([[start, t], [end, t]])

    lanes = [
        DrivenLane(straight(0.0, 0.0, 100.0), straight(-WIDTH, 0.0, 100.0), -1, [1]),
        DrivenLane(straight(0.0, 100.0, 400.0), straight(-WIDTH, 100.0, 400.0), 2, []),
        DrivenLane(straight(WIDTH, 100.0, 400.0), straight(0.0, 100.0, 400.0), -1, []),
    ]
    (tmp_path / "road.xodr").write_text(roads_of_lanes(lanes, "road"))
    made = xl.reconstruct(tmp_path / "a.csv", tmp_path / "out", road=tmp_path / "road.xodr")
    (change,) = made.to_dict()["maneuvers"]
    assert 5.0 < change["start"] < 5.4 and change["start"] + change["duration"] == pytest.approx(8.5, abs=0.3)
    rows = xl.play(tmp_path / "out/a.xosc").to_frame()
    assert rows["y"].iloc[-1] == pytest.approx(0.5 * WIDTH, abs=0.02)
    assert np.abs(rows["y"] - np.interp(rows["time"], time, y)).max() < 0.7  # 0.7 s late, at half the way's speed


# ---- SUMO ------------------------------------------------------------------------------------------------------------
def sumo_run(folder: Path, *, left_handed: bool = False, packed: bool = False) -> tuple[Path, Path, pd.DataFrame]:
    """Two edges of two lanes with a junction between them, a lane for pedestrians; FCD of a car that changes lanes to
    the left at 6 s and of a truck that follows, and the places of their front bumpers."""
    flip = -1.0 if left_handed else 1.0  # the same in a mirror
    whole = {"e0": (0.0, 100.0), ":j_0": (100.0, 110.0), "e1": (110.0, 400.0)}
    edges = ""
    for name, (start, end) in whole.items():
        lanes = ""
        for index in range(3):
            y = flip * (-2.5 + index) * WIDTH
            allow = 'allow="pedestrian"' if index == 0 else ""
            about = f'id="{name}_{index}" index="{index}" length="{end - start}" {allow}'
            lanes += f'<lane {about} shape="{start},{y} {end},{y}"/>'
        edges += f'<edge id="{name}" function="{"internal" if name[0] == ":" else "normal"}">{lanes}</edge>'
    links = "".join(
        f'<connection from="e0" to="e1" fromLane="{k}" toLane="{k}" via=":j_0_{k}"/>'
        f'<connection from=":j_0" to="e1" fromLane="{k}" toLane="{k}"/>'
        for k in (1, 2)
    )
    net = folder / f"run.net.xml{'.gz' if packed else ''}"
    text = f'<net lefthand="{str(left_handed).lower()}">{edges}{links}</net>'
    net.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    time = np.arange(0.0, 15.0, 0.1)
    u = np.clip((time - 6.0) / 4.0, 0.0, 1.0)
    car = {"x": 40.0 + 15.0 * time, "y": flip * WIDTH * (-1.5 + 0.5 - 0.5 * np.cos(np.pi * u)), "type": "car"}
    truck = {"x": 10.0 + 15.0 * time, "y": flip * -1.5 * WIDTH + 0.0 * time, "type": "Truck"}
    steps, rows = "", []
    for k, moment in enumerate(time):
        inside = ""
        for name, one in (("car", car), ("big", truck)):
            slope = np.gradient(one["y"], one["x"])[k]
            angle = 90.0 - np.degrees(np.arctan(slope))
            inside += (
                f'<vehicle id="{name}" x="{one["x"][k]:.3f}" y="{one["y"][k]:.3f}" angle="{angle:.4f}" speed="15" '
                f'type="{one["type"]}" lane="e0_1" pos="1" posLat="0"/>'
            )
            rows.append((name, moment, one["x"][k], one["y"][k]))
        steps += f'<timestep time="{moment:.2f}">{inside}<person id="p" x="0" y="0"/></timestep>'
    fcd = folder / f"run.fcd.xml{'.gz' if packed else ''}"
    text = f"<fcd-export>{steps}</fcd-export>"
    fcd.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    return fcd, net, pd.DataFrame(rows, columns=["name", "time", "x", "y"])


@pytest.mark.parametrize(("left_handed", "packed"), [(False, False), (True, True)])
def test_a_run_of_sumo_drives_on_its_own_network(tmp_path, left_handed, packed):
    fcd, net, truth = sumo_run(tmp_path, left_handed=left_handed, packed=packed)
    made = xl.reconstruct(fcd, tmp_path / "out", road=net)
    side = "right" if left_handed else "left"
    assert [(row["entity"], row["kind"], row["side"]) for row in made.to_dict()["maneuvers"]] == [
        ("car", "lane change", side)
    ]
    assert {row["entity"]: row["class"] for row in made.to_dict()["vehicles"]} == {"car": "car", "big": "truck"}
    played = xl.play(tmp_path / "out/run.xosc").to_frame()
    for name, length in (("car", 5.0), ("big", 7.1)):
        rows, true = played[played["name"] == name], truth[truth["name"] == name]
        behind = 0.8 * length  # the rear axle passes where the front did so much before
        x = np.interp(rows["time"], true["time"], true["x"]) - behind
        y = np.interp(rows["time"] - behind / 15.0, true["time"], true["y"])
        assert np.abs(rows["x"] - x).max() < 0.1
        assert np.abs(rows["y"] - y).max() < 0.05
        assert set(rows["road"].astype(str)) == {"1", "2", "3"}
    assert 'rule="LHT"' in (tmp_path / "out/run.xodr").read_text() or not left_handed


@pytest.mark.parametrize(
    ("fcd", "net", "error", "said"),
    [
        (None, "", FormatError, "`road` FILE.net.xml"),
        (None, "<net/>", FormatError, "no lane: not a SUMO network"),
        (None, '<net><lane id="a_0" length="5" allow="pedestrian"/></net>', FormatError, "no lane for vehicles"),
        (None, '<net><lane id="a_0" length="5" shape="1,2"/></net>', FormatError, "shape='1,2' is no line"),
        (None, "<net><edge", FormatError, "not XML"),
        ("<fcd-export/>", None, NotEnoughDataError, "no vehicle"),
        ('<fcd-export><timestep time="0"><vehicle id="a" x="?"/></timestep></fcd-export>', None, FormatError, "x='?'"),
        ('<fcd-export><vehicle id="a"/></fcd-export>', None, FormatError, "outside a timestep"),
    ],
)
def test_a_run_that_cannot_be_read_is_refused_in_a_line(tmp_path, fcd, net, error, said):
    source, network, _ = sumo_run(tmp_path)
    if fcd is not None:
        source.write_text(fcd)
    if net:
        network.write_text(net)
    with pytest.raises(error, match=said.replace("?", r"\?")) as caught:
        xl.reconstruct(source, road=None if net == "" else network)
    assert "\n" not in str(caught.value)
