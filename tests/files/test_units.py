"""Units of columns, numbers and times in words, names in cells."""

from __future__ import annotations

from math import pi

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.base.names import in_csv
from xosc_lateral.files.columns import comma_numbers, indicators, plain_cells, seconds_of_stamps
from xosc_lateral.files.mapping import UNITS, factor, is_measured, spelled


# ---- units -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("column", "unit", "expected"),
    [
        ("offset", "cm", 0.01),
        ("offset", "-cm", -0.01),  # counted to the right
        ("time", "ms", 1e-3),
        ("time", "h", 3600.0),
        ("speed", "km/h", 1.0 / 3.6),
        ("speed", "mph", 1609.344 / 3600.0),
        ("speed", "kn", 1852.0 / 3600.0),
        ("lane_width", "ft", 0.3048),
        ("curvature", "1/km", 1e-3),
        ("acceleration", "g", 9.80665),
        ("yaw_of_mine", "deg", pi / 180.0),  # no column of the standard table: SI
        ("my_share", "%", 0.01),
        ("my_share", "-", 1.0),
    ],
)
def test_a_unit_becomes_that_of_the_standard_table(column: str, unit: str, expected: float) -> None:
    assert factor(column, unit) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("unit", UNITS)
def test_a_leading_minus_turns_the_sign_of_every_unit_but_none(unit: str) -> None:
    if unit != "-":
        assert factor("anything", f"-{unit}") == -factor("anything", unit)


@pytest.mark.parametrize(
    ("column", "unit", "message"),
    [
        ("speed", "m", "speed is held in m/s, m measures length"),
        ("offset", "s", "offset is held in m, s measures time"),
        ("offset", "furlong", "unknown unit 'furlong'; known: m, cm"),
        ("offset", "", "unknown unit ''"),
    ],
)
def test_what_measures_something_else_is_refused(column: str, unit: str, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}"):
        factor(column, unit)


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("[km/h]", "km/h"), ("kmh", "km/h"), (" m / s ", "m/s"), ("m/s²", "m/s2"), ("m/s^2", "m/s2"), ("°/s", "deg/s"),
        ("Degrees", "deg"), ("µs", "us"), ("μs", "us"), ("1", "-"), ("", ""), ("[]", ""), ("furlong", None),
    ],
)  # fmt: skip
def test_spellings_of_bus_logs_are_known(written: str, expected: str | None) -> None:
    assert spelled(written) == expected


def test_every_unit_is_spelled_as_itself_and_counts_measure_nothing() -> None:
    for unit in UNITS:
        known = spelled(unit)
        assert known is not None
        assert UNITS[known] == UNITS[unit]
    assert [is_measured(unit) for unit in ("m", "deg", "-", "%", "furlong")] == [True, True, False, False, False]


# ---- numbers in words ------------------------------------------------------------------------------------------------
def test_decimal_commas_and_points_of_thousands_are_read() -> None:
    found = comma_numbers(pd.Series(["3,75", "-0,5", "1.234,5", "7", "1,5e3", None], index=[3, 4, 5, 6, 7, 8]))
    assert found is not None
    assert found.iloc[:5].tolist() == [3.75, -0.5, 1234.5, 7.0, 1500.0]
    assert np.isnan(found.iloc[5])
    assert found.index.tolist() == [3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize("texts", [["3.75", "4.5"], ["3,75", "left"], ["1,2,3"], [None, None]])
def test_what_are_no_such_numbers_are_none(texts: list[str | None]) -> None:
    assert comma_numbers(pd.Series(texts, dtype=object)) is None


@given(st.lists(st.floats(-9e5, 9e5), min_size=1, max_size=10))
def test_numbers_written_the_german_way_come_back(values: list[float]) -> None:
    written = [f"{value:.3f}" for value in values]
    found = comma_numbers(pd.Series([text.replace(".", ",") for text in written]))
    assert found is not None
    np.testing.assert_allclose(found, [float(text) for text in written], atol=1e-9)  # 0.0025 is written 0.003


# ---- times in words --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "texts",
    [
        ["2026-11-21T14:03:05.120", "2026-11-21T14:03:06.120", "2026-11-21T14:04:05.120"],
        ["2026-11-21T14:03:05.12+01:00", "2026-11-21T13:03:06.12Z", "2026-11-21T13:04:05.12+00:00"],
        ["21.11.2026 14:03:05,12", "21.11.2026 14:03:06,12", "21.11.2026 14:04:05,12"],
        ["11/21/2026 2:03:05.12 PM", "11/21/2026 2:03:06.12 PM", "11/21/2026 2:04:05.12 PM"],
    ],
)
def test_dates_count_from_the_earliest(texts: list[str]) -> None:
    found = seconds_of_stamps(pd.Series(texts))
    assert found is not None
    np.testing.assert_allclose(found, [0.0, 1.0, 60.0], atol=1e-6)


def test_clock_times_count_from_midnight_and_run_past_it() -> None:
    found = seconds_of_stamps(pd.Series(["23:59:58", "23:59:59,5", "00:00:01", None, "00:01"]))
    assert found is not None
    np.testing.assert_allclose(found, [86398.0, 86399.5, 86401.0, np.nan, 86460.0])


@pytest.mark.parametrize("texts", [["left", "right"], [None], ["2026-11-21T14:03:05", "soon"]])
def test_what_are_no_times_are_none(texts: list[str | None]) -> None:
    assert seconds_of_stamps(pd.Series(texts, dtype=object)) is None


# ---- words -----------------------------------------------------------------------------------------------------------
def test_words_that_change_on_the_way_become_a_column_each() -> None:
    words = pd.Series(["dry", "wet", "dry", "wet"])
    found = indicators("surface", words, None, 5)
    assert {name: values.tolist() for name, values in found.items()} == {
        "surface=dry": [1.0, 0.0, 1.0, 0.0], "surface=wet": [0.0, 1.0, 0.0, 1.0],
    }  # fmt: skip


def test_a_label_of_the_drive_is_no_context() -> None:
    words, drives = pd.Series(["anna", "anna", "ben", "ben"]), pd.Series(["a", "a", "b", "b"])
    assert indicators("driver", words, drives, 5) == {}
    assert indicators("driver", words, pd.Series(["a"] * 4), 5)
    assert indicators("driver", pd.Series(["x"] * 4), None, 5) == {}
    assert indicators("driver", pd.Series(list("abcdef")), None, 5) == {}


@pytest.mark.parametrize(
    ("text", "expected"),
    [("=1+1", "'=1+1"), ("+49", "'+49"), ("-x", "'-x"), ("@a", "'@a"), ("\tx", "'\tx"), ("ego", "ego"), ("", "")],
)
def test_no_spreadsheet_takes_a_name_for_a_formula(text: str, expected: str) -> None:
    assert in_csv(text) == expected


def test_cells_with_lists_and_bytes_become_text() -> None:
    column = pd.Series([1, [1, 2], {"a": 1}, b"x", "y"], dtype=object)
    assert plain_cells(column).tolist() == [1, "[1, 2]", "{'a': 1}", "b'x'", "y"]
    numbers = pd.Series([1.0, 2.0])
    assert plain_cells(numbers) is numbers
