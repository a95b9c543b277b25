"""A term of the movement's size that holds within drives alone is taken back: levels of its drives would undo it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.coarse import SPREAD, STEP, coarse_of, wander
from xosc_lateral.drivers.model.effects import Acts, Linear
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, UNDONE, is_undone_by_levels, select
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.timeline import PAD, Coarse

DRIVES, SECONDS = 40, 240.0
TERM = SpreadTerm.of(Linear(acts=Acts.SPREAD, column="x", response_s=0.3))


def population(seed: int, *, between: float, drives: int = DRIVES) -> Coarse:
    """Drives whose log spread is 0.5 x within them, and `between` x from drive to drive; each has a level besides."""
    rng = np.random.default_rng(seed)
    n = round(SECONDS / STEP) + 2 * PAD
    offsets, columns = [], []
    for _ in range(drives):
        mean, rest = rng.normal(), wander(rng, n, 20.0)
        log_spread = 0.5 * rest + between * mean + 0.2 * rng.normal()
        offsets.append(SPREAD * wander(rng, n, 5.0) * np.exp(log_spread))
        columns.append(mean + rest)
    return coarse_of(np.concatenate(offsets), {"x": np.concatenate(columns)}, drives=drives)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("between", "undone"), [(0.5, False), (-0.2, True)])
def test_levels_undo_what_holds_within_drives_alone(seed: int, between: float, undone: bool) -> None:
    assert is_undone_by_levels(fit_model(population(seed, between=between), (TERM,)), TERM) is undone


def test_between_few_drives_nothing_is_compared() -> None:
    assert not is_undone_by_levels(fit_model(population(1, between=-0.2, drives=6), (TERM,)), TERM)


@pytest.mark.pages
def test_it_is_taken_back_with_its_reason() -> None:
    coarse = population(2, between=-0.2)
    selection = select(
        Search.over(coarse, [Column("x", Values.NUMBER, False)], np.random.SeedSequence(1), ERROR_BUDGET)
    )
    assert not [one for one in selection.accepted if isinstance(one.term, SpreadTerm)]
    (rejected,) = [one for one in selection.rejected if one.was_found]
    assert (rejected.component, rejected.columns, rejected.why) == ("spread", ("x",), UNDONE)


def test_short_drives_of_very_different_loudness_are_fitted() -> None:
    """The autoregression of these came to the edge of what is stationary, and runs of it grew beyond all numbers."""
    rng = np.random.default_rng(1_012_030)
    n = round(120.0 / STEP) + 2 * PAD
    offsets, columns = [], []
    for _ in range(12):
        x = 2.0 * rng.normal() + wander(rng, n, 30.0)
        level = np.exp(0.25 * rng.normal())
        offsets.append(SPREAD * wander(rng, n, 5.0) * level * np.exp(0.3 * x))
        columns.append(x)
    fitted = fit_model(coarse_of(np.concatenate(offsets), {"x": np.concatenate(columns)}, drives=12), (TERM,))
    assert np.isfinite(fitted.log_likelihood)
    assert fitted.log_sizes == pytest.approx([0.3], abs=0.2)
