"""A column that long drives lack was not measured there: it says which drive it is, and nothing about the driver."""

from __future__ import annotations

import numpy as np

from tests.kit.coarse import movement, timeline_of, wander
from xosc_lateral.extras.loop.residual import statistics_of
from xosc_lateral.extras.loop.timeline import missing_throughout

SECONDS = 700.0


def test_drives_without_a_column_are_no_bin_of_their_own() -> None:
    rng = np.random.default_rng(3)
    n = 2 * round(SECONDS / 0.2)
    gap = 40.0 + 10.0 * wander(rng, n, 20.0)
    gap[: n // 2] = np.nan  # the first drive's car measures none
    gap[-n // 4 : -n // 8] = np.nan  # the second one's meets nobody for a while
    timeline = timeline_of(movement(rng, 2.0 * SECONDS), {"gap": gap}, drives=2)
    gone = missing_throughout(gap, timeline)
    assert gone[: n // 2].all() and not gone[n // 2 :].any()
    labels = statistics_of(timeline, {"gap": gap}).labels["gap"]
    assert (labels[: n // 2] == -1).all()
    assert (labels[-n // 4 : -n // 8] >= 0).all()


def test_a_short_drive_that_meets_nobody_counts() -> None:
    rng = np.random.default_rng(4)
    n = 2 * round(120.0 / 0.2)
    gap = np.where(np.arange(n) < n // 2, np.nan, 30.0)
    assert not missing_throughout(gap, timeline_of(movement(rng, 240.0), {"gap": gap}, drives=2)).any()
