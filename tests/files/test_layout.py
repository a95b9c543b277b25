"""Tables as tools write them: what stands before, between and below the header; frames of other libraries."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest

from xosc_lateral import XoscLateralError
from xosc_lateral.base.vehicle_classes import class_of
from xosc_lateral.files.drives import read_drives
from xosc_lateral.workflows.result import given_drives

TIME = 0.1 * np.arange(400)
TABLE = pd.DataFrame({"time": TIME, "offset": 0.3 * np.sin(TIME), "lane_width": 3.75, "speed": 30.0}).round(3)
COMMAS = {"sep": ";", "decimal": ",", "index": False}


def _text(**changes: object) -> str:
    return TABLE.assign(**changes).to_csv(index=False)


LAYOUTS = {
    "Excel": "sep=;\n" + TABLE.to_csv(**COMMAS),
    "units below": _text(speed=108.0).replace("\n", "\ns,m,m,km/h\n", 1),
    "comments": "# a logger, version 2\n# made, yesterday\n" + _text(),
    "header in a comment": "# a logger\n# " + _text(),
    "comments below": _text().replace("\n", "\n# restarted\n", 3),
    "preamble": "CANape export\nDate;28.11.2026\n\ntime;offset;lane_width;speed\ns;m;m;m/s\n"
    + TABLE.to_csv(**COMMAS, header=False),
    "descriptions": "time,offset,lane_width,speed\nclock,place,width of lane,of vehicle\ns,m,m,m/s\n"
    + TABLE.to_csv(index=False, header=False),
    "units in headers": _text(speed=108.0).replace("speed", "Speed [km/h]").replace("time,", "time_s,"),
    "epoch in us": _text(time=1.7e15 + 1e5 * np.arange(400)),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_table_comes_in_right_however_a_tool_lays_it_out(layout: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(LAYOUTS[layout], encoding="utf-8")
    (drive,) = read_drives(path)
    assert len(drive) == 400
    assert drive.time - drive.time[0] == pytest.approx(TIME, abs=1e-5)
    assert drive.offset == pytest.approx(TABLE["offset"].to_numpy())
    assert drive.context["speed"] == pytest.approx(30.0)


def test_packed_tables_and_tables_in_parts(tmp_path: Path) -> None:
    with pa.CompressedOutputStream(str(tmp_path / "a.csv.zst"), "zstd") as packed:
        packed.write(_text().encode())
    feather.write_feather(TABLE, str(tmp_path / "a.feather"))
    for number, part in enumerate((TABLE[:200], TABLE[200:])):
        (tmp_path / f"parts/drive={number}").mkdir(parents=True)
        pq.write_table(pa.Table.from_pandas(part, preserve_index=False), tmp_path / f"parts/drive={number}/0.parquet")
    assert [len(drive) for drive in read_drives([tmp_path / "a.csv.zst", tmp_path / "a.feather"])] == [400, 400]
    assert [(drive.name, len(drive)) for drive in read_drives(tmp_path / "parts")] == [("0", 200), ("1", 200)]
    assert len(given_drives(tmp_path / "parts").inputs["parts"]) == 64


ZEROS, LONG = np.zeros(6_000_000), pa.array(["x" * 1_000_000])
BOMBS = {
    "zeros.feather": pa.table(dict.fromkeys(TABLE, ZEROS)),
    "one text.parquet": pa.table({"note": pa.DictionaryArray.from_arrays(np.zeros(3000, np.int32), LONG)}),
    "one text.arrow": pa.table({"note": pa.DictionaryArray.from_arrays(np.zeros(3000, np.int32), LONG)}),
    "views.arrow": pa.table({"note": pa.array(["x" * 1000] * 3000, pa.string_view())}),
    "nulls.feather": pa.table({"note": pa.nulls(200_000_000)}),
}


@pytest.mark.parametrize("name", BOMBS)
@pytest.mark.parametrize("is_held", [False, True])
def test_cells_count_as_they_are_in_memory(name: str, is_held: bool, tmp_path: Path) -> None:
    path = tmp_path / name
    if path.suffix == ".parquet":
        pq.write_table(BOMBS[name], path, compression="zstd")
    else:
        feather.write_feather(BOMBS[name], str(path), compression="zstd", chunksize=10**9)
    assert path.stat().st_size < 2_000_000
    with pytest.raises(XoscLateralError, match=r"unpacked bytes per byte|memory|of this kind are not read"):
        given_drives(path.read_bytes() if is_held else path)


@pytest.mark.parametrize("write", [TABLE.to_parquet, TABLE.to_feather])
def test_bytes_in_memory_are_a_table_as_in_a_file(write: Callable[[io.BytesIO], None]) -> None:
    held = io.BytesIO()
    write(held)
    assert [len(drive) for drive in given_drives(held.getvalue()).drives] == [400]


@pytest.mark.parametrize("kind", ["arrow", "dict", "times in the index", "lazy"])
def test_whatever_holds_columns_is_a_table(kind: str) -> None:
    class Lazy:
        def compute(self) -> pd.DataFrame:
            return TABLE

    given = {
        "arrow": pa.Table.from_pandas(TABLE),
        "dict": {name: column.to_numpy() for name, column in TABLE.items()},
        "times in the index": TABLE.drop(columns="time").set_index(pd.to_datetime(TABLE["time"], unit="s")),
        "lazy": Lazy(),
    }[kind]
    (drive,) = given_drives(given).drives  # type: ignore[arg-type]
    assert drive.time == pytest.approx(TIME) and drive.offset == pytest.approx(TABLE["offset"].to_numpy())


def test_drives_whose_clock_begins_again_are_two(tmp_path: Path) -> None:
    path = tmp_path / "joined.csv"
    pd.concat([TABLE, TABLE.assign(offset=-0.4)]).to_csv(path, index=False)
    assert [(drive.name, len(drive)) for drive in read_drives(path)] == [("joined", 400), ("joined#2", 400)]
    pd.concat([TABLE.assign(recording_id=k, drive="d") for k in (1, 2)]).sort_values("time").to_csv(path, index=False)
    assert {drive.name for drive in read_drives(path)} == {"1:d", "2:d"}
    TABLE.sample(frac=1.0, random_state=1).to_csv(path, index=False)
    assert [len(drive) for drive in read_drives(path)] == [400]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"distance_left": 1.8 - TABLE["offset"], "distance_right": 1.8 - TABLE["offset"]}, "one counts the other way"),
        ({"front_distance": np.where(np.arange(400) % 10 < 8, 255, 40 + np.arange(400) % 7)}, r"missing = \[255\]"),
        ({"speed [furlong/s]": 30.0}, "unknown unit"),
    ],
)
def test_what_contradicts_itself_is_asked_about(columns: dict[str, object], message: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    made = TABLE.drop(columns="offset" if "distance_left" in columns else "speed").assign(**columns)
    made.to_csv(path, index=False)
    with pytest.raises(XoscLateralError, match=message):
        read_drives(path)


def test_words_of_data_sets_have_their_class() -> None:
    words = {
        "truck": "Heavy Vehicle,TYPE_HEAVY_TRUCK,LKW,truck_bus,large_vehicle,Medium Vehicle,vehicle.truck,HGV,lorry",
        "car": "Car,PKW,small-vehicle,passenger,OTHERS,parkedVehicle,vehicle.car,TYPE_MEDIUM_CAR,Taxi",
        "pedestrian": "Pedestrian,pedestrian/bicycle,human.pedestrian.adult,person,TYPE_PEDESTRIAN",
        "bicycle": "Cyclist,TYPE_CYCLIST,riderless_bicycle,Fahrrad",
        "motorcycle": "motorcyclist,Motorrad,moped,vehicle.motorcycle",
        "bus": "Bus,vehicle.bus.bendy,coach,Bus (articulated)",
        "van": "Van,DELIVERY_VAN,Lieferwagen",
    }
    assert {word: class_of(word) for every in words.values() for word in every.split(",")} == {
        word: name for name, every in words.items() for word in every.split(",")
    }
    assert class_of("Zeppelin") is None and class_of("nan") == ""
