"""What is left is checked by any column at any delay: silent where nothing acts, not where a course over time does."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.omnibus import LEVEL, check_remainder, tents
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.timeline import Coarse

COLUMNS = [Column(name, Values.NUMBER, False) for name in ("idle", "x")]
DRIVE = np.zeros(200, dtype=np.intp)


def drive(seed: int, size: float) -> Coarse:
    """0.1 m of movement over 25 min; 3 s ahead of a column's rise the car goes to one side, 5 s later to the other."""
    rng = np.random.default_rng(seed)
    n = round(1500.0 / STEP)
    x, idle = wander(rng, n, 10.0), wander(rng, n, 10.0)
    course = np.roll(x, -round(3.0 / STEP)) - np.roll(x, round(5.0 / STEP))  # no gain: nothing stays in a long bend
    return coarse_of(size * course + movement(rng, 1500.0), {"x": x, "idle": idle})


def checked(coarse: Coarse, seed: int = 1) -> tuple[float, tuple[str, ...], float]:
    root = np.random.SeedSequence(seed)
    quantities = Search.over(coarse, COLUMNS, root, ERROR_BUDGET).quantities
    result = check_remainder(fit_model(coarse, ()), quantities, root)
    return result.p_value, result.columns, result.share


def test_kernels_have_gain_one_and_are_as_late_as_they_say() -> None:
    ramp = tents(np.arange(200.0), DRIVE)
    assert ramp[100:120, 4] == pytest.approx(np.arange(100.0, 120.0)[:, None][:, 0] - 3.0, abs=0.5)
    assert tents(np.ones(200), DRIVE) == pytest.approx(1.0)


def test_kernels_never_reach_into_another_drive() -> None:
    values, drives = np.repeat([0.0, 1.0], 100), np.repeat([0, 1], 100)
    assert tents(values, drives)[:, 0] == pytest.approx(values)
    assert tents(values, drives)[:, -1] == pytest.approx(values)


def test_a_course_without_gain_is_seen_where_it_is_all_there_is() -> None:
    p_value, columns, share = checked(drive(5, 0.06))
    assert (p_value < 1e-3, columns) == (True, ("x",))
    assert share > 0.02


def test_nothing_is_seen_where_nothing_acts() -> None:
    """At a level of 5 %, three of four are chance in one test of two thousand."""
    assert sum(checked(drive(seed, 0.0))[0] <= LEVEL for seed in (11, 12, 13, 14)) < 3
