"""Raw rows into clean ones: order, gaps, signs, and units that can't be meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.drives.cleaning import RUN, clean_drive
from xosc_lateral.drivers.drives.drive import Drive

TABLE = Path("table.csv")


def clean(levels: frozenset[str] = frozenset(), **columns: object) -> Drive | None:
    n = len(np.asarray(next(iter(columns.values()))))
    given = {"time": 0.1 * np.arange(n), **columns}
    return clean_drive(
        "d", {name: np.asarray(values, dtype=np.float64) for name, values in given.items()}, levels, TABLE
    )


def cleaned(levels: frozenset[str] = frozenset(), **columns: object) -> Drive:
    drive = clean(levels, **columns)
    assert drive is not None
    return drive


def test_far_from_the_right_marking_is_left_of_the_centre() -> None:
    drive = cleaned(distance_left=[1.0, 1.75, 2.5], distance_right=[2.5, 1.75, 1.0])
    np.testing.assert_allclose(drive.offset, [0.75, 0.0, -0.75])
    np.testing.assert_allclose(drive.lane_width, 3.5)


@given(st.permutations(range(20)))
def test_the_order_of_rows_does_not_matter(order: list[int]) -> None:
    time, offset = 0.1 * np.arange(20.0), 0.01 * np.arange(20.0)
    shuffled = cleaned(time=time[order], offset=offset[order], lane_width=np.full(20, 3.5))
    np.testing.assert_array_equal(shuffled.time, time)
    np.testing.assert_array_equal(shuffled.offset, offset)


def test_the_first_row_of_a_time_is_kept() -> None:
    drive = cleaned(time=[0.0, 0.1, 0.1, 0.2], offset=[0.0, 0.1, 0.11, 0.2], lane_width=[3.5] * 4)
    np.testing.assert_allclose(drive.offset, [0.0, 0.1, 0.2])


def test_rows_without_a_place_a_speed_or_a_time_are_left_out() -> None:
    drive = cleaned(
        time=[0.0, 0.1, np.nan, 0.3, 0.4, 0.5],
        offset=[0.0, np.nan, 0.2, 0.3, 0.4, 0.5],
        lane_width=[3.5, 3.5, 3.5, np.nan, 3.5, 3.5],
        speed=[30.0, 30.0, 30.0, 30.0, np.nan, 30.0],
    )
    np.testing.assert_allclose(drive.time, [0.0, 0.5])


def test_a_glitch_beyond_a_whole_lane_is_left_out_and_an_offset_at_the_marking_stays() -> None:
    offset = np.full(100, 0.1)
    offset[50], offset[60] = 9.0, -3.4
    drive = cleaned(offset=offset, lane_width=np.full(100, 3.5))
    assert len(drive.offset) == 99
    assert drive.offset.min() == -3.4


def test_context_keeps_its_gaps_and_columns_of_nothing_go() -> None:
    lead = [50.0, np.nan, 40.0]
    drive = cleaned(
        frozenset({"lane_index"}),
        offset=[0.0, 0.1, 0.2],
        lane_width=[3.5] * 3,
        lead=lead,
        nothing=[np.nan] * 3,
        lane_index=[1, 1, 0],
    )
    np.testing.assert_array_equal(drive.context["lead"], lead)
    assert set(drive.context) == {"lead", "lane_width", "lane_index"}
    assert drive.levels == {"lane_index"}


def test_what_an_import_has_cut_is_not_taken_back() -> None:
    drive = cleaned(**{"offset": [0.0] * 5, "lane_width": [3.5] * 5, RUN: [0, 0, -1, np.nan, 1]})
    np.testing.assert_allclose(drive.time, [0.0, 0.1, 0.4])
    assert drive.run is not None
    assert drive.run.tolist() == [0, 0, 1]
    assert RUN not in drive.context


@pytest.mark.parametrize("offset", [[np.nan] * 5, [0.0, np.nan, np.nan, np.nan, np.nan]])
def test_a_drive_of_nothing_is_none(offset: list[float]) -> None:
    assert clean(offset=offset, lane_width=[3.5] * 5) is None


LANES = {"offset": [0.0] * 9, "lane_width": [3.5] * 9}


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"lane_width": [350.0] * 9}, r"the lane is 350 m wide \(median\).*lane_width=COLUMN:cm"),
        ({"lane_width": [0.5] * 9}, r"the lane is 0\.5 m wide"),
        ({"offset": [30.0] * 9}, r"offsets of up to 30 m in a lane of 3\.5 m, 100 % of the rows"),
        ({"time": np.arange(9.0)}, r"rows are 1 s apart .*time=COLUMN:ms"),
    ],
)
def test_units_that_cannot_be_meant_are_refused_with_the_number_that_shows_it(
    columns: dict[str, object], message: str
) -> None:
    with pytest.raises(FormatError, match=message) as refused:
        clean(**LANES | columns)
    assert str(refused.value).startswith("table.csv")


def test_several_drives_in_one_are_told_by_times_that_contradict_each_other() -> None:
    with pytest.raises(FormatError, match="38 of 40 rows repeat a time with another offset"):
        clean(time=[0.0, 0.1] * 20, offset=[0.0, 0.0, 0.9, 0.9] * 10, lane_width=[3.5] * 40)


def test_a_short_gap_of_a_level_is_filled_from_the_nearer_row() -> None:
    """Rows of a bus in which each channel comes in rows of its own; exact halves belong to the row before."""
    place = np.arange(40) % 4 == 0
    lane = np.where(np.arange(40) % 8 == 2, np.arange(40.0) // 8, np.nan)
    drive = cleaned(
        frozenset({"lane_index"}), time=0.05 * np.arange(40), offset=np.where(place, 0.1, np.nan),
        lane_width=np.where(place, 3.5, np.nan), lane_index=lane,
    )  # fmt: skip
    # Known at rows 2, 10, 18, ...; asked at rows 4, 8, 12, ...
    np.testing.assert_array_equal(drive.context["lane_index"][1:9], [0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0])
