"""Fits of the board's models with a small budget: what is tested is the board."""

from __future__ import annotations

from collections.abc import Iterator
from unittest.mock import patch

import pytest

from laboratory.board.models import calibration


@pytest.fixture(scope="module", autouse=True)
def small_budget() -> Iterator[None]:
    with patch.multiple(calibration, FIRST_POINTS=8, DESCENTS=1, FIRST_STEPS=5, STEPS=5):
        yield
