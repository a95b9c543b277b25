"""Local stamps over the end of summer time, zones, and steps that no recording has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.drives.evidence import of_clock
from xosc_lateral.files.columns import seconds_of_stamps
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.mapping import read_mapping

PATH = Path("table.csv")
SECONDS = np.arange(0.0, 4000.0, 10.0)


def local(begin: str, zone: str = "Europe/Berlin", seconds: np.ndarray = SECONDS) -> pd.Series:
    stamps = (pd.Timestamp(begin) + pd.to_timedelta(seconds, "s")).tz_convert(zone)
    return pd.Series(stamps.strftime("%Y-%m-%d %H:%M:%S.%f"))


@pytest.mark.parametrize(("begin", "zone"), [
    ("2026-10-25T00:30Z", "Europe/Berlin"), ("2026-11-01T05:30Z", "America/New_York"),
    ("2026-04-04T14:40Z", "Australia/Lord_Howe"),
])  # fmt: skip
def test_an_hour_that_comes_twice_is_told_apart_by_the_zone_and_refused_without(begin: str, zone: str) -> None:
    stamps = local(begin, zone)
    found = seconds_of_stamps(stamps, PATH, zone)
    np.testing.assert_allclose(found, SECONDS)
    with pytest.raises(FormatError, match=r"end of summer time.*time_zone"):
        seconds_of_stamps(stamps, PATH)
    with pytest.raises(FormatError, match="end of summer time"):
        seconds_of_stamps(pd.to_datetime(stamps), PATH)  # as Parquet has them
    clock = stamps.str[11:19]
    with pytest.raises(FormatError, match="clock times have no zone"):
        seconds_of_stamps(clock, PATH)


def test_every_drive_has_a_clock_of_its_own() -> None:
    two = pd.concat([local("2026-10-25T00:30Z"), local("2026-10-25T00:45Z")], ignore_index=True)
    drives = pd.Series(np.repeat(["a", "b"], len(SECONDS)))
    found = seconds_of_stamps(two, PATH, "Europe/Berlin", drives)
    np.testing.assert_allclose(found, np.r_[SECONDS, SECONDS + 900.0])
    late = pd.Series(["23:59:50", "23:59:58", "00:00:06", "22:00:00", "22:00:10"])
    found = seconds_of_stamps(late, PATH, "", pd.Series(list("aaabb")))
    assert found.tolist() == [86390.0, 86398.0, 86406.0, 79200.0, 79210.0]


def test_the_other_way_round_and_a_table_in_no_order_are_read() -> None:
    spring = local("2026-03-29T00:30Z")
    np.testing.assert_allclose(seconds_of_stamps(spring, PATH, "Europe/Berlin"), SECONDS)
    mixed = local("2026-06-01T10:00Z").sample(frac=1.0, random_state=1).reset_index(drop=True)
    assert np.sort(seconds_of_stamps(mixed, PATH)) == pytest.approx(SECONDS)
    with pytest.raises(FormatError, match="time_zone 'Berlin'"):
        seconds_of_stamps(spring, PATH, "Berlin")
    with pytest.raises(FormatError, match="time_zone 'Europe/Berlin'"):
        seconds_of_stamps(pd.Series(["2026-03-29 02:30:00", "2026-03-29 02:30:01"]), PATH, "Europe/Berlin")


@pytest.mark.parametrize("step", [1e-5, 40.0, 4e7])
def test_steps_that_no_recording_has_are_refused(step: float) -> None:
    assert "the clock may be in" in (of_clock(step * np.arange(500.0)) or "")
    assert of_clock(0.04 * np.arange(500.0)) is None


def table(folder: Path, **columns: object) -> Path:
    time = np.arange(0.0, 60.0, 0.04)
    path = folder / "d.csv"
    rows = {"time": time, "offset": 0.1 * np.sin(time), "lane_width": 3.5, "speed": 30.0}
    pd.DataFrame(rows | columns).to_csv(path, index=False)
    return path


def test_rows_markers_and_drivers_by_the_mapping(tmp_path: Path) -> None:
    n = 1500
    number = np.arange(n)
    path = table(
        tmp_path, quality=np.where(number < 500, 1, 3), lane_change=np.where(number >= 1400, "yes", "no"),
        wind=np.where(number % 9 == 0, -999.0, 4.0 + number % 5), driver="anna",
    )  # fmt: skip
    with pytest.raises(FormatError, match=r"column 'wind': -999 in 167 rows.*missing = \[-999\]"):
        read_drives(path)
    mapping = tmp_path / "m.toml"
    mapping.write_text('missing = [-999]\nrows = ["quality >= 2", "lane_change == no"]')
    (drive,) = read_drives(path, mapping)
    assert drive.driver == "anna" and not any("driver" in name for name in drive.context)
    assert drive.time[0] == pytest.approx(20.0) and drive.time[-1] == pytest.approx(55.96)
    assert np.nanmin(drive.context["wind"]) == 4.0 and np.isnan(drive.context["wind"]).mean() == pytest.approx(
        1 / 9, abs=0.01
    )
    mapping.write_text("missing = []")
    assert read_drives(path, mapping)[0].context["wind"].min() == -999.0
    for text, words in (('rows = ["quality"]', "quality >= 2"), ('rows = ["q > 1"]', "no column 'q'"),
                        ('rows = ["quality > 9"]\nmissing = []', "no row has quality > 9"),
                        ('reference = "nose"', "nose"), ("missing = [[1]]", "missing")):  # fmt: skip
        mapping.write_text(text if "missing" in text else text + "\nmissing = []")
        with pytest.raises(FormatError, match=words):
            read_drives(path, read_mapping(mapping))
