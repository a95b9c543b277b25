"""Drive tables in."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.mapping import parse_map


def table(seconds: float = 30.0, rate: float = 20.0) -> pd.DataFrame:
    time = np.arange(0.0, seconds, 1.0 / rate)
    offset = 0.2 * np.sin(time / 3)
    return pd.DataFrame(
        {
            "time": time,
            "distance_left": 1.75 - offset,
            "distance_right": 1.75 + offset,
            "speed": 30.0,
            "lane_index": 1,
            "lead_distance": np.where(time < 10, np.nan, 50.0 + time),
            "note": "x",
        }
    )


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_all_formats_give_the_same_drive(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"mine{suffix}"
    made = table()
    made.to_parquet(path) if suffix == ".parquet" else made.to_csv(path, index=False)
    (drive,) = read_drives(path)
    assert drive.name == "mine"
    assert np.allclose(drive.offset, 0.2 * np.sin(made.time / 3))  # far from the right marking: to the left
    assert np.allclose(drive.lane_width, 3.5)
    assert set(drive.context) == {"speed", "lane_index", "lead_distance", "lane_width"}
    assert drive.levels == {"lane_index"}
    assert np.isnan(drive.context["lead_distance"][:100]).all()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_column_that_is_empty_all_through_a_drive_is_told_from_one_that_the_table_lacks(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"mine{suffix}"
    made = pd.concat([table().assign(drive=name) for name in ("alone", "followed")])
    made.loc[made["drive"] == "alone", "lead_distance"] = np.nan
    made = made.assign(rain=np.nan, left_distance=None)
    made.to_parquet(path) if suffix == ".parquet" else made.to_csv(path, index=False)
    alone, followed = read_drives(path)
    assert alone.empty == {"lead_distance", "rain", "left_distance"} and followed.empty == {"rain", "left_distance"}
    assert not alone.empty & alone.context.keys()
    assert [run.empty for run in all_runs([alone, followed])] == [alone.empty, followed.empty]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_infinite_distance_is_nobody_within_reach_and_no_other_column_may_be_infinite(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"mine{suffix}"
    made = table().assign(rain=lambda t: np.where(t.time < 10, np.inf, 1.0))
    made["lead_distance"] = np.where(made.time < 10, np.inf, np.where(made.time < 20, -np.inf, 50.0))
    made.to_parquet(path) if suffix == ".parquet" else made.to_csv(path, index=False)
    (drive,) = read_drives(path)
    lead = drive.context["lead_distance"]
    assert np.isposinf(lead[:200]).all() and np.isnan(lead[200:400]).all() and (lead[400:] == 50.0).all()
    assert np.isnan(drive.context["rain"][:200]).all()
    (run,) = all_runs([drive])
    assert np.isposinf(run.context["lead_distance"][10:40]).all()


@pytest.mark.parametrize("separator", [";", "\t"])
def test_other_separators_and_a_byte_order_mark_are_read(tmp_path: Path, separator: str) -> None:
    path = tmp_path / "mine.csv"
    path.write_text(table().to_csv(index=False, sep=separator), encoding="utf-8-sig")
    assert len(read_drives(path)[0]) == 600


def test_unsorted_repeated_and_missing_rows_are_put_right(tmp_path: Path) -> None:
    made = table()
    mixed = pd.concat([made, made.iloc[100:110]]).sample(frac=1.0, random_state=0)
    mixed.loc[mixed.time.between(5.0, 5.2), "distance_left"] = np.nan
    path = tmp_path / "mixed.parquet"
    mixed.to_parquet(path)
    (drive,) = read_drives(path)
    assert (np.diff(drive.time) > 0).all()
    assert len(drive) == 600 - made.time.between(5.0, 5.2).sum()
    (run,) = all_runs([drive])  # the hole is short: bridged
    assert np.abs(run.offset - 0.2 * np.sin(run.time / 3)).max() < 1e-3


def test_a_glitch_is_a_gap(tmp_path: Path) -> None:
    made = table()
    made.loc[300:302, "distance_left"] = 40.0
    path = tmp_path / "glitch.parquet"
    made.to_parquet(path)
    assert len(read_drives(path)[0]) == 597


def test_several_drives_stay_apart(tmp_path: Path) -> None:
    made = pd.concat([table().assign(drive=7), table(20.0).assign(drive=3)])
    path = tmp_path / "two.csv"
    made.to_csv(path, index=False)
    drives = read_drives(path)
    assert [(drive.name, len(drive)) for drive in drives] == [("7", 600), ("3", 400)]


def test_drives_of_one_name_in_two_files_are_told_apart(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        table().to_parquet(tmp_path / folder / "d.parquet")
    names = {drive.name for drive in read_drives([tmp_path / "a" / "d.parquet", tmp_path / "b" / "d.parquet"])}
    assert len(names) == 2
    with pytest.raises(FormatError, match="named twice"):
        read_drives([tmp_path / "a" / "d.parquet"] * 2)


def test_foreign_headers_and_units_are_translated(tmp_path: Path) -> None:
    made = table()
    foreign = pd.DataFrame(
        {"t": made.time * 1000, "lat": -100 * (made.distance_right - 1.75), "w": 350.0, "v_kmh": 108.0, "yaw": 90.0}
    )
    path = tmp_path / "foreign.csv"
    foreign.to_csv(path, index=False)
    words = ["time=t:ms", "offset=lat:-cm", "lane_width=w:cm", "speed=v_kmh:km/h", "yaw_rate=yaw:deg/s"]
    (drive,) = read_drives(path, parse_map(words))
    assert np.allclose(drive.offset, 0.2 * np.sin(made.time / 3))
    assert np.allclose(drive.context["speed"], 30.0)
    assert np.allclose(drive.context["yaw_rate"], np.pi / 2)
    assert np.allclose(drive.time, made.time)


def test_time_stamps_count_from_the_first(tmp_path: Path) -> None:
    made = table()
    made["time"] = pd.Timestamp("2026-01-01") + pd.to_timedelta(made.time, unit="s")
    path = tmp_path / "stamps.parquet"
    made.to_parquet(path)
    assert read_drives(path)[0].time[-1] == pytest.approx(29.95)


def changed(**columns: object) -> pd.DataFrame:
    return table().assign(**columns)


BAD = {
    "offsets of 20 m": (
        changed(offset=20.0, lane_width=3.5),
        FormatError,
        r"offsets of up to 20 m in a lane of 3\.5 m, 100 % of the rows",
    ),
    "lane in cm": (changed(offset=0.0, lane_width=350.0), FormatError, r"lane is 350 m wide \(median\)"),
    "speed in km/h": (changed(speed=120.0), FormatError, r"is 120 m/s \(median\), more than 50; .*km/h"),
    "time in ms": (changed(time=table().time * 1000), FormatError, r"rows are 50 s apart \(median\).*:ms"),
    "too sparse": (table(rate=2.0), FormatError, r"rows are 0\.5 s apart"),
    "two drives in one": (
        pd.concat([table(), table().assign(distance_left=1.0, distance_right=2.5)]).sort_values("time"),
        FormatError,
        r"600 of 1200 rows repeat a time with another offset.*column 'drive'",
    ),
    "no time": (table().drop(columns="time"), FormatError, "no column 'time'; there are distance_left"),
    "one marking": (table().drop(columns="distance_left"), FormatError, "needs distance_left and distance_right, or"),
    "words": (changed(speed=["fast"] * 600), FormatError, r":2: column 'speed': 'fast' is not a number"),
    "empty": (table().iloc[:0], NotEnoughDataError, r"no rows; 10 s of driving are needed"),
    "all missing": (changed(distance_left=np.nan), NotEnoughDataError, "no drive has two rows"),
    "nameless drive": (changed(drive=["a"] * 599 + [None]), FormatError, ":601: column 'drive': no value"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_tables_are_refused_with_the_number_that_shows_it(tmp_path: Path, case: str) -> None:
    made, error, message = BAD[case]
    path = tmp_path / "bad.csv"
    made.to_csv(path, index=False)
    with pytest.raises(error, match=message) as caught:
        read_drives(path)
    assert "\n" not in str(caught.value)


def test_a_drive_too_short_is_refused_when_it_is_cut(tmp_path: Path) -> None:
    path = tmp_path / "short.parquet"
    table(6.0).to_parquet(path)
    with pytest.raises(NotEnoughDataError, match=r"no run of 10 s is left in 6\.0 s of driving|in 5\.9 s"):
        all_runs(read_drives(path))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("no.parquet", b"PAR1 nothing"),
        ("no.csv.gz", gzip.compress(b"time,offset\n1,2")[:15]),
        ("no.csv.gz", b"not gzip at all"),
        ("no.csv", b""),
        ("no.csv", b"\xff\xfe\x00\x01\x02"),
        ("no.csv", b'time,offset\n1,2\n3,4,5,6\n"'),
        ("no.txt", b"time,offset\n"),
    ],
    ids=["no parquet", "gzip cut short", "no gzip", "empty", "no text", "ragged rows", "unknown suffix"],
)
def test_files_that_are_no_tables_are_refused(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises((FormatError, NotEnoughDataError)) as caught:
        read_drives(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"nowhere\.parquet: no such file or folder"):
        read_drives(tmp_path / "nowhere.parquet")


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("speed", "expected NAME=COLUMN"),
        ("speed=v:parsec", "unknown unit 'parsec'"),
        ("speed=v:cm", "speed is held in m/s, cm measures length"),
    ],
)
def test_bad_maps_are_refused(word: str, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        parse_map([word])


def test_a_mapped_column_must_be_there(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    table().to_parquet(path)
    with pytest.raises(FormatError, match="no column 'v' for speed; there are time"):
        read_drives(path, parse_map(["speed=v"]))


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read(tmp_path: Path, separator: str) -> None:
    made = table().assign(range=np.linspace(1234.5, 2000.0, 600))
    path = tmp_path / "mine.csv"
    path.write_text(made.to_csv(index=False, sep=separator, decimal=","))
    (drive,) = read_drives(path)
    assert np.allclose(drive.offset, 0.2 * np.sin(made.time / 3))
    assert np.allclose(drive.context["range"], made["range"])
    path.write_text(path.read_text().replace("1234,5", "1.234,5"))
    assert read_drives(path)[0].context["range"][0] == pytest.approx(1234.5)


def test_decimal_commas_between_commas_are_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    path.write_text("time,offset,lane_width\n0,00,0,12,3,75\n0,04,0,13,3,75\n")
    with pytest.raises(FormatError, match=r"mine\.csv:2: 6 values under 3 headers; if numbers have a decimal comma"):
        read_drives(path)


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%f+01:00",
        "%Y-%m-%d %H:%M:%S.%f",
        "%d.%m.%Y %H:%M:%S,%f",
        "%m/%d/%Y %H:%M:%S.%f",
        "%H:%M:%S,%f",
    ],
    ids=["iso", "plain", "german", "american", "clock"],
)
def test_dates_and_clock_times_become_seconds(tmp_path: Path, form: str) -> None:
    made = table()
    stamps = pd.Timestamp("2026-11-07 23:59:50") + pd.to_timedelta(made.time, unit="s")  # past midnight, also by clock
    path = tmp_path / "mine.csv"
    path.write_text(made.assign(time=stamps.dt.strftime(form)).to_csv(index=False, sep=";"))
    (drive,) = read_drives(path)
    assert np.allclose(drive.time - drive.time[0], made.time - made.time[0], atol=1e-5)


def test_words_that_change_on_the_way_are_categories_and_names_are_not(tmp_path: Path) -> None:
    made = pd.concat([table().assign(drive=name, driver=name) for name in ("a", "b")])
    made["surface"] = np.where(made.time < 10, "dry", "wet")
    made.to_csv(tmp_path / "mine.csv", index=False)
    first, _ = read_drives(tmp_path / "mine.csv")
    assert {"surface=dry", "surface=wet"} <= first.levels
    assert not any("driver" in name for name in first.context)


def test_ids_that_begin_with_0_keep_it(tmp_path: Path) -> None:
    made = pd.concat([table().assign(drive_id=name) for name in ("007", "7", "070")])
    made.to_csv(tmp_path / "a.csv", index=False)
    assert [drive.name for drive in read_drives(tmp_path / "a.csv")] == ["007", "7", "070"]


def test_one_fast_car_among_others_is_no_wrong_unit_and_alone_says_its_own(tmp_path: Path) -> None:
    fast = table().assign(speed=54.0, drive="fast")
    others = [table().assign(drive=name) for name in "ab"]
    pd.concat([fast, *others]).to_csv(tmp_path / "a.csv", index=False)
    assert len(read_drives(tmp_path / "a.csv")) == 3
    fast.to_csv(tmp_path / "b.csv", index=False)
    with pytest.raises(FormatError, match="else speed=COLUMN:m/s"):
        read_drives(tmp_path / "b.csv")
    assert np.median(read_drives(tmp_path / "b.csv", parse_map(["speed=speed:m/s"]))[0].speed) == 54.0
