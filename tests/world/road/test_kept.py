"""Roads answer as they did."""

from __future__ import annotations

import pytest

from tests.kit.kept import ROADS, difference, kept, road_answers


@pytest.mark.parametrize("name", ROADS)
def test_a_hand_written_road_answers_as_it_did(name: str) -> None:
    assert not difference(road_answers(name), kept("roads")[name])
