"""What happened last is remembered: a driver whose place keeps what the last bend did to it."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
import pytest

from tests.kit.coarse import STEP, coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import ColumnEffect
from xosc_lateral.extras.loop.columns import Column, Values
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.model import Outcome, fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
from xosc_lateral.extras.loop.terms.mean import MeanTerm

DRIVES, SECONDS = 8, 510.0


def bends(rng: np.random.Generator) -> np.ndarray:
    """Of a drive: 5 to 15 s to either side, 8 to 40 s apart. [1/m]"""
    curvature, at = np.zeros(round(SECONDS / STEP)), 0.0
    while at < SECONDS:
        at += rng.uniform(8.0, 40.0)
        lasts = rng.uniform(5.0, 15.0)
        curvature[round(at / STEP) : round((at + lasts) / STEP)] = rng.choice([-1, 1]) * rng.uniform(0.001, 0.004)
        at += lasts
    return np.convolve(curvature, np.full(10, 0.1), "same")


def searched(seed: int, remembers: float, follows: float) -> Outcome:
    """The best effect on the mean of a driver who keeps to where the last bend put him, or follows the present one."""
    rng = np.random.default_rng(seed)
    roads = [bends(rng) for _ in range(DRIVES)]
    last = [list(accumulate(road, lambda held, now: held if abs(now) < 0.0005 else now)) for road in roads]
    curvature, speed = np.concatenate(roads), 30.0 + 3.0 * wander(rng, DRIVES * len(roads[0]), 60.0)
    offset = movement(rng, DRIVES * SECONDS) + remembers * np.sign(np.concatenate(last)) + follows * curvature / 0.0025
    coarse = coarse_of(offset, {"curvature": curvature, "speed": speed}, drives=DRIVES)
    columns = [Column("curvature", Values.NUMBER, False), Column("speed", Values.NUMBER, False)]
    search = Search.over(coarse, columns, np.random.SeedSequence(seed), ERROR_BUDGET)
    outcome = MeanTerm.test(search, fit_model(coarse, ()))
    assert outcome is not None
    return outcome


def effect_of(outcome: Outcome) -> ColumnEffect:
    assert isinstance(outcome.term, MeanTerm)
    return outcome.term.effect


@pytest.mark.parametrize("seed", range(31, 35))
def test_the_last_bend_is_named_with_its_memory(seed: int) -> None:
    outcome = searched(seed, 0.06, 0.0)
    assert outcome.columns == ("curvature",)
    assert outcome.p_value < 1e-4
    assert effect_of(outcome).episode > 0.0


@pytest.mark.parametrize("seed", [41, 42])
def test_who_follows_the_bend_that_he_is_in_has_no_memory(seed: int) -> None:
    assert effect_of(searched(seed, 0.0, 0.1)).episode == 0.0


def test_where_nothing_is_remembered_nothing_is_found() -> None:
    assert [searched(seed, 0.0, 0.0).term for seed in range(51, 55)] == [None] * 4
