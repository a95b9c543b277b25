"""Scenarios are written as they were, for every target, with paths of all vehicles and of one among maneuvers."""

from __future__ import annotations

import pytest

from tests.kit.kept import WRITTEN, difference, kept, outputs


@pytest.mark.pages
@pytest.mark.parametrize("seed", WRITTEN)
def test_a_made_scenario_is_written_as_it_was(seed: int) -> None:
    assert not difference(outputs(seed), kept("written")[str(seed)])
