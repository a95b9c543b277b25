"""Numbers, times and words as strangers write them, against what they mean."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.files.columns import comma_numbers, indicators, plain_cells, seconds_of_stamps


def column(*values: object) -> pd.Series:
    return pd.Series(list(values), dtype=object)


# ---- decimal commas --------------------------------------------------------------------------------------------------
def german(value: float) -> str:
    return f"{value:,.3f}".translate(str.maketrans(",.", ".,"))


def test_numbers_with_decimal_commas_are_the_numbers_that_were_written() -> None:
    values = np.random.default_rng(1).normal(0.0, 3000.0, 300).round(3)
    found = comma_numbers(column(*(german(value) for value in values)))
    assert found is not None
    np.testing.assert_allclose(found, values, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "value"), [("3,75", 3.75), (" -0,1 ", -0.1), ("+1.234,5", 1234.5), (",5", 0.5), ("1,5e-3", 0.0015)]
)
def test_a_comma_number_beside_whole_ones_and_gaps(text: str, value: float) -> None:
    found = comma_numbers(column(text, None, "7"))
    assert found is not None
    assert found[0] == pytest.approx(value)
    assert np.isnan(found[1])
    assert found[2] == 7.0


@pytest.mark.parametrize(
    "cells",
    [("3.75", "4"), ("left", "3,5"), ("1,2,3", "4,0"), (None, None), ("12.34,5", "1,0"), ("1,5 m", "2,0 m")],
    ids=str,
)
def test_what_is_no_such_number_is_left_to_others(cells: tuple[object, ...]) -> None:
    assert comma_numbers(column(*cells)) is None


# ---- times -----------------------------------------------------------------------------------------------------------
FORMS = {
    "ISO": lambda at: at.isoformat(),
    "ISO without a zone": lambda at: at.replace(tzinfo=None).isoformat(" "),
    "German": lambda at: at.strftime("%d.%m.%Y %H:%M:%S,") + f"{at.microsecond // 10_000:02d}",
    "German, dots": lambda at: at.strftime("%d.%m.%Y %H:%M:%S.") + f"{at.microsecond // 10_000:02d}",
    "clock": lambda at: at.strftime("%H:%M:%S.") + f"{at.microsecond // 10_000:02d}",
    "clock, comma": lambda at: at.strftime("%H:%M:%S,") + f"{at.microsecond // 10_000:02d}",
}


@pytest.mark.parametrize("form", FORMS)
def test_times_in_words_are_seconds_from_the_first_or_from_midnight(form: str) -> None:
    begin = datetime(2026, 3, 5, 14, 3, 5, 120_000, tzinfo=UTC)  # a day that is a month as well
    steps = 0.05 * np.arange(40)
    found = seconds_of_stamps(column(*(FORMS[form](begin + timedelta(seconds=float(step))) for step in steps)))
    assert found is not None
    midnight = 14 * 3600 + 3 * 60 + 5.12 if form.startswith("clock") else 0.0
    np.testing.assert_allclose(found, midnight + steps, atol=0.011)


def test_a_clock_runs_on_past_midnight() -> None:
    found = seconds_of_stamps(column("23:59:59", "00:00:01", "00:00:03"))
    assert found is not None
    np.testing.assert_allclose(found, [86_399.0, 86_401.0, 86_403.0])


def test_hours_and_minutes_alone_are_a_clock_too() -> None:
    found = seconds_of_stamps(column("7:30", "7:31"))
    assert found is not None
    assert found.tolist() == [27_000.0, 27_060.0]


def test_a_row_without_a_time_has_none() -> None:
    found = seconds_of_stamps(column("2026-03-05T14:00:00", None, "2026-03-05T14:00:02"))
    assert found is not None
    np.testing.assert_array_equal(found, [0.0, np.nan, 2.0])


@pytest.mark.parametrize("cells", [("dry", "wet"), (None,), ("14:00", "noon")], ids=str)
def test_words_are_no_times(cells: tuple[object, ...]) -> None:
    assert seconds_of_stamps(column(*cells)) is None


# ---- words -----------------------------------------------------------------------------------------------------------
def test_every_word_of_a_column_gets_a_switch_and_every_row_has_one_on() -> None:
    words = np.random.default_rng(2).choice(["dry", "wet", "snow"], size=200)
    found = indicators("road", pd.Series(words), None, 5)
    assert set(found) == {"road=dry", "road=wet", "road=snow"}
    np.testing.assert_array_equal(sum(found.values()), 1.0)
    for name, values in found.items():
        np.testing.assert_array_equal(values, words == name.removeprefix("road="))


@pytest.mark.parametrize(
    ("words", "drives", "most"),
    [
        (("a", "b", "c"), None, 2),  # more than are wanted
        (("a", "a", "a"), None, 5),  # only one
        (("a", "a", "b"), (1, 1, 2), 5),  # a label: it changes within no drive
    ],
    ids=["too many", "one", "a label"],
)
def test_what_says_nothing_within_a_drive_is_no_context(words, drives, most: int) -> None:
    assert indicators("x", pd.Series(words), None if drives is None else pd.Series(drives), most) == {}


def test_a_word_that_changes_within_one_drive_is_context_of_all() -> None:
    assert set(indicators("x", pd.Series(["a", "b", "a", "a"]), pd.Series([1, 1, 2, 2]), 5)) == {"x=a", "x=b"}


def test_lists_and_records_of_parquet_become_text_and_the_rest_stays() -> None:
    strange = plain_cells(column([1, 2], {"a": 1}, b"xy", "plain", None, 3.5))
    assert strange.tolist()[:4] == ["[1, 2]", "{'a': 1}", "b'xy'", "plain"]
    assert strange.tolist()[5] == 3.5
    numbers = pd.Series([1.0, 2.0])
    assert plain_cells(numbers) is numbers
