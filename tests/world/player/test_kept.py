"""Scenarios play as they did: every action, condition and kind of road that scenarios are made of."""

from __future__ import annotations

import pytest

from tests.kit.kept import SEEDS, difference, kept, played
from tests.kit.made.actions import ACTIONS


@pytest.mark.parametrize("seed", SEEDS)
def test_a_made_scenario_plays_as_it_did(seed: int) -> None:
    assert not difference(played(seed), kept("played")[str(seed)])


def test_each_action_is_among_them() -> None:
    assert {list(ACTIONS)[seed % len(ACTIONS)] for seed in SEEDS} == set(ACTIONS)


def test_what_differs_is_named() -> None:
    before = {"a": [[1.0, None], ["x", 2]], "b": 3}
    assert not difference({"a": [[1.0 + 1e-9, None], ["x", 2]], "b": 3}, before)
    assert difference({"a": [[1.0, None], ["x", 2.1]], "b": 3}, before) == "/a/1/1: 2.1, kept 2"
    assert difference({"a": [[1.0], ["x", 2]], "b": 3}, before) == "/a/0: [1.0], kept [1.0, None]"
    assert difference({"b": 3}, before) == f": {{'b': 3}}, kept {before}"
