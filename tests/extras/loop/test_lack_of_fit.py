"""What a loop leaves: beside the floor that the drives have against themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.kit.coarse import movement, timeline_of
from xosc_lateral.extras.loop.residual import (
    LackOfFit,
    _mean_of_finite,
    half_samples,
    lack_of_fit_of,
    size_of,
    statistics_of,
)

SECONDS = 1800.0


def test_cells_that_nobody_drove_in_do_not_count() -> None:
    assert size_of({"": np.array([0.3, np.nan, -0.4])}) == pytest.approx(np.sqrt(0.125))
    assert size_of({"": np.array([np.nan])}) == 0.0
    several = np.array([[1.0, np.nan, np.nan], [3.0, 2.0, np.nan]])
    np.testing.assert_array_equal(_mean_of_finite(several), [2.0, 2.0, np.nan])


@pytest.fixture(scope="module")
def drive() -> Any:
    timeline = timeline_of(movement(np.random.default_rng(101), SECONDS))
    statistics = statistics_of(timeline, {}, None)
    return timeline, statistics, statistics.describe(timeline.offset, timeline.valid)


def left_by(drive: Any, runs: np.ndarray) -> LackOfFit:
    """What a refined profile that gives `runs` leaves."""
    timeline, statistics, real = drive
    blocks = np.arange(len(timeline)) // 300
    halves = half_samples(statistics, timeline.offset, blocks, np.random.default_rng(1))
    nothing = {name: np.zeros_like(values) for name, values in real.items()}
    return lack_of_fit_of(real, nothing, statistics.describe(runs, timeline.valid), halves)


def test_every_group_has_its_own_error_and_floor(drive: Any) -> None:
    lack = left_by(drive, 1.5 * drive[0].offset)
    assert [one.name for one in lack.groups] == list(drive[2])
    for one in lack.groups:
        np.testing.assert_allclose(one.after, 0.5 * one.before, rtol=1e-6)  # everything is half as large again
        assert one.floor > 0.0


def test_a_profile_that_is_the_drive_leaves_nothing(drive: Any) -> None:
    lack = left_by(drive, drive[0].offset)
    assert [one.after for one in lack.groups] == [0.0] * len(lack.groups)
    assert lack.floor > 0.0
