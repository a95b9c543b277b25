"""Words for numbers and tables."""

from __future__ import annotations

import pytest

from xosc_lateral.base.texts import counted, hours_in_words


@pytest.mark.parametrize(("number", "words"), [(0, "0 segments"), (1, "1 segment"), (2, "2 segments")])
def test_one_is_not_several(number: int, words: str) -> None:
    assert counted(number, "segment") == words


@pytest.mark.parametrize(
    ("hours", "words"), [(0.002, "0.1 min"), (0.999, "59.9 min"), (1.0, "1.00 h"), (7.5, "7.50 h")]
)
def test_less_than_an_hour_is_in_minutes(hours: float, words: str) -> None:
    assert hours_in_words(hours) == words
