"""Small recordings that came out wrong: each is read right, or refused with the cure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="needs ../shared/cases")


@pytest.mark.parametrize(("name", "columns", "words"), [
    ("offset_positive_right", {}, "positive to the right"),
    ("offset_in_feet", {}, r"in ft, offset=COLUMN:ft"),
    ("offset_in_feet", {"offset": "offset:ft"}, None),
    ("header_unit_mapped", {"speed": "v [km/h]"}, None),
    ("../fit/speed_neg", {}, r"speed=COLUMN:-m/s"),
    ("../fit/dist_cm", {}, r"distance_left=COLUMN:cm"),
    ("../fit/check_speed_kmh_with_following_run", {}, r"speed=COLUMN:km/h"),
    ("../fit/check_car_left_flag", {}, None),
])  # fmt: skip
def test_a_table_of_drives_is_read_right_or_refused_with_the_cure(name: str, columns: dict, words: str | None) -> None:
    path = CASES / "recordings" / f"{name}.csv.gz"
    if words is not None:
        with pytest.raises(FormatError, match=words):
            xl.read_drives(path, columns)
        return
    for drive in xl.read_drives(path, columns):
        assert 10.0 < np.median(drive.speed) < 60.0 and np.abs(drive.offset).max() < 2.0


def test_two_vehicles_in_order_of_time_are_two_drives() -> None:
    first, second = xl.read_drives(CASES / "recordings" / "two_vins_by_time.csv.gz")
    assert first.offset.mean() * second.offset.mean() < 0.0 and first.offset.mean() == pytest.approx(-0.32, abs=0.1)


@pytest.mark.parametrize(("name", "words"), [
    ("km", r"x=COLUMN:km"), ("frames_no_speed", r"frames \(time=COLUMN:1/25 s\)"),
])  # fmt: skip
def test_tracks_in_another_unit_are_refused_with_the_cure(name: str, words: str) -> None:
    path, road = CASES / "recordings" / f"{name}.csv.gz", CASES / "recordings" / "road_evidence.xodr"
    for call in (xl.reconstruct, lambda path, road: xl.import_drives("tracks", path, road=road)):
        with pytest.raises(FormatError, match=words):
            call(path, road=road)


@pytest.mark.parametrize(("name", "words"), [("shifted_1m", "shifted against one another"), ("twice", "twice")])
def test_tracks_that_contradict_their_map_or_each_other_are_named(name: str, words: str) -> None:
    path, road = CASES / "recordings" / f"{name}.csv.gz", CASES / "recordings" / "road_evidence.xodr"
    assert any(words in line for line in xl.reconstruct(path, road=road).notes)
    assert any(words in line for line in xl.import_drives("tracks", path, road=road).notes)
    assert any(words in line for line in xl.detect(path, road=road, detectors="lateral-speed").notes)


def test_hours_are_counted_in_seconds_where_rates_differ() -> None:
    road = CASES / "recordings" / "road_evidence.xodr"
    rows = pd.read_csv(CASES / "recordings" / "two_rates.csv.gz")
    at_5_hz = rows[(rows["time"] * 5.0 + 1e-6) % 1.0 < 1e-3]
    both, even = (xl.import_drives("tracks", one, road=road).provenance.hours for one in (rows, at_5_hz))
    assert both == pytest.approx(even, rel=0.03)


def test_a_flag_is_not_taken_for_a_distance() -> None:
    health = xl.check(CASES / "fit" / "check_car_left_flag.csv.gz")
    assert "car_left" not in {row["in the table"] for row in health.columns}
