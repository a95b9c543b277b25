"""OSI traces into drive tables: written by us and read again, and made here message by message."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.extras.recordings.test_osi_write import messages
from tests.kit.motion import RADIUS, drive, entity, together, two_roads
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.importers import import_drives
from xosc_lateral.extras.recordings.osi_trace import NANOSECONDS, PLACES, ROW_COLUMNS
from xosc_lateral.extras.recordings.osi_write import write_osi
from xosc_lateral.world.scenario.enums import VehicleCategory

osi_utilities = pytest.importorskip("osi_utilities")
osi3 = pytest.importorskip("osi3.osi_sensorview_pb2")
MessageToJson = pytest.importorskip("google.protobuf.json_format").MessageToJson

WIDTH = 3.5
SPEED = 25.0


def sway(time: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(2 * np.pi * time / 8.0)


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    """A car that sways from the straight into the arc of 400 m, a truck ahead, and one that comes towards them."""
    network = two_roads(tmp_path)
    time = np.arange(1001) * 0.02
    motion = together(
        drive(network, entity("Ego"), duration=20.0, speed=30.0, start=300.0, lane=-1, offset=sway(time)),
        drive(network, entity("truck", VehicleCategory.TRUCK, 12.0), duration=20.0, speed=30.0, start=350.0, lane=-1),
        drive(network, entity("oncoming"), duration=20.0, speed=25.0, start=20.0, lane=2, offset=-0.2),
    )
    return write_osi(tmp_path / "trace.mcap", motion, network, host="Ego")


@pytest.mark.parametrize("road", [None, "two_roads_RHT.xodr"])
def test_what_was_written_comes_back(trace: Path, road: str | None) -> None:
    options = {} if road is None else {"road": trace.with_name(road)}
    found = import_drives("osi", trace, **options).to_frame().set_index("drive")
    mine, truck = found.loc["Ego"], found.loc["truck"]
    assert mine["offset"].to_numpy() == pytest.approx(sway(mine["time"].to_numpy()), abs=1e-3)
    assert mine["lane_width"].to_numpy() == pytest.approx(WIDTH, abs=1e-3)
    assert mine["speed"].to_numpy() == pytest.approx(30.0, abs=0.2)  # of the middle, which turns with the car
    late = mine[mine["time"] > 10.0]
    assert late["curvature"].to_numpy() == pytest.approx(1 / (RADIUS + 1.75), rel=0.02)
    assert mine["lead_distance"].to_numpy() == pytest.approx(50.0 - 0.5 * (5.0 + 12.0), abs=0.3)
    assert set(mine["lead_is_truck"]) == {1.0}
    assert set(truck["vehicle_class"]) == {"truck"}
    assert {(*row,) for row in mine[["lane_index", "lane_count"]].to_numpy()} == {(2.0, 3.0)}
    assert found.loc["oncoming", "offset"].to_numpy() == pytest.approx(-0.2, abs=1e-3)


def test_one_vehicle_by_name_number_or_as_the_host(trace: Path, tmp_path: Path, capsys) -> None:
    tables = [import_drives("osi", trace, host=host).to_frame() for host in ("Ego", "1", "host")]
    assert {name for table in tables for name in table["drive"]} == {"Ego"}
    assert tables[0].equals(tables[1])
    assert tables[0].equals(tables[2])
    assert tables[0]["lead_distance"].notna().all()  # the others are still there to be seen
    out = str(tmp_path / "out.csv")
    assert main(["import", "osi", str(trace), "-o", out, "--host", "nobody"]) == 1
    assert "no vehicle 'nobody'; there are Ego, truck, oncoming" in capsys.readouterr().err


def test_several_traces_are_several_drives(trace: Path, tmp_path: Path) -> None:
    other = tmp_path / "other_gt.osi"
    with osi_utilities.SingleTraceWriter() as writer:
        writer.open(other)
        for message in messages(trace):
            writer.write_message(message)
    found = import_drives("osi", [trace, other], host="Ego").to_frame()
    assert set(found["drive"]) == {"trace:Ego", "other_gt:Ego"}
    assert (
        found["offset"][found["drive"] == "trace:Ego"].to_list()
        == found["offset"][found["drive"] == "other_gt:Ego"].to_list()
    )


# ---- made here -------------------------------------------------------------------------------------------------------
def truth(time: float, places: dict[int, tuple[float, float]], **base: float) -> Any:
    """Cars on a road along x."""
    message = osi3.SensorView().global_ground_truth
    nanoseconds = round(time * 1e9)
    message.timestamp.seconds, message.timestamp.nanos = divmod(nanoseconds, 1_000_000_000)
    for number, (x, y) in places.items():
        one = message.moving_object.add(type=2)
        one.id.value = number
        one.base.position.x, one.base.position.y = x, y
        if base.get("velocity"):
            one.base.velocity.x = base["velocity"]
    return message


def physical(message: Any, ahead: bool = True) -> Any:
    """Two lanes along x between y = 0, 3.5 and 7; the centre line against the direction of travel where not `ahead`."""
    way = slice(None, None, 1 if ahead else -1)
    for k in range(3):
        boundary = message.lane_boundary.add()
        boundary.id.value = 100 + k
        for x in (-100.0, 700.0, 2000.0):
            boundary.boundary_line.add().position.x = x
            boundary.boundary_line[-1].position.y = k * WIDTH
    for k in (0, 1):
        lane = message.lane.add()
        lane.id.value = 200 + k
        about = lane.classification
        about.type = 2
        about.centerline_is_driving_direction = ahead
        for x in (-100.0, 2000.0)[way]:
            about.centerline.add(x=x, y=(k + 0.5) * WIDTH)
        left, right = (100 + k + 1, 100 + k)[way]
        about.left_lane_boundary_id.add().value = left
        about.right_lane_boundary_id.add().value = right
        beside = about.left_adjacent_lane_id if (k == 0) == ahead else about.right_adjacent_lane_id
        beside.add().value = 201 - k
    return message


def logical(message: Any, forward: bool = True) -> Any:
    """The same lanes as logical ones, s along travel or against it, between boundaries that go on beyond them."""
    way = slice(None, None, 1 if forward else -1)
    for k in range(3):
        boundary = message.logical_lane_boundary.add()
        boundary.id.value = 300 + k
        for x in (-200.0, 3000.0)[way]:
            point = boundary.boundary_line.add(s_position=x if forward else -x)
            point.position.x, point.position.y = x, k * WIDTH
    for k in (0, 1):
        lane = message.logical_lane.add(type=2, move_direction=2 if forward else 3)
        lane.id.value = 400 + k
        lane.start_s, lane.end_s = (-100.0, 2000.0) if forward else (-2000.0, 100.0)
        left, right = (300 + k + 1, 300 + k)[way]
        lane.left_boundary_id.add().value = left
        lane.right_boundary_id.add().value = right
        beside = lane.left_adjacent_lane if (k == 0) == forward else lane.right_adjacent_lane
        beside.add().other_lane_id.value = 401 - k
    return message


def saved(path: Path, made: Iterable[Any], view: bool = False) -> Path:
    writer = osi_utilities.MultiTraceWriter() if path.suffix == ".mcap" else osi_utilities.SingleTraceWriter()
    with writer:
        assert writer.open(path)
        for message in made:
            written = message
            if view:
                written = osi3.SensorView()
                written.timestamp.CopyFrom(message.timestamp)
                written.global_ground_truth.CopyFrom(message)
            assert writer.write_message(written, "truth")
    return path


def drives(lanes: Any = physical, time: np.ndarray | None = None, **options: Any) -> list[Any]:
    time = np.arange(0.0, 20.0, 0.05) if time is None else time
    places = [{7: (SPEED * t, 0.5 * WIDTH + sway(t)), 8: (10.0 + SPEED * t, 1.5 * WIDTH)} for t in time]
    return [lanes(truth(t, where), **options) for t, where in zip(time.tolist(), places, strict=True)]


@pytest.mark.parametrize("lanes", [physical, logical])
@pytest.mark.parametrize("ahead", [True, False])
@pytest.mark.parametrize("name", ["trace.mcap", "trace_gt.osi", "trace.osi"])
@pytest.mark.parametrize("view", [True, False])
def test_lanes_come_in_two_encodings_two_directions_and_messages(tmp_path, lanes, ahead, name, view) -> None:
    if view:
        name = name.replace("_gt", "_sv")
    made = drives(lanes, **{"ahead" if lanes is physical else "forward": ahead})
    found = import_drives("osi", saved(tmp_path / name, made, view)).to_frame().set_index("drive")
    mine = found.loc["7"]
    assert mine["offset"].to_numpy() == pytest.approx(sway(mine["time"].to_numpy()), abs=1e-9)
    assert mine["lane_width"].to_numpy() == pytest.approx(WIDTH)
    assert {(*row,) for row in mine[["lane_index", "lane_count"]].to_numpy()} == {(0.0, 2.0)}
    assert found.loc["8", "lane_index"].to_numpy() == pytest.approx(1.0)
    assert mine["left_distance"].to_numpy() == pytest.approx(10.0 - 4.6, abs=1e-6)  # usual lengths: it says none
    assert mine["speed"].to_numpy() == pytest.approx(SPEED, abs=0.01)  # from positions


@pytest.mark.parametrize("says", [True, False])
def test_a_lane_that_says_nothing_of_its_direction(tmp_path, says: bool) -> None:
    """Is driven against its centre line where another one says that it is driven along; else along it."""
    made = drives(lambda message: physical(message, ahead=not says))
    for message in made:
        for lane in message.lane:
            lane.classification.ClearField("centerline_is_driving_direction")
        if says:
            other = message.lane.add()
            other.id.value = 900
            other.classification.centerline_is_driving_direction = True
    found = import_drives("osi", saved(tmp_path / "trace.mcap", made)).to_frame().set_index("drive")
    assert found.loc["7", "offset"].to_numpy() == pytest.approx(sway(found.loc["7", "time"].to_numpy()), abs=1e-9)


def test_lane_changes_are_cut(tmp_path) -> None:
    time = np.arange(0.0, 40.0, 0.05)
    aside = WIDTH / (1.0 + np.exp(-(time - 20.0)))
    made = [physical(truth(t, {7: (SPEED * t, 0.5 * WIDTH + y)})) for t, y in zip(time.tolist(), aside, strict=True)]
    found = import_drives("osi", saved(tmp_path / "trace.mcap", made), keep_cut=True).to_frame()
    assert found["state"][(time > 18.0) & (time < 22.0)].eq("lane change").all()
    assert found["state"][(time > 4.0) & (time < 12.0)].eq("kept").all()


def test_stamps_twice_and_leaping_identifiers_are_noted(tmp_path) -> None:
    made = drives()
    made.insert(100, made[99])
    for message in made[201:]:
        message.moving_object[1].base.position.x += 300.0
        message.moving_object[1].base.velocity.x = SPEED
    for message in made[:201]:
        message.moving_object[1].base.velocity.x = SPEED
    made[5].moving_object.add(type=3).id.value = 9  # a pedestrian
    for number, message in enumerate(made):
        message.host_vehicle_id.value = 7 if number < 50 else 8
    result = import_drives("osi", saved(tmp_path / "trace.mcap", made))
    assert set(result.to_frame()["drive"]) == {"7", "8", "8#2"}
    notes = result.to_dict()["notes"]
    assert any("2 rows left out: repeated time" in note for note in notes)
    assert any("leaps of a vehicle" in note for note in notes)
    assert any("1 moving objects of type pedestrian" in note for note in notes)
    assert any("several host vehicles: 7, 8" in note for note in notes)
    assert "note: several host vehicles" in str(result)


def test_of_several_channels_the_true_one_is_read_and_the_others_are_named(tmp_path) -> None:
    path = tmp_path / "trace.mcap"
    with osi_utilities.MultiTraceWriter() as writer:
        assert writer.open(path)
        writer.add_channel("view", osi3.SensorView)
        writer.add_channel("truth", type(truth(0.0, {})))
        for message in drives():
            view = osi3.SensorView()
            view.timestamp.CopyFrom(message.timestamp)
            writer.write_message(view, "view")
            writer.write_message(message, "truth")
    (note,) = import_drives("osi", path).to_dict()["notes"]
    assert note == "trace.mcap: read channel truth of view (SENSOR_VIEW), truth (GROUND_TRUTH)"
    with pytest.raises(Exception, match=r"a sensor view named .other.; there are: view"):
        import_drives("osi", path, channel="other")


def _without_position(made: list[Any]) -> list[Any]:
    made[3].moving_object[0].base.ClearField("position")
    return made


def _not_a_number(made: list[Any]) -> list[Any]:
    made[3].moving_object[0].base.position.x = float("nan")
    return made


def _without_time(made: list[Any]) -> list[Any]:
    made[2].ClearField("timestamp")
    return made


def _elsewhere(made: list[Any]) -> list[Any]:
    for message in made:
        for one in message.moving_object:
            one.base.position.y += 50.0
    return made


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_without_position, "message 4: moving object 7: has no position"),
        (_not_a_number, "message 4: moving object 7: x nan"),
        (_without_time, "message 3: has no timestamp"),
        (_elsewhere, "no row lies in a driving lane of the trace: x from 0.0"),
        (lambda made: made[:1], "no vehicle has two rows"),
        (lambda made: drives(lambda message: message), "has no lanes with boundaries: give the road with --road"),
    ],
)
def test_bad_traces_are_refused_in_one_line(tmp_path, capsys, change, said: str) -> None:
    path = saved(tmp_path / "trace_gt.osi", change(drives()))
    assert main(["import", "osi", str(path), "-o", str(tmp_path / "out.csv")]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert "trace_gt.osi" in error


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("trace.mcap", b"", "is empty"),
        ("trace.mcap", b"not an mcap file at all, is it", "not an MCAP file"),
        ("trace_gt.osi", b"\x10\0\0\0abc", "message 1: damaged: Truncated message body"),
        ("trace_gt.osi", b"\xff\xff\xff\xff", "message 1: damaged: Message size 4294967295 exceeds"),
        ("trace_sd.osi", b"\x10\0\0\0abc", "its name says SENSOR_DATA"),
        ("trace.txt", b"x", "an OSI trace ends in .mcap, .osi"),
    ],
)
def test_files_that_are_no_traces_are_refused_in_one_line(tmp_path, capsys, name, data, said) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    assert main(["import", "osi", str(path), "-o", str(tmp_path / "out.csv")]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_trace_that_was_cut_off_is_refused(trace: Path, capsys, tmp_path: Path) -> None:
    trace.write_bytes(trace.read_bytes()[:-2000])
    assert main(["import", "osi", str(trace), "-o", str(tmp_path / "out.csv")]) == 1
    error = capsys.readouterr().err
    assert "trace.mcap" in error
    assert error.count("\n") == 1


# ---- omega-prime's Parquet -------------------------------------------------------------------------------------------
def omega_prime(trace: Path, path: Path, *, road: Path | None = None, leave_out: str = "") -> Path:
    """What omega-prime's `to_parquet` makes of a trace: rows, and the lanes or the road in the metadata."""
    read, rows = messages(trace), []
    for message in read:
        for thing in message.moving_object:
            row = {"total_nanos": message.timestamp.seconds * NANOSECONDS + message.timestamp.nanos}
            row |= {"idx": thing.id.value, "type": thing.type, "role": -1, "subtype": thing.vehicle_classification.type}
            for part, names in PLACES.items():
                vector = getattr(thing.base, part)
                fields = names if part in ("orientation", "dimension") else ("x", "y", "z")
                row |= {name: getattr(vector, one) for name, one in zip(names, fields, strict=True)}
            rows.append({name: value for name, value in row.items() if name != leave_out})
    about = {b"host_vehicle_idx": b"1"}
    if road is None:
        about[b"osi"] = MessageToJson(read[0]).encode()
    else:
        about |= {b"xodr": road.read_bytes(), b"xodr_name": b"road"}
    table = pa.Table.from_pylist(rows)
    pq.write_table(table.replace_schema_metadata(about), path)
    return path


@pytest.mark.parametrize("as_opendrive", [False, True])
def test_a_recording_of_omega_prime_gives_what_the_trace_gives(trace: Path, tmp_path: Path, as_opendrive: bool) -> None:
    road = trace.with_name("two_roads_RHT.xodr") if as_opendrive else None
    path = omega_prime(trace, tmp_path / "recording.parquet", road=road)
    found = import_drives("osi", path, host="host").to_frame()
    whole = import_drives("osi", trace, host="Ego").to_frame()
    rows = found.merge(whole, on="time", suffixes=("", "_trace"))
    assert len(rows) > 0.99 * len(whole)
    # its rows don't say where the rear axle is: the offset is that of the middle, 1.4 m ahead, 1.4^2 / (2 R) outside
    assert rows["offset"].to_numpy() == pytest.approx(sway(rows["time"].to_numpy()), abs=3e-3)
    for name in ("lane_width", "lane_index", "lane_count", "lead_is_truck"):
        assert rows[name].to_numpy() == pytest.approx(rows[f"{name}_trace"].to_numpy(), abs=1e-3)
    # by the road, gaps in the arc count along its reference line, 1.75 m inside: 50 m are 0.2 m less
    assert rows["lead_distance"].to_numpy() == pytest.approx(rows["lead_distance_trace"].to_numpy(), abs=0.25)


def test_parquet_that_is_no_recording_is_refused(trace: Path, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"a\.parquet: no column 'yaw': not a recording of omega-prime"):
        import_drives("osi", omega_prime(trace, tmp_path / "a.parquet", leave_out="yaw"))
    (tmp_path / "b.parquet").write_bytes(b"PAR1 and then nothing")
    with pytest.raises(FormatError, match=r"b\.parquet: can't be read as a table"):
        import_drives("osi", tmp_path / "b.parquet")


@pytest.mark.parametrize("states", [True, False])
def test_a_chunk_that_unpacks_without_bound_is_refused(states: bool, tmp_path: Path) -> None:
    """Also where the size stands in the packed frame alone."""
    writer_module = pytest.importorskip("mcap.writer", reason="extra `osi` is not installed")
    path = tmp_path / "bomb_gt.mcap"
    with path.open("wb") as file:
        writer = writer_module.Writer(file, chunk_size=10**10, compression=writer_module.CompressionType.ZSTD)
        writer.start("osi2mcap", "")
        channel = writer.register_channel("gt", "protobuf", writer.register_schema("osi3.GroundTruth", "protobuf", b""))
        writer.add_message(channel, 0, bytes(150_000_000), 0)
        writer.finish()
    data = path.read_bytes()
    size = (150_000_000).to_bytes(4, "little")[1:]
    where = next(k for k in range(len(data)) if data[k + 1 : k + 4] == size)
    if not states:  # a chunk that says it has 4 kB
        path.write_bytes(data[:where] + (4096).to_bytes(8, "little") + data[where + 8 :])
    with pytest.raises(FormatError, match="decompression bomb"):
        import_drives("osi", path)


def test_a_recording_of_omega_prime_that_unpacks_without_bound_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.parquet"
    pq.write_table(pa.table({name: pa.array(np.zeros(3_000_000)) for name in ROW_COLUMNS}), path, compression="zstd")
    with pytest.raises(FormatError, match="decompression bomb"):
        import_drives("osi", path)
