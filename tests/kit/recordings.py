"""Recordings with known truth in every format that is read: side, direction, rate, reference point and clock vary.

A car sways about a place right of its lane's centre (so that a turned sign shows), a truck drives ahead of it, another
car beside it, and one comes towards them, on a road with two lanes each way, straight or an arc.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

WIDTH = 3.5
SPEED = 30.0
LENGTHS = {"car": 4.5, "ahead": 12.0, "beside": 4.5, "oncoming": 4.5}
LEAD = 60.0
"""From the car's middle to the truck's. [m]"""
ROAD = 3000.0
REFERENCE = {"centre": 0.0, "front": 0.5, "rear": -0.5, "rear axle": -0.3}
"""Ahead of a vehicle's middle, as a share of its length. [-]"""


def sway(time: np.ndarray) -> np.ndarray:
    """Offset of the car, to the left of travel. [m]"""
    return 0.3 * np.sin(2 * np.pi * time / 11.0) - 0.15


@dataclass(frozen=True)
class Case:
    """One recording."""

    hand: str = "right"
    against: bool = False  # the car drives against the reference line
    turned: float = 0.0  # [rad]
    radius: float = np.inf  # of the reference line, in left curves [m]
    rate: float = 25.0  # [Hz]
    digits: int = 9  # of time stamps
    jitter: float = 0.0  # of each vehicle's own stamps [s]
    duration: float = 40.0  # [s]
    header: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x, y [m], heading [rad]

    def way(self, name: str) -> int:
        """+1 along the reference line."""
        return -1 if self.against != (name == "oncoming") else 1

    def lane_index(self, name: str) -> int:
        """From the right."""
        return 1 if name == "beside" else 0

    def times(self, name: str = "car") -> np.ndarray:
        """Stamps of a vehicle. [s]"""
        time = np.arange(int(self.duration * self.rate)) / self.rate
        seed = sorted(LENGTHS).index(name)
        time = time + self.jitter * np.random.default_rng(seed).uniform(-1.0, 1.0, len(time))
        return np.round(time - min(time[0], 0.0), self.digits)

    def offset(self, name: str, time: np.ndarray) -> np.ndarray:
        """To the left of travel. [m]"""
        return sway(time) if name == "car" else np.zeros(len(time))

    def place(self, s: np.ndarray, t: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, y [m] and direction of the reference line [rad] in inertial coordinates."""
        bend = s / self.radius
        x, y = (s, 0.0 * s) if np.isinf(self.radius) else (
            self.radius * np.sin(bend), self.radius * (1.0 - np.cos(bend)))  # fmt: skip
        x, y = x - t * np.sin(bend), y + t * np.cos(bend)
        c, d = np.cos(self.turned), np.sin(self.turned)
        x, y = c * x - d * y + self.header[0], d * x + c * y + self.header[1]
        c, d = np.cos(self.header[2]), np.sin(self.header[2])
        return c * x - d * y, d * x + c * y, bend + self.turned + self.header[2]

    def centre(self, name: str) -> float:
        """t of a vehicle's lane. [m]"""
        from_right = self.lane_index(name) + 0.5
        along = from_right - 2.0 if self.hand == "right" else from_right  # in direction of travel, for way +1
        return self.way(name) * along * WIDTH

    def along(self, name: str, time: np.ndarray) -> np.ndarray:
        """s of the middle. [m]"""
        way = self.way(name)
        start = {"ahead": LEAD}.get(name, 0.0)
        return (200.0 if way > 0 else ROAD - 200.0) + way * (start + SPEED * time)

    def rows(self, name: str, reference: str = "centre") -> pd.DataFrame:
        """A vehicle's true rows; x and y of a reference point."""
        time, way = self.times(name), self.way(name)
        s, t = self.along(name, time), self.centre(name) + way * self.offset(name, time)
        x, y, heading = self.place(s, t)
        step = 1e-3  # the way's own direction, swaying included
        ahead, behind = (
            self.place(self.along(name, time + d), self.centre(name) + way * self.offset(name, time + d))
            for d in (step, -step)
        )
        heading = np.arctan2(ahead[1] - behind[1], ahead[0] - behind[0])
        arm = REFERENCE[reference] * LENGTHS[name]
        return pd.DataFrame({
            "id": name, "time": time, "x": x + arm * np.cos(heading), "y": y + arm * np.sin(heading),
            "heading": heading, "length": LENGTHS[name], "vehicle_class": "truck" if name == "ahead" else "car",
        })  # fmt: skip

    def tracks(self, reference: str = "centre") -> pd.DataFrame:
        """All vehicles, in the order of time."""
        rows = pd.concat([self.rows(name, reference) for name in LENGTHS], ignore_index=True)
        return rows.sort_values("time", kind="stable", ignore_index=True)


def road_file(case: Case, folder: Path) -> Path:
    """OpenDRIVE."""
    lane = '<lane id="{}" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    shape = "<line/>" if np.isinf(case.radius) else f'<arc curvature="{1 / case.radius!r}"/>'
    rule = "RHT" if case.hand == "right" else "LHT"
    offset = '<offset x="{}" y="{}" z="0" hdg="{}"/>'.format(*case.header) if any(case.header) else ""
    path = folder / f"road_{rule}.xodr"
    path.write_text(
        f'<OpenDRIVE><header revMajor="1" revMinor="7" name="">{offset}</header>'
        f'<road name="" length="{ROAD}" id="1" junction="-1" rule="{rule}"><planView>'
        f'<geometry s="0" x="0" y="0" hdg="{case.turned}" length="{ROAD}">{shape}</geometry></planView>'
        f'<lanes><laneSection s="0"><left>{lane.format(2)}{lane.format(1)}</left><center><lane id="0" type="none"/>'
        f"</center><right>{lane.format(-1)}{lane.format(-2)}</right></laneSection></lanes></road></OpenDRIVE>"
    )
    return path


def fleet_table(case: Case) -> pd.DataFrame:
    """The car's own drive, as cameras have it."""
    time = case.times()
    offset, width = sway(time), WIDTH + 0.0 * time
    return pd.DataFrame({"time": time, "offset": offset, "lane_width": width, "speed": SPEED})


# ---- SUMO ------------------------------------------------------------------------------------------------------------
BORDER = 1000.0
"""Length of the first edge; the next goes on behind an inner lane of 2 m. [m]"""


def sumo_files(case: Case, folder: Path, *, sidewalk: bool = False) -> tuple[Path, Path]:
    """FCD output and network: two edges with two lanes (and one to walk on), along x or against it."""
    turn = np.pi * case.against
    right = case.hand == "right"
    kerb = 1 if sidewalk else 0
    centre = {k: (k - kerb + 0.5 - 2.0) * WIDTH * (1.0 if right else -1.0) for k in range(2 + kerb)}  # left of the axis
    edges = {"e0": (0.0, BORDER), ":j_0": (BORDER, 2.0), "e1": (BORDER + 2.0, ROAD)}
    text = []
    for edge, (_, length) in edges.items():
        lanes = "".join(
            f'<lane id="{edge}_{k}" index="{k}" speed="36" length="{length}" width="{WIDTH}" shape="0,0 1,0"'
            + (' allow="pedestrian"' if k < kerb else "") + "/>"
            for k in centre
        )  # fmt: skip
        text.append(f'<edge id="{edge}"{" function=" + chr(34) + "internal" + chr(34) if edge[0] == ":" else ""}>'
                    f"{lanes}</edge>")  # fmt: skip
    links = "".join(
        f'<connection from="e0" to="e1" fromLane="{k}" toLane="{k}" via=":j_0_{k}" dir="s"/>'
        f'<connection from=":j_0" to="e1" fromLane="{k}" toLane="{k}" dir="s"/>'
        for k in centre
    )
    net = folder / "run.net.xml"
    net.write_text(f'<net lefthand="{str(not right).lower()}">{"".join(text)}{links}</net>')
    steps: dict[float, list[str]] = {}
    for name in ("car", "ahead", "beside"):
        time = case.times(name)
        offset = case.offset(name, time)
        lane = case.lane_index(name)
        number = kerb + (lane if right else 1 - lane)
        front = 700.0 + {"ahead": LEAD}.get(name, 0.0) + SPEED * time + 0.5 * LENGTHS[name]
        left = centre[number] + offset
        x, y = np.cos(turn) * front - np.sin(turn) * left, np.sin(turn) * front + np.cos(turn) * left
        for k, at in enumerate(time):
            edge = next(one for one in ("e1", ":j_0", "e0") if front[k] >= edges[one][0])
            steps.setdefault(float(at), []).append(
                f'<vehicle id="{name}" x="{x[k]:.3f}" y="{y[k]:.3f}" angle="{(90 - np.degrees(turn)) % 360:.2f}" '
                f'type="{"truck" if name == "ahead" else "car"}" speed="{SPEED}" pos="{front[k] - edges[edge][0]:.3f}" '
                f'lane="{edge}_{number}" posLat="{offset[k] if right else -offset[k]:.4f}"/>'
            )
    fcd = folder / "fcd.xml"
    body = "".join(f'<timestep time="{at:g}">{"".join(rows)}</timestep>' for at, rows in sorted(steps.items()))
    fcd.write_text(f"<fcd-export>{body}</fcd-export>")
    return fcd, net


TYPES = '<routes><vType id="truck" vClass="truck" length="12"/><vType id="car" length="4.5"/></routes>'


# ---- bus logs --------------------------------------------------------------------------------------------------------
def write_mf4(path: Path, signals: dict[str, tuple[np.ndarray, np.ndarray, str]]) -> Path:
    """A log with a group for every channel: name -> stamps, samples and unit."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asammdf's own imports
        import asammdf
    with asammdf.MDF(version="4.10") as log:
        for name, (time, values, unit) in signals.items():
            log.append([asammdf.Signal(values, time, name=name.partition("#")[0], unit=unit)])
        log.save(path, overwrite=True)
    return path


# ---- OSI -------------------------------------------------------------------------------------------------------------
def write_osi_trace(case: Case, folder: Path, *, directions: bool = True, horizon: float = np.inf) -> Path:
    """Physical lanes with centre lines along the reference line, seen as far as the horizon from the car. [m]"""
    import osi_utilities
    from osi3.osi_sensorview_pb2 import SensorView

    path = folder / "made_gt.osi"
    s = np.arange(0.0, ROAD + 1.0, 10.0)
    lines = [np.stack(case.place(s, k * WIDTH)[:2], axis=1) for k in range(-2, 3)]
    centres = [np.stack(case.place(s, (k + 0.5) * WIDTH)[:2], axis=1) for k in range(-2, 2)]
    rows = {name: case.rows(name) for name in LENGTHS}
    with osi_utilities.SingleTraceWriter() as writer:
        writer.open(path)
        for k, at in enumerate(case.times()):
            message = SensorView().global_ground_truth
            message.timestamp.seconds, message.timestamp.nanos = divmod(round(float(at) * 1e9), 1_000_000_000)
            message.host_vehicle_id.value = 1
            for number, name in enumerate(LENGTHS, 1):
                _vehicle(message.moving_object.add(type=2), number, rows[name].iloc[k], name)
            if k == 0 or np.isfinite(horizon):
                near = np.abs(s - case.along("car", case.times())[k]) <= horizon
                _lanes(message, case, [line[near] for line in lines], [line[near] for line in centres], directions)
            writer.write_message(message)
    return path


def _vehicle(one: Any, number: int, row: pd.Series, name: str) -> None:
    one.id.value = number
    one.base.position.x, one.base.position.y = row["x"], row["y"]
    one.base.orientation.yaw = row["heading"]
    one.base.dimension.length = LENGTHS[name]
    one.vehicle_classification.type = 7 if name == "ahead" else 4  # heavy truck, medium car
    one.base.velocity.x, one.base.velocity.y = SPEED * np.cos(row["heading"]), SPEED * np.sin(row["heading"])


def _lanes(message: Any, case: Case, lines: list[Any], centres: list[Any], directions: bool) -> None:
    for k, line in enumerate(lines):
        boundary = message.lane_boundary.add()
        boundary.id.value = 100 + k
        for x, y in line:
            point = boundary.boundary_line.add().position
            point.x, point.y = x, y
    for k, line in enumerate(centres):  # from the right of the reference line to its left
        lane = message.lane.add()
        lane.id.value = 200 + k
        about = lane.classification
        about.type = 2
        if directions:
            about.centerline_is_driving_direction = (k < 2) == (case.hand == "right")
        about.right_lane_boundary_id.add().value, about.left_lane_boundary_id.add().value = 100 + k, 101 + k
        for beside, there in ((about.right_adjacent_lane_id, k - 1), (about.left_adjacent_lane_id, k + 1)):
            if 0 <= there < len(centres):
                beside.add().value = 200 + there
        for x, y in line:
            point = about.centerline.add()
            point.x, point.y = x, y


# ---- CommonRoad ------------------------------------------------------------------------------------------------------
def commonroad_file(case: Case, folder: Path) -> Path:
    """Four lanes of two lanelets each, in their directions of travel."""
    cut = 0.5 * ROAD
    s = [np.arange(0.0, cut + 1.0, 10.0), np.arange(cut, ROAD + 1.0, 10.0)]
    text = []
    for k in range(-2, 2):  # from the right of the reference line to its left
        ahead = (k < 0) == (case.hand == "right")
        for part in (0, 1):
            edges = [np.stack(case.place(s[part], (k + j) * WIDTH)[:2], axis=1) for j in (1, 0)]
            left, right = edges if ahead else (edges[1][::-1], edges[0][::-1])
            bounds = "".join(
                f"<{side}Bound>" + "".join(f"<point><x>{x:.6f}</x><y>{y:.6f}</y></point>" for x, y in line)
                + f"</{side}Bound>" for side, line in (("left", left), ("right", right))
            )  # fmt: skip
            links = f'<successor ref="{_lanelet(k, 1 - part)}"/>' if part == (0 if ahead else 1) else ""
            for side, step in (("Left", 1 if ahead else -1), ("Right", -1 if ahead else 1)):
                if -2 <= k + step < 2 and ((k + step < 0) == (k < 0)):
                    links += f'<adjacent{side} ref="{_lanelet(k + step, part)}" drivingDir="same"/>'
            text.append(
                f'<lanelet id="{_lanelet(k, part)}">{bounds}{links}<laneletType>highway</laneletType></lanelet>'
            )
    for number, name in enumerate(LENGTHS, 1):
        states = [
            f"<position><point><x>{row.x:.6f}</x><y>{row.y:.6f}</y></point></position><orientation><exact>{row.heading:.6f}"
            f"</exact></orientation><time><exact>{k}</exact></time><velocity><exact>{SPEED}</exact></velocity>"
            for k, row in enumerate(case.rows(name).itertuples())
        ]
        moved = "".join(f"<state>{one}</state>" for one in states[1:])
        text.append(
            f'<dynamicObstacle id="{900 + number}"><type>{"truck" if name == "ahead" else "car"}</type><shape>'
            "<rectangle>"
            f"<length>{LENGTHS[name]}</length><width>2.0</width></rectangle></shape><initialState>{states[0]}"
            f"</initialState><trajectory>{moved}</trajectory></dynamicObstacle>"
        )
    path = folder / "made.xml"
    path.write_text(
        f'<?xml version="1.0"?><commonRoad timeStepSize="{1 / case.rate}" commonRoadVersion="2020a" author="" '
        'affiliation="" source="" benchmarkID="ZAM_Made-1_1_T-1" date="2026-01-01"><location>'
        "<geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location><scenarioTags/>"
        + "".join(text) + "</commonRoad>"
    )  # fmt: skip
    return path


def _lanelet(k: int, part: int) -> int:
    return 100 + 10 * (k + 2) + part
