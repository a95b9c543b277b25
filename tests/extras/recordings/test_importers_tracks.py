"""Tracks on known roads, and CommonRoad scenarios: made here, so that the truth is known."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.importers.track_table import read_esmini_log
from xosc_lateral.extras.recordings.importers.tracks import Strip, graph_of_shapes, import_tracks
from xosc_lateral.extras.recordings.lane_order import LaneGraph

WIDTH = 3.5
HEADING = 0.3

LANE = """<lane id="{id}" type="driving" level="false">{link}<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>"""
ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1" date="" north="0" south="0" east="0" west="0"/>
<road name="" length="2000" id="7" junction="-1" rule="RHT"><planView>
<geometry s="0" x="100" y="50" hdg="0.3" length="2000"><line/></geometry></planView>
<lanes>{sections}</lanes></road></OpenDRIVE>"""


@pytest.fixture
def road(tmp_path: Path) -> Path:
    return two_lanes_each_way(tmp_path)


def two_lanes_each_way(folder: Path) -> Path:
    """For 2 km, straight, at an angle; a section border in the middle."""
    both = []
    for start, link in ((0, "successor"), (1000, "predecessor")):
        lanes = {k: LANE.format(id=k, link=f'<link><{link} id="{k}"/></link>') for k in (2, 1, -1, -2)}
        middle = '<center><lane id="0" type="none" level="false"/></center>'
        both.append(
            f'<laneSection s="{start}"><left>{lanes[2]}{lanes[1]}</left>{middle}<right>{lanes[-1]}{lanes[-2]}</right>'
            "</laneSection>"
        )
    path = folder / "road.xodr"
    path.write_text(ROAD.format(sections="".join(both)))
    return path


def world(s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 100 + s * np.cos(HEADING) - t * np.sin(HEADING), 50 + s * np.sin(HEADING) + t * np.cos(HEADING)


def driven(
    name: str, lane: int, start: float, speed: float, sway: float = 0.0, change_at: float = np.inf
) -> pd.DataFrame:
    """A vehicle for 40 s at 25 Hz in lane 1 (right), 2 ... of the rightwards carriageway, or -1, -2 of the other."""
    time = np.arange(0.0, 40.0, 0.04)
    way = 1.0 if lane > 0 else -1.0
    place = -(2.5 - abs(lane)) * WIDTH  # of the right-hand lanes' centres: -5.25 and -1.75
    moved = WIDTH / (1.0 + np.exp(-(time - change_at) / 0.8)) if np.isfinite(change_at) else 0.0
    t = way * (place + moved + sway * np.sin(2 * np.pi * time / 12))
    s = start + way * speed * time
    x, y = world(s, t)
    return pd.DataFrame({"time": time, "id": name, "x": x, "y": y, "psi": np.degrees(HEADING + (way < 0) * np.pi)})


def test_tracks_find_their_lanes_offsets_and_neighbours(road, tmp_path):
    made = [
        driven("sways", 1, 100.0, 30.0, sway=0.3),
        driven("ahead", 1, 180.0, 30.0),
        driven("beside", 2, 105.0, 30.0),
        driven("oncoming", -2, 1900.0, 30.0, sway=0.2),
    ]
    table = pd.concat(made).assign(length=5.0, type=lambda rows: np.where(rows["id"] == "beside", "Truck", "Car"))
    source = tmp_path / "tracks.csv"
    table.to_csv(source, index=False)
    out = tmp_path / "drives.parquet"
    assert main(["import", "tracks", str(source), "--road", str(road), "--map", "heading=psi:deg", "-o", str(out)]) == 0
    found = pd.read_parquet(out).set_index("drive")
    mine = found.loc["sways"]
    assert mine["offset"].to_numpy() == pytest.approx(0.3 * np.sin(2 * np.pi * mine["time"] / 12), abs=1e-6)
    assert mine["lane_width"].to_numpy() == pytest.approx(WIDTH)
    assert mine["speed"].to_numpy() == pytest.approx(30.0, abs=0.01)
    assert set(mine["lane_index"]) == {0} and set(mine["lane_count"]) == {2}
    assert mine["lead_distance"].to_numpy() == pytest.approx(75.0), "bumper to bumper, across the section border"
    assert mine["left_distance"].to_numpy() == pytest.approx(0.0, abs=1e-9) and set(mine["left_is_truck"]) == {1.0}
    assert mine["right_distance"].isna().all()
    assert np.isposinf(found.loc["ahead", "lead_distance"]).all(), "a lane with nobody in it"
    back = found.loc["oncoming"]
    assert set(back["lane_index"]) == {1}
    assert back["offset"].to_numpy() == pytest.approx(0.2 * np.sin(2 * np.pi * back["time"] / 12), abs=1e-6)
    assert set(mine["following_run"]) == {0} and mine["time"].min() == pytest.approx(2.0), "2 s at the ends are cut"


def test_a_lane_change_is_cut_and_a_new_section_is_none(road, tmp_path):
    source = tmp_path / "tracks.parquet"
    pd.concat([driven("a", 1, 600.0, 25.0, change_at=20.0), driven("b", 2, 700.0, 25.0)]).drop(
        columns="psi"
    ).to_parquet(source)
    table = import_tracks(source, road=road).table
    assert set(table[table.drive == "a"].groupby("following_run")["lane_index"].first()) == {0, 1}
    assert not table[(table.drive == "a") & table.time.between(18, 22)].size
    assert set(table[table.drive == "b"]["following_run"]) == {0}


def test_tracks_in_other_coordinates_are_told(road, tmp_path):
    source = tmp_path / "tracks.csv"
    driven("a", 1, 100.0, 30.0).drop(columns="psi").assign(x=lambda rows: rows.x + 5e5).to_csv(source, index=False)
    with pytest.raises(FormatError, match=r"tracks\.csv: no row lies in a driving lane of road\.xodr: x from 5001"):
        import_tracks(source, road=road)
    with pytest.raises(FormatError, match=r"no column 'vehicle'.*--map vehicle=COLUMN"):
        driven("a", 1, 100.0, 30.0).drop(columns="id").to_csv(source, index=False)
        import_tracks(source, road=road)


def test_a_layout_of_lanes_puts_the_next_piece_ahead_and_the_left_one_beside():
    graph = LaneGraph(np.array([100.0, 100.0, 50.0, 50.0]), np.array([1, -1, 3, -1]), [[2], [3], [], []])
    part, station, rank, _ = graph.stations(np.arange(4), np.zeros(4))
    assert set(part) == {0}
    assert station.tolist() == [0.0, 0.0, 100.0, 100.0] and rank.tolist() == [0, 1, 0, 1]
    ring = LaneGraph(np.array([10.0, 20.0]), np.array([-1, -1]), [[1], [0]])
    assert ring.stations(np.arange(2), np.zeros(2))[1].tolist() == [0.0, 10.0]


def test_what_lies_side_by_side_on_a_curve_has_one_station_in_whatever_order_lanes_are_listed():
    radius, quarter = 800.0, np.pi / 4

    def strip(inner: float, part: int) -> Strip:
        angle = np.linspace(part * quarter, (part + 1) * quarter, 400)
        line = lambda r: np.stack([r * np.sin(angle), radius - r * np.cos(angle), 0.0 * angle], axis=1)  # noqa: E731
        return Strip(line(inner + 0.5 * WIDTH), line(inner), line(inner + WIDTH))  # a left curve: inside is left

    for order in ([0, 1, 2, 3], [1, 0, 3, 2], [3, 1, 2, 0]):
        places = [(k, part) for k in (0, 1) for part in (0, 1)]  # lane from the outside, part
        where = {places[number]: at for at, number in enumerate(order)}
        shapes = [strip(radius - places[number][0] * WIDTH, places[number][1]) for number in order]
        left, following = np.full(4, -1), [list[int]() for _ in range(4)]
        for part in (0, 1):
            left[where[0, part]] = where[1, part]
        for k in (0, 1):
            following[where[k, 0]] = [where[k, 1]]
        graph = graph_of_shapes(shapes, left, following)
        middles = np.array([0.3, 1.2])  # of the angle, one in each part
        stations = {}
        for k in (0, 1):
            pieces = np.array([where[k, part] for part in (0, 1)])
            r = radius + (0.5 - k) * WIDTH
            _, stations[k], _, scale = graph.stations(pieces, r * (middles - np.array([0.0, quarter])))
            own = r * np.diff(middles) / np.diff(stations[k])
            assert np.mean(scale) == pytest.approx(float(own[0]), rel=1e-3)
        assert stations[0] == pytest.approx(stations[1], abs=0.05)


@pytest.mark.filterwarnings("default")
def test_commonroad_obstacles_come_between_the_bounds_of_their_lanelets(tmp_path, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("commonroad", reason="extra `commonroad` is not installed")
        path = commonroad_scenario(tmp_path)
    out = tmp_path / "drives.parquet"
    assert main(["import", "commonroad", str(path), "-o", str(out)]) == 0
    table = pd.read_parquet(out)
    sways, leads = (table[table["drive"].str.endswith(f":{k}")] for k in (31, 32))
    assert sways["offset"].to_numpy() == pytest.approx(0.3 * np.sin(2 * np.pi * sways["time"] / 12), abs=1e-3)
    assert sways["lane_width"].to_numpy() == pytest.approx(WIDTH)
    assert set(sways["lane_index"]) == {0} and set(sways["lane_count"]) == {2}
    assert sways["left_distance"].to_numpy() == pytest.approx(25.0, abs=1e-6) and set(sways["left_is_truck"]) == {1.0}
    assert set(leads["lane_index"]) == {1} and leads["offset"].abs().max() < 1e-6
    bad = tmp_path / "bad.xml"
    bad.write_text("<commonRoad/>")
    assert main(["import", "commonroad", str(bad), "-o", str(tmp_path / "x.parquet")]) == 1
    assert "not a CommonRoad scenario" in capsys.readouterr().err


def commonroad_scenario(folder: Path) -> Path:
    """Two lanes, each of two lanelets in a row; a car on the right that sways, a truck ahead on the left."""

    def bound(name: str, begin: float, end: float, y: float) -> str:
        points = "".join(f"<point><x>{x:.6f}</x><y>{y}</y></point>" for x in np.linspace(begin, end, 60))
        return f"<{name}>{points}</{name}>"

    parts = []
    for name, begin, end, link in (
        (1, 0, 600, '<successor ref="{}"/>'),
        (2, 600, 1500, '<predecessor ref="{}"/>'),
    ):
        for up in (0, 1):
            y, other = up * WIDTH, (2 if name == 1 else 1) + 10 * up
            side, beside = ("Right", name) if up else ("Left", name + 10)
            parts.append(
                f'<lanelet id="{name + 10 * up}">{bound("leftBound", begin, end, y + WIDTH)}'
                f"{bound('rightBound', begin, end, y)}{link.format(other)}"
                f'<adjacent{side} ref="{beside}" drivingDir="same"/></lanelet>'
            )
    for number, kind, length, start, lane, sway in (
        (31, "car", 4.0, 50.0, 0, 0.3),
        (32, "truck", 16.0, 85.0, 1, 0.0),
    ):
        states = []
        for k in range(400):
            x, y = start + 3.0 * k, WIDTH * (lane + 0.5) + sway * np.sin(2 * np.pi * 0.1 * k / 12)
            position = f"<position><point><x>{x:.6f}</x><y>{y:.6f}</y></point></position>"
            exact = "".join(
                f"<{what}><exact>{value}</exact></{what}>"
                for what, value in (("orientation", 0.0), ("time", k), ("velocity", 30.0))
            )
            tag = "state" if k else "initialState"
            states.append(f"<{tag}>{position}{exact}</{tag}>")
        parts.append(
            f'<dynamicObstacle id="{number}"><type>{kind}</type><shape><rectangle><length>{length}</length>'
            f"<width>2.0</width></rectangle></shape>{states[0]}<trajectory>{''.join(states[1:])}</trajectory>"
            "</dynamicObstacle>"
        )
    path = folder / "made.xml"
    path.write_text(
        '<?xml version="1.0"?><commonRoad timeStepSize="0.1" commonRoadVersion="2020a" author="" affiliation="" '
        'source="" benchmarkID="ZAM_Made-1_1_T-1" date="2026-01-01"><location><geoNameId>-999</geoNameId>'
        "<gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location><scenarioTags/>"
        + "".join(parts)
        + "</commonRoad>"
    )
    return path


# ---- what esmini logs ------------------------------------------------------------------------------------------------
LOGGED = (
    "Entity_Name [-]", "Entity_ID [-]", "Current_Speed [m/s]", "bb_x [m]", "bb_length [m]", "bb_width [m]",
    "World_Position_X [m]", "World_Position_Y [m]", "lane_offset[m]", "World_Heading_Angle [rad]",
)  # fmt: skip
LINES_BEFORE = "esmini GIT REV: v3.6.0\nesmini GIT TAG: v3.6.0\nScenario File Name: a.xosc\nNumber of Vehicles: 2\n"


def esmini_log(vehicles: dict[str, tuple[pd.DataFrame, float, float]]) -> str:
    """As the player lays it out: all vehicles of a step in a line; name -> rows, bb_x, length."""
    head = ", ".join(f"#{k} {name}" for k in range(1, len(vehicles) + 1) for name in LOGGED)
    lines = [f"{LINES_BEFORE}Index [-], TimeStamp [s], {head}, "]
    time = next(iter(vehicles.values()))[0]["time"].to_numpy()
    for row, at in enumerate(time):
        cells = []
        for number, (name, (rows, middle, length)) in enumerate(vehicles.items()):
            one = rows.iloc[row]
            heading = np.radians(one["psi"])
            x, y = one["x"] - middle * np.cos(heading), one["y"] - middle * np.sin(heading)
            cells.append(f"{name}, {number}, 30.0, {middle}, {length}, 2.0, {x:.6f}, {y:.6f}, 0.0, {heading:.6f}")
        lines.append(f"{row}, {at:.6f}, {', '.join(cells)}, ")
    return "\n".join(lines) + "\n"


def test_a_log_of_esmini_is_a_table_of_tracks_with_gaps_from_the_boxes(road, tmp_path):
    source = tmp_path / "log.csv"
    back, truck = driven("back", -1, 1900.0, 30.0, sway=0.2), driven("truck", 1, 180.0, 30.0)
    source.write_text(
        esmini_log(
            {"back": (back, 1.4, 5.0), "car": (driven("car", 1, 100.0, 30.0), 1.4, 5.0), "t": (truck, 4.0, 12.0)}
        )
    )
    found = import_tracks(source, road=road).table.set_index("drive")
    assert set(found.index) == {"back", "car", "t"}
    assert found.loc["car", "offset"].to_numpy() == pytest.approx(0.0, abs=2e-6)
    assert found.loc["car", "lead_distance"].to_numpy() == pytest.approx(80.0 - 8.5, abs=1e-4)
    # against s and to the left of travel: positive; x and y were logged 1.4 m behind the middle, on the same line
    swayed = 0.2 * np.sin(2 * np.pi * found.loc["back", "time"] / 12)
    assert found.loc["back", "offset"].to_numpy() == pytest.approx(swayed, abs=2e-6)


def test_a_log_of_esmini_has_vehicles_that_come_and_go(road, tmp_path):
    """The head knows those of the first line; a line has as many groups as there are vehicles, in any order."""
    cars = {
        name: (driven(name, 1, start, 30.0), 1.4, 5.0) for name, start in (("a", 100.0), ("b", 200.0), ("c", 300.0))
    }
    head, *lines = esmini_log(cars).split("Index")[1].splitlines()
    groups = [[", ".join(line.split(", ")[2 + k * 10 : 12 + k * 10]) for k in range(3)] for line in lines]
    there = [(0, 1) if k < 300 else (0, 1, 2) if k < 700 else (2, 1) for k in range(len(lines))]
    text = f"{LINES_BEFORE}Index{head.split('#3')[0]}\n"
    for line, of, who in zip(lines, groups, there, strict=True):
        text += ", ".join([*line.split(", ")[:2], *(of[k] for k in who)]) + ", \n"
    source = tmp_path / "log.csv"
    source.write_text(text)
    rows = read_esmini_log(source)
    spans = rows.groupby("vehicle")["time"].agg(["min", "max", "size"]).round(2)
    assert spans.loc["a"].tolist() == [0.0, 27.96, 700]
    assert spans.loc["b"].tolist() == [0.0, 39.96, 1000]
    assert spans.loc["c"].tolist() == [12.0, 39.96, 700]
    c = rows[rows["vehicle"] == "c"]
    x, _ = world(300.0 - 1.4 + 30.0 * c["time"].to_numpy(), np.full(len(c), -1.5 * WIDTH))
    assert c["x"].to_numpy() == pytest.approx(x, abs=1e-5)
    known = import_tracks(source, road=road)  # "c" goes from the third columns to the first: its clock does not
    assert set(known.table["drive"]) == {"a", "b", "c"} and not known.provenance.notes


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("esmini GIT REV: v3\n1,2,3\n", "without a line that begins with 'Index"),
        ("esmini GIT REV: v3\nIndex [-], TimeStamp [s], \n0, 0.0, \n", "no vehicle in the table's head"),
        ("esmini GIT REV: v3\nIndex [-], TimeStamp [s], #1 Entity_Name [-], \n0, 0.0, a, \n", "vehicle #1: no column"),
    ],
    ids=["no head", "nobody", "a column short"],
)
def test_a_damaged_log_of_esmini_is_refused(road, tmp_path, text, message):
    source = tmp_path / "log.csv"
    source.write_text(text)
    with pytest.raises(FormatError, match=message):
        import_tracks(source, road=road)
